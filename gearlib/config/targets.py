"""Why some targets of the workflow cannot be about the gears of a configuration.

A refusal is a function of the checked configuration ``c``; it returns a sentence without its
point, or "" where the target can be computed.
"""

from functools import partial
from importlib.util import find_spec
from typing import get_args

from gearlib.config import gears_section
from gearlib.config.experiments import PEERS
from gearlib.config.gear_pair_section import BEARINGS
from gearlib.config.train_section import PAIR_TRAINS, Kind

#: Targets about the section `train`, whichever train it describes.
TRAIN_TARGETS = ("train_sweep", "campbell")
#: Targets that no configuration computes unless it names them.
ONLY_IF_NAMED = ("train_sweep", "measured")
#: Figs. 2 to 8 and the table of statements.
PAPER_TARGETS = ("phase_lag", "resonance", "phase_planes", "scenes", "jump", "claims")
#: Asks for a train.
NO_TRAIN = (
    "train is missing: it must be a section of the configuration, whose kind is one of "
    f"{', '.join(get_args(Kind))}"
)


def refusal(target, c):
    """Return why a target cannot be about the gears of a configuration, or ""."""
    return _REFUSALS[target](c) if target in _REFUSALS else ""


def for_targets(text, *names):
    """Return the sentence of a refusal with the names of the targets that it is about."""
    return f"{text}, for the target{'s' if names[1:] else ''} {', '.join(names)}"


def installed(method):
    """Return whether the package of a method is installed; methods of gearlib need none."""
    return method not in PEERS or find_spec(PEERS[method]) is not None


def has_own_train(c):
    """Return whether the section `train` describes another train than the paper's reducer."""
    return c.train.kind != "split_power_reducer" or bool(c.train.split_power_reducer.model_dump())


def undamped(c):
    """Return the sentence that asks for the damping of a train whose gears move, or ""."""
    meshes = {}
    if c.train.kind == "planetary_set":
        meshes["planetary_set"] = c.train.planetary_set
    elif c.train.kind == "own":
        meshes = {f"own.meshes[{i}]": mesh for i, mesh in enumerate(c.train.own.meshes)}
    for key, mesh in meshes.items():
        keys = mesh.model_dump().keys()
        if not keys & {"damping_ratio", "logarithmic_decrement", "material_damping"}:
            name = "material_damping" if "max_stiffness" in keys else "damping_ratio"
            return f"train.{key}.{name} is missing: it must be given where gears move, 0 included"
    return ""


def _bearings(c) -> str:
    """Ask for the bearings of drawn gears on six degrees of freedom."""
    return BEARINGS if c.six_degrees.bearing_stiffness is None else ""


def _bearings_of_scenes(c) -> str:
    """Ask for the bearings where six degrees of freedom may carry a scene."""
    models = {model for scene in c.scenes.values() for model in c.candidates(scene)}
    return _bearings(c) if models - {"one_degree"} else ""


def _scenes(c) -> str:
    if c.gears and not c.scenes:
        return (
            "scenes = {} is not allowed: the paper's suit its pair only, it must have at least one"
        )
    return _bearings_of_scenes(c)


def _only_undrawn(reason, c) -> str:
    """Refuse drawn gears where a target has gears of its own."""
    return f"gears is not allowed: {reason}, it must be left out" if c.gears else ""


def _reducer(c) -> str:
    if c.train.kind != "split_power_reducer":
        return f"train.kind = {c.train.kind!r} is not allowed: it must be split_power_reducer"
    for key in c.train.split_power_reducer.model_dump():
        return (
            f"train.split_power_reducer.{key} is not allowed: it must be left out, and what "
            "the reducer is stand in the section reducer"
        )
    if c.gears and "teeth" not in c.reducer.model_fields_set:
        return "reducer.teeth is missing: it must be given where the gears are drawn"
    return ""


def _train_teeth(c) -> str:
    """Ask for the teeth of a train whose meshes are drawn gears."""
    of_pairs = c.train.kind in PAIR_TRAINS
    if c.gears and of_pairs and getattr(c.train, c.train.kind).teeth is None:
        return f"train.{c.train.kind}.teeth is missing: it must be given where the gears are drawn"
    return ""


def _tolerances(c) -> str:
    if c.tolerances.of_drawing() and c.gears is None:
        name = c.tolerances.parameters[0].parameter
        return (
            f"tolerances.parameters[0].parameter = {name!r} is not allowed: it must be a parameter "
            "of gear_pair where no gears are drawn"
        )
    try:
        c.tolerance_laws()
    except ValueError as error:
        return str(error)
    return ""


_REFUSALS = {
    "scenes": _scenes,
    "claims": partial(_only_undrawn, "its statements are about the paper's pair"),
    "models": _bearings_of_scenes,
    "failures": partial(_only_undrawn, "its problems have gears of their own"),
    "work_precision": lambda c: _bearings(c) if "six_degrees" in c.work_precision.problems else "",
    "reducer": _reducer,
    "campbell": lambda c: _train_teeth(c) if has_own_train(c) else _reducer(c),
    "train_sweep": lambda c: _train_teeth(c) or NO_TRAIN * ("train" not in c.model_fields_set),
    "mesh_stiffness": partial(gears_section.refusal, section_name="mesh_stiffness"),
    "harris_map": partial(gears_section.refusal, section_name="harris_map"),
    "measured": lambda c: (
        "measured = [] is not allowed: it must be a list of YAML files" * (not c.measured)
    ),
    "tolerances": _tolerances,
}
