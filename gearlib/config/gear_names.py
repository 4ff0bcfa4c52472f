"""Whose gears: the name that every figure, page and command gives to what it is about."""

import math

from gearlib.config.gears_section import FZG_C, DrawnPair

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
    teeth = f"z {pinion.teeth}/{'-' if wheel.internal else ''}{wheel.teeth}"
    known = DrawnPair.unchecked(**FZG_C)
    named = (pinion, wheel) == (known.pinion, known.wheel)
    name = f"{'FZG type C' if named else 'gear pair'} {teeth}, {_rack(pinion)}"
    key = section.relief()
    return name + (key and f", {key.split('.')[1].replace('_', ' ')}")


def _rack(gear):
    helix = f", β {math.degrees(gear.helix_angle):.4g}°" if gear.helix_angle else ""
    return f"m {1e3 * gear.module:.4g} mm{helix}"


def of_numbers(pair):
    """Return the name of the parameters of a gear pair, an object or a dict."""
    given = pair if isinstance(pair, dict) else {key: getattr(pair, key) for key in PAPER}
    if all(abs(given[key] - value) <= 1e-9 * value for key, value in PAPER.items()):
        return "paper's pair"
    return (
        f"gear pair C_max {given['max_stiffness']:.4g} N/m, κ {given['stiffness_ratio']:.4g}, "
        f"ε {given['contact_ratio']:.4g}, m_red {given['reduced_mass']:.4g} kg"
    )


def of_pair(c):
    """Return the name of the gear pair of a configuration."""
    return of_drawing(c.gears) if c.gears else of_numbers(c.gear_pair)


def of_reducer(c):
    """Return the name of the reducer of the section `reducer`, every mesh of which is the pair."""
    return _of_reducer(c, c.reducer.teeth, "")


def _of_reducer(c, teeth, pair):
    own = teeth and list(teeth) != type(c.reducer).model_fields["teeth"].default
    whose = f"reducer z {_of_teeth(teeth)}" if own else "paper's reducer (Fig. 1 a)"
    return f"{whose}, every mesh: {pair or of_pair(c)}"


def _of_teeth(teeth):
    return "/".join(map(str, teeth))


def of_train(c, pair=""):
    """Return the name of the train of a configuration, and of its pairs where they are others."""
    train = c.train
    if train.kind == "planetary":
        own = train.planetary.model_dump(exclude_defaults=True)
        return "planetary set of own numbers" if own else "Lin and Parker's planetary set"
    if train.kind == "planetary_set":
        drawn = train.planetary_set
        teeth = [getattr(drawn, key).teeth for key in ("sun", "planet", "ring")]
        return f"planetary set z {_of_teeth(teeth)}, {_rack(drawn.sun)}"
    if train.kind == "own":
        counts = f"{len(train.own.bodies)} bodies, {len(train.own.meshes)} meshes"
        return f"own train, {counts}"
    teeth = getattr(train, train.kind).teeth
    if train.kind == "split_power_reducer":
        return _of_reducer(c, teeth, pair)
    kind = f"{_KINDS[train.kind]} z {_of_teeth(teeth)}" if teeth else _KINDS[train.kind]
    return f"{kind}, both meshes: {pair or of_pair(c)}"


def is_paper(c):
    """Return whether a configuration is about the paper's pair."""
    return of_pair(c) == "paper's pair"
