"""Whose gears: the name that every figure, page and command gives to what it is about."""

import math

from gearlib.config.gears_section import FZG_C

#: The mesh of Hortel and Skuderova (2007), by which its pair is known; load and backlash are ours.
PAPER = {
    "max_stiffness": 4e8,
    "stiffness_ratio": 0.5879,
    "contact_ratio": 1.569,
    "reduced_mass": 3.123,
}
_KINDS = {"idler": "idler train", "two_stage": "two-stage train"}


def of_drawing(section):
    """Return the name of a `DrawnPair`, "gear pair z 23/61, m 2.5 mm, tip relief"."""
    pinion, wheel = section.pinion, section.wheel
    known = all(getattr(section, x).model_dump() == FZG_C[x] for x in ("pinion", "wheel"))
    teeth = f"z {pinion.teeth}/{'-' if wheel.internal else ''}{wheel.teeth}"
    name = f"{'FZG type C' if known else 'gear pair'} {teeth}, {_rack(pinion)}"
    key = section.relief()
    return name + (key and f", {key.split('.')[1].replace('_', ' ')}")


def _rack(gear):
    helix = f", β {math.degrees(gear.helix_angle):.4g}°" if gear.helix_angle else ""
    return f"m {1e3 * gear.module:.4g} mm{helix}"


def of_numbers(pair):
    """Return the name of the parameters of a gear pair, an object or a dict."""
    values = pair if isinstance(pair, dict) else {key: getattr(pair, key) for key in PAPER}
    if all(math.isclose(values[key], value, rel_tol=1e-9) for key, value in PAPER.items()):
        return "paper's pair"
    return (
        "gear pair C_max {max_stiffness:.4g} N/m, κ {stiffness_ratio:.4g}, ε {contact_ratio:.4g}, "
        "m_red {reduced_mass:.4g} kg"
    ).format(**values)


def of_pair(c):
    """Return the name of the gear pair of a configuration."""
    return of_drawing(c.gears) if c.gears else of_numbers(c.gear_pair)


def of_reducer(c):
    """Return the name of the reducer of the section `reducer`, every mesh of which is the pair."""
    return _of_reducer(c, c.reducer.teeth, of_pair(c))


def _of_reducer(c, teeth, pair):
    is_paper = not teeth or list(teeth) == type(c.reducer).model_fields["teeth"].default
    name = "paper's reducer (Fig. 1 a)" if is_paper else f"reducer z {_of_teeth(teeth)}"
    return f"{name}, every mesh: {pair}"


def _of_teeth(teeth):
    return "/".join(map(str, teeth))


def of_train(c, pair=""):
    """Return the name of the train of a configuration, and of its pairs where they are others."""
    kind, section = c.train.kind, getattr(c.train, c.train.kind)
    if kind == "planetary":
        changed = section.model_dump()
        return "planetary set of own numbers" if changed else "Lin and Parker's planetary set"
    if kind == "planetary_set":
        teeth = section.sun.teeth, section.planet.teeth, section.ring.teeth
        return f"planetary set z {_of_teeth(teeth)}, {_rack(section.sun)}"
    if kind == "own":
        return f"own train, {len(section.bodies)} bodies, {len(section.meshes)} meshes"
    pair = pair or of_pair(c)
    if kind == "split_power_reducer":
        return _of_reducer(c, section.teeth, pair)
    teeth = f" z {_of_teeth(section.teeth)}" if section.teeth else ""
    return f"{_KINDS[kind]}{teeth}, both meshes: {pair}"


def is_paper(c):
    """Return whether a configuration is about the paper's pair."""
    return of_pair(c) == "paper's pair"
