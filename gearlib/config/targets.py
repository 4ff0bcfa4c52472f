"""Check which targets of the workflow can be computed for the gears of a configuration.

The reason why a target cannot be computed is an error message without a full stop, else "".
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
#: Name of the damping in a configuration that contains only a gearbox.
NOT_GIVEN = "not-given"
#: Targets of Figs. 2 to 8 and of the table of claims.
PAPER_TARGETS = ("phase_lag", "resonance", "phase_planes", "scenes", "jump", "claims")
#: Error message for a configuration without a train.
NO_TRAIN = (
    "train is missing: the configuration must have a section train whose kind is one of "
    f"{', '.join(get_args(Kind))}"
)
#: Error messages for a configuration without measured sets, and without a gearbox.
NO_MEASURED_SETS = "measured = [] is not allowed: it must be a list of YAML files"
_NO_GEARBOX = "gearbox is missing: it must be a section with the key file"


#: Targets that accept any stiffness profile of the gear pair.
WITH_PROFILE = ("resonance", "phase_planes", "run_ups", "labels", "measured")


def refusal_reason(target: str, config: Any) -> str:
    """Return the reason why a target cannot be computed for a configuration, or "" if it can.

    `target` is the name of a result of the workflow, such as "resonance". The reason is an error
    message without a full stop.
    """
    if NOT_GIVEN in config.dampings and target != "gearbox":
        return "gears or gear_pair is missing: one of them is required in addition to gearbox"
    if config.profile and target not in WITH_PROFILE:
        return (
            f"profile = {config.profile.kind!r} is not allowed: only the targets "
            f"{', '.join(WITH_PROFILE)} accept a profile"
        )
    return _REASON_FUNCTIONS[target](config) if target in _REASON_FUNCTIONS else ""


def append_target_names(reason: str, target_names: Sequence[str]) -> str:
    """Return the error message `reason` with the names of the targets that it excludes appended."""
    plural = "s" if len(target_names) > 1 else ""
    return f"{reason}, for the target{plural} {', '.join(target_names)}"


def is_installed(method: str) -> bool:
    """Return False if an integration method needs an optional package that is not installed."""
    return method not in METHOD_PACKAGES or find_spec(METHOD_PACKAGES[method]) is not None


def has_custom_train(config: Any) -> bool:
    """Return whether the section `train` differs from the default, the paper's reducer.

    The power of this reducer is split among three branches.
    """
    train = config.train
    return train.kind != "split_power_reducer" or bool(train.split_power_reducer.model_dump())


def mesh_damping_error(config: Any) -> str:
    """Return an error message if the damping of a mesh of the train is missing, else "".

    It can only be missing in planetary sets given by geometry and in trains of the user's own
    bodies ("own"). The message asks for a damping coefficient if the stiffness of the mesh is
    given, else for the damping ratio.
    """
    train, meshes = config.train, {}
    if train.kind == "planetary_set":
        meshes["planetary_set"] = train.planetary_set
    elif train.kind == "own":
        meshes = {f"own.meshes[{i}]": mesh for i, mesh in enumerate(train.own.meshes)}
    for mesh_key, mesh in meshes.items():
        keys = mesh.model_dump().keys()
        if not keys & {"damping_ratio", "logarithmic_decrement", "material_damping"}:
            key = "material_damping" if "max_stiffness" in keys else "damping_ratio"
            return f"train.{mesh_key}.{key} is missing: moving gears require it (0 is allowed)"
    return ""


def _bearings_error(config: Any) -> str:
    """Return an error message if the bearing stiffness is missing, else ""."""
    return MISSING_BEARINGS if config.six_degrees.bearing_stiffness is None else ""


def _scenes_error(config: Any) -> str:
    """Return an error message if the scenes of a configuration cannot be computed, else "".

    A scene is the section of a figure with a few runs. If its model may have bearings, the bearing
    stiffness must be given.
    """
    if not config.scenes:
        return (
            "scenes = {} is not allowed: the default scenes suit only the paper's pair, so at "
            "least one scene must be given"
        )
    scenes = config.scenes.values()
    models = {model for scene in scenes for model in config.candidate_models(scene)}
    return _bearings_error(config) if models - {"pair"} else ""


def _geometry_error(reason: str, config: Any) -> str:
    """Return an error message with the `reason` if the gears are given by geometry, else ""."""
    return f"gears is not allowed: {reason}" if config.gears else ""


def _claims_error(config: Any) -> str:
    """Return an error message if the gears are not the gear pair of the paper, else "".

    The target "claims" checks the claims of the paper about this pair.
    """
    if config.gears is None and not gear_names.is_paper(config):
        values = ", ".join(f"{key} {value:g}" for key, value in PAPER.items())
        return f"gear_pair is not allowed: the claims concern the paper's pair, {values}"
    return _geometry_error("the claims concern the paper's pair", config)


def _gears_error(section_name: str, config: Any) -> str:
    """Return an error message if a study of gear geometry has no suitable gears, else "".

    `section_name` is the section of the study, a key of `GEARS_KEYS`. If it defines no gears
    itself, the section `gears` is used. The default gears of the study are only allowed in
    configurations with the gear pair of the paper.
    """
    key = gears_section.GEARS_KEYS[section_name]
    has_gears = config.gears or key in getattr(config, section_name).model_fields_set
    if not has_gears and not gear_names.is_paper(config):
        return f"gears is missing: give the geometry of the gears, or {section_name}.{key}"
    return gears_section.configured_gears_error(config, section_name)


def _reducer_error(config: Any) -> str:
    """Return an error message if the reducer of the paper cannot be computed, else "".

    The target "reducer" has its own section, so the section `train` must not describe another train
    or another reducer.
    """
    train = config.train
    if train.kind != "split_power_reducer":
        return f"train.kind = {train.kind!r} is not allowed: it must be split_power_reducer"
    if keys := [*train.split_power_reducer.model_dump()]:
        return (
            f"train.split_power_reducer.{keys[0]} is not allowed: the section reducer describes "
            "the reducer of this target"
        )
    if config.gears and "teeth" not in config.reducer.model_fields_set:
        return "reducer.teeth is missing: it is required if gears is given"
    return ""


def _teeth_error(config: Any) -> str:
    """Return an error message if the numbers of teeth of the train are missing, else "".

    They are only required for trains in which all meshes have the parameters of one gear pair given
    by geometry, because the default numbers of teeth would contradict the geometry.
    """
    kind = config.train.kind
    if config.gears and kind in PAIR_TRAINS and getattr(config.train, kind).teeth is None:
        return f"train.{kind}.teeth is missing: it is required if gears is given"
    return ""


def _train_sweep_error(config: Any) -> str:
    """Return an error message if the train cannot be swept over speed, else ""."""
    error = _teeth_error(config)
    return NO_TRAIN if not error and "train" not in config.model_fields_set else error


def _tolerances_error(config: Any) -> str:
    """Return an error message if the tolerances are invalid for the gears, else "".

    Tolerances of the geometry require the section `gears`; those of the gear pair do not.
    """
    # All tolerances apply to the geometry or all to the gear pair, so the message names the first.
    if config.tolerances.has_geometry_parameters() and config.gears is None:
        name = config.tolerances.parameters[0].parameter
        return (
            f"tolerances.parameters[0].parameter = {name!r} is not allowed: it must be a parameter "
            "of gear_pair, because gears is not given"
        )
    try:
        config.tolerance_distributions()
    except ValueError as error:
        return str(error)
    return ""


#: Target -> function that returns the reason why it cannot be computed for a configuration, or "".
_REASON_FUNCTIONS = {
    "scenes": _scenes_error,
    "claims": _claims_error,
    "models": _scenes_error,
    "failures": partial(_geometry_error, "the test problems have their own gears"),
    "work_precision": lambda config: (
        _bearings_error(config) if "six_degrees" in config.work_precision.problems else ""
    ),
    "reducer": _reducer_error,
    "campbell": lambda config: (
        _teeth_error(config) if has_custom_train(config) else _reducer_error(config)
    ),
    "train_sweep": _train_sweep_error,
    "mesh_stiffness": partial(_gears_error, "mesh_stiffness"),
    "harris_map": partial(_gears_error, "harris_map"),
    "dynamic_factor": partial(_gears_error, "dynamic_factor"),
    "gearbox": lambda config: "" if config.gearbox else _NO_GEARBOX,
    "measured": lambda config: "" if config.measured else NO_MEASURED_SETS,
    "tolerances": _tolerances_error,
}
