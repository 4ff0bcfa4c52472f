"""Reasons why some targets of the workflow cannot be computed for the gears of a configuration.

Each reason is a sentence without a full stop, or "" where the target can be computed.
"""

from collections.abc import Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any, get_args

from gearlib.config import gear_names, gears_section
from gearlib.config.experiments import METHOD_PACKAGES
from gearlib.config.gear_pair_section import MISSING_BEARINGS
from gearlib.config.train_section import PAIR_TRAINS, Kind
from gearlib.models.pair_parameters import PAPER

#: Targets for any gear train of the section `train`.
TRAIN_TARGETS = ("train_sweep", "campbell")
#: Targets that are computed only if the configuration names them.
ONLY_IF_NAMED = ("train_sweep", "measured", "gearbox")
#: Name of the damping of a configuration with a gearbox alone.
NOT_GIVEN = "not-given"
#: Figs. 2 to 8 and the table of statements.
PAPER_TARGETS = ("phase_lag", "resonance", "phase_planes", "scenes", "jump", "claims")
#: Error message where the configuration has no train.
NO_TRAIN = (
    "train is missing: it must be a section of the configuration, whose kind is one of "
    f"{', '.join(get_args(Kind))}"
)
#: Error message for a configuration without measured sets.
NO_MEASURED_SETS = "measured = [] is not allowed: it must be a list of YAML files"


#: Targets that take any stiffness profile of the gear pair.
WITH_PROFILE = ("resonance", "phase_planes", "run_ups", "labels", "measured")


def refusal(target: str, config: Any) -> str:
    """Return why a target cannot be computed for the gears of a configuration, else ""."""
    if NOT_GIVEN in config.dampings and target != "gearbox":
        return "gears or gear_pair is missing: it must be given beside gearbox"
    if config.profile and target not in WITH_PROFILE:
        return (
            f"profile = {config.profile.kind!r} is not allowed: it must be left out, or the target "
            f"be one of {', '.join(WITH_PROFILE)}"
        )
    return _REFUSALS[target](config) if target in _REFUSALS else ""


def with_target_names(reason: str, target_names: Sequence[str]) -> str:
    """Return an error message: a reason, followed by the targets that are refused for it."""
    plural = "s" if len(target_names) > 1 else ""
    return f"{reason}, for the target{plural} {', '.join(target_names)}"


def installed(method: str) -> bool:
    """Return whether the package of an integration method is installed."""
    return method not in METHOD_PACKAGES or find_spec(METHOD_PACKAGES[method]) is not None


def has_custom_train(config: Any) -> bool:
    """Return whether the section `train` describes another train than the paper's reducer."""
    train = config.train
    return train.kind != "split_power_reducer" or bool(train.split_power_reducer.model_dump())


def missing_mesh_damping(config: Any) -> str:
    """Return the error message for a train that has a mesh without damping, else ""."""
    train, meshes = config.train, {}
    if train.kind == "planetary_set":
        meshes["planetary_set"] = train.planetary_set
    elif train.kind == "own":
        meshes = {f"own.meshes[{i}]": mesh for i, mesh in enumerate(train.own.meshes)}
    for mesh_key, mesh in meshes.items():
        given_keys = mesh.model_dump().keys()
        if not given_keys & {"damping_ratio", "logarithmic_decrement", "material_damping"}:
            key = "material_damping" if "max_stiffness" in given_keys else "damping_ratio"
            return (
                f"train.{mesh_key}.{key} is missing: it must be given where gears move, 0 included"
            )
    return ""


def _missing_bearings(config: Any) -> str:
    """Return the error message for gears without bearing stiffness, else ""."""
    return MISSING_BEARINGS if config.six_degrees.bearing_stiffness is None else ""


def _scenes_error(config: Any) -> str:
    """Return why the scenes, and the models that suffice for them, cannot be computed, else ""."""
    if not config.scenes:
        return (
            "scenes = {} is not allowed: the paper's scenes suit the paper's pair only, at least "
            "one must be given"
        )
    scenes = config.scenes.values()
    models = {model for scene in scenes for model in config.candidate_models(scene)}
    return _missing_bearings(config) if models - {"pair"} else ""


def _geometry_error(reason: str, config: Any) -> str:
    """Return the error message, with its reason, if the configuration has `gears`, else ""."""
    return f"gears is not allowed: {reason}, it must be left out" if config.gears else ""


def _claims_error(config: Any) -> str:
    """Return the error message if the gears are not the paper's, else ""."""
    if config.gears is None and not gear_names.is_paper(config):
        values = ", ".join(f"{key} {value:g}" for key, value in PAPER.items())
        return f"gear_pair is not allowed: the statements are about the paper's pair, {values}"
    return _geometry_error("its statements are about the paper's pair", config)


def _missing_gears(section_name: str, config: Any) -> str:
    """Return why a section of gears given by geometry has none, else ""."""
    key = gears_section.GEARS_KEYS[section_name]
    is_given = config.gears or key in getattr(config, section_name).model_fields_set
    if not is_given and not gear_names.is_paper(config):
        return f"gears is missing: it must be the geometry of the gears, or {section_name}.{key}"
    return gears_section.unsuitable_gears(config, section_name)


def _reducer_error(config: Any) -> str:
    """Return why the paper's reducer cannot be computed for the configuration, else ""."""
    train = config.train
    if train.kind != "split_power_reducer":
        return f"train.kind = {train.kind!r} is not allowed: it must be split_power_reducer"
    if keys := [*train.split_power_reducer.model_dump()]:
        return (
            f"train.split_power_reducer.{keys[0]} is not allowed: it must be left out; the section "
            "reducer describes the reducer of this target"
        )
    if config.gears and "teeth" not in config.reducer.model_fields_set:
        return "reducer.teeth is missing: it must be given beside gears"
    return ""


def _missing_teeth(config: Any) -> str:
    """Return the error message if a train with `gears` has no numbers of teeth, else ""."""
    kind = config.train.kind
    if config.gears and kind in PAIR_TRAINS and getattr(config.train, kind).teeth is None:
        return f"train.{kind}.teeth is missing: it must be given beside gears"
    return ""


def _train_sweep_error(config: Any) -> str:
    """Return why the train cannot be swept over speed, else ""."""
    reason = _missing_teeth(config)
    return NO_TRAIN if not reason and "train" not in config.model_fields_set else reason


def _tolerances_error(config: Any) -> str:
    """Return why the gears cannot have the tolerances of the configuration, else ""."""
    # All parameters belong either to the geometry or to the gear pair; the message has the first.
    if config.tolerances.concern_geometry() and config.gears is None:
        name = config.tolerances.parameters[0].parameter
        return (
            f"tolerances.parameters[0].parameter = {name!r} is not allowed: it must be a parameter "
            "of gear_pair where gears is left out"
        )
    try:
        config.tolerance_distributions()
    except ValueError as error:
        return str(error)
    return ""


#: Target -> function of the configuration that returns why the target is refused, or "".
_REFUSALS = {
    "scenes": _scenes_error,
    "claims": _claims_error,
    "models": _scenes_error,
    "failures": partial(_geometry_error, "its problems have gears of their own"),
    "work_precision": lambda x: (
        _missing_bearings(x) if "six_degrees" in x.work_precision.problems else ""
    ),
    "reducer": _reducer_error,
    "campbell": lambda x: _missing_teeth(x) if has_custom_train(x) else _reducer_error(x),
    "train_sweep": _train_sweep_error,
    "mesh_stiffness": partial(_missing_gears, "mesh_stiffness"),
    "harris_map": partial(_missing_gears, "harris_map"),
    "dynamic_factor": partial(_missing_gears, "dynamic_factor"),
    "gearbox": lambda x: "" if x.gearbox else "gearbox is missing: it must have the key file",
    "measured": lambda x: "" if x.measured else NO_MEASURED_SETS,
    "tolerances": _tolerances_error,
}
