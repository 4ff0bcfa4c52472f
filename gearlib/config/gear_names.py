"""Names of the gears of a configuration for figures, pages and commands."""

import math
from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError

from gearlib.config.gear_pair_section import GearPairSection
from gearlib.config.gears_section import FZG_C
from gearlib.models.geometry.iso import METHOD_NAMES
from gearlib.models.profiles import create_profile

_TRAIN_NAMES = {"idler": "idler train", "two_stage": "two-stage train"}


def gear_stage_name(pair: Any, modified: bool = True, pitch_errors: bool = True) -> str:
    """Return the name of gears given by geometry: "gear pair z 23/61, m 2.5 mm, tip relief".

    The name states the numbers of teeth z and the normal module m. `pair` is a `StageSection`. If
    a computation neglects tip relief and pitch errors (`modified` is false) or only pitch errors
    (`pitch_errors` is false), the name says that they are left out.
    """
    pinion, wheel = pair.pinion, pair.wheel
    is_fzg = all(getattr(pair, gear).model_dump() == FZG_C[gear] for gear in ("pinion", "wheel"))
    teeth = f"z {pinion.teeth}/{'-' if wheel.internal else ''}{wheel.teeth}"
    name = f"{'FZG type C' if is_fzg else 'gear pair'} {teeth}, {_module_and_helix(pinion)}"
    is_used = {"tip_relief": modified, "pitch_errors": modified and pitch_errors}
    given_keys = [key for key in is_used if pair.modification_key(key)]
    for is_included, suffix in ((True, ""), (False, " left out")):
        keys = [key for key in given_keys if is_used[key] == is_included]
        if keys:
            name += f", {' and '.join(keys).replace('_', ' ')}{suffix}"
    return name


def _module_and_helix(gear: Any) -> str:
    """Format the normal module and, unless it is zero, the helix angle of a gear section."""
    helix = f", β {math.degrees(gear.helix_angle):.6g}°" if gear.helix_angle else ""
    return f"m {1e3 * gear.module:.6g} mm{helix}"


def parameters_differ(base: dict, changed: dict) -> bool:
    """Return whether two configurations have valid gear pairs with different names.

    Both are contents of YAML files. The name of a pair depends on its maximum stiffness, stiffness
    ratio, contact ratio and reduced mass, but not on load and backlash. Return False if one of the
    pairs is missing or invalid.
    """
    try:
        base_pair = GearPairSection.model_validate(base.get("gear_pair"))
        changed_pair = GearPairSection.model_validate(changed.get("gear_pair"))
    except ValidationError:
        return False
    return base_pair.name != changed_pair.name


def gear_pair_name(config: Any, modified: bool = True, pitch_errors: bool = True) -> str:
    """Return the name of the gear pair of a configuration, for titles and captions.

    If a computation neglects tip relief and pitch errors (`modified` is false) or only pitch errors
    (`pitch_errors` is false), the name of gears given by geometry says so.
    """
    if config.gears:
        return gear_stage_name(config.gears, modified, pitch_errors)
    return config.gear_pair.name


def gear_pair_name_with_stiffness(config: Any, teeth: bool, pitch_errors: bool = False) -> str:
    """Return the name of the gear pair of a configuration, including its stiffness model.

    If `teeth` is true, each tooth pair has its own stiffness; otherwise the mesh stiffness is a
    rectangle. Only for gears given by geometry, the name states the stiffness model and the method
    with which the stiffness is computed. `pitch_errors` is false if pitch errors are neglected.
    """
    gears, name = config.gears, gear_pair_name(config, modified=teeth, pitch_errors=pitch_errors)
    if config.profile:
        name += f"; {create_profile(**config.profile.model_dump()).description}"
    if gears is None:
        return name
    # By default, the geometry determines the method for tooth pairs; the rectangle uses ISO 6336.
    method = gears.stiffness or (gears.gear_stage().tooth_stiffness if teeth else "iso")
    name += f"; {'pairs of teeth' if teeth else 'rectangle'}, {METHOD_NAMES[method]}"
    return name + (describe_unused_options(gears) if teeth else "")


def describe_unused_options(gears: Any) -> str:
    """Describe the configured stiffness options that tooth pairs ignore; return "" if none."""
    names = {*(gears.stiffness_options or ())} & {"hertz", "application_factor"}
    return f", without {' and '.join(sorted(names))}" if names else ""


def reducer_name(config: Any) -> str:
    """Return the name of the reducer in the section `reducer`, for titles and captions."""
    return _format_reducer_name(config, config.reducer.teeth)


def _format_reducer_name(config: Any, teeth: Sequence[int] | None) -> str:
    """Return the name of a reducer in which every mesh is the gear pair of the configuration.

    `teeth` lists the numbers of teeth from input to output; None means the reducer of the paper.
    """
    is_paper = not teeth or list(teeth) == type(config.reducer).model_fields["teeth"].default
    name = "paper's reducer (Fig. 1 a)" if is_paper else f"reducer z {'/'.join(map(str, teeth))}"
    return f"{name}, every mesh: {gear_pair_name(config, modified=False)}"


def train_name(config: Any) -> str:
    """Return the name of the gear train of a configuration, for titles and captions.

    The section of the train has the name `config.train.kind`; "own" is a train of user-defined
    bodies and meshes.
    """
    kind, section = config.train.kind, getattr(config.train, config.train.kind)
    if kind == "planetary":
        is_default = not section.model_dump()
        return "Lin and Parker's planetary set" if is_default else "user-defined planetary set"
    if kind == "planetary_set":
        sun, planet, ring = section.sun, section.planet, section.ring
        teeth = f"{sun.teeth}/{planet.teeth}/{ring.teeth}"
        return f"planetary set z {teeth}, {_module_and_helix(sun)}"
    if kind == "own":
        return f"own train, {len(section.bodies)} bodies, {len(section.meshes)} meshes"
    if kind == "split_power_reducer":
        return _format_reducer_name(config, section.teeth)
    teeth = f" z {'/'.join(map(str, section.teeth))}" if section.teeth else ""
    pair_name = gear_pair_name(config, modified=False)
    return f"{_TRAIN_NAMES[kind]}{teeth}, both meshes: {pair_name}"


def is_paper(config: Any) -> bool:
    """Return whether the gear pair of a configuration is the paper's pair, without a profile."""
    return gear_pair_name(config) == "paper's pair" and config.profile is None
