"""Tunings given as speeds: texts in rpm become numbers before a configuration is checked.

A speed is that of the gear pair, of the case where it changes the gears. So sections that count in
another tuning, those of trains and drawings, take none. In a grid start, stop and step go
together; their tunings are rounded to a decimal that keeps stop a whole multiple of step.
"""

import math
from decimal import Decimal

from pydantic import ValidationError

from gearlib.config import units
from gearlib.config.gear_pair_section import GearPairSection

#: Sections that count in tunings of something else than the gear pair.
_OTHERS = {"reducer", "train", "train_sweep", "campbell", "mesh_stiffness"}
_OTHERS |= {"gears", "gear_pair", "dampings"}
_TUNINGS = {"tuning", "tunings", "shown", "marked", "asked"}
#: Sections whose start and stop are no ends of a grid.
_NO_GRID = {"branches", "run_ups"}
#: Of a grid; the others are lengths of it.
_GRID = ("start", "stop", "step", "window", "fine_step", "share_step")
#: Decimals of the tunings of a grid: with those before the point, a float keeps them all.
_DECIMALS = Decimal("1e-12")
#: Beyond all tunings and numbers of steps that are allowed.
_MOST, _STEPS = 1000, 10**9


def in_tunings(mapping, pair):
    """Return what was read from YAML with tunings in place of speeds, and sentences on wrong ones.

    `pair`, a `GearPairSection`, is None while the gears are refused: then any tunings do.
    """
    problems = []
    tunings = {
        key: value if key in _OTHERS else _section(value, pair, key, problems)
        for key, value in mapping.items()
    }
    return tunings, problems


def _section(node, pair, where, problems):
    """Return a part of a configuration with tunings in place of speeds."""
    if isinstance(node, list):
        return [_section(entry, pair, f"{where}[{i}]", problems) for i, entry in enumerate(node)]
    if not isinstance(node, dict):
        return node
    pair = _changed(pair, node.get("change"))
    section = {
        key: _tuning(value, pair)
        if key in _TUNINGS or (where in _NO_GRID and key in ("start", "stop"))
        else _section(value, pair, f"{where}.{key}", problems)
        for key, value in node.items()
    }
    if where not in _NO_GRID and any(_rpm(section.get(key)) is not None for key in _GRID):
        section |= _grid(section, pair, where, problems)
    return section


def _grid(node, pair, where, problems):
    """Return the keys of a grid as tunings."""
    speeds = {key: _rpm(node[key]) for key in _GRID if key in node}
    for key in (*_GRID[:3], *speeds):
        if speeds.get(key) is None:
            value = f"= {node[key]!r} is not allowed" if key in node else "is missing"
            problems.append(f"{where}.{key} {value}: a grid must be in rpm throughout, or nowhere")
            return {}
    unit = Decimal(rate(pair))
    if unit * speeds["stop"] > _MOST:
        return {key: float(unit * value) for key, value in speeds.items()}
    count = (speeds["stop"] - speeds["start"]) / speeds["step"] if speeds["step"] else Decimal(0)
    if not 0 < count < _STEPS or count % 1:
        problems.append(
            f"{where}.stop = {node['stop']!r} is not allowed: it must be {where}.start = "
            f"{node['start']!r} plus a whole multiple of {where}.step = {node['step']!r}"
        )
        return {}
    start, step = ((unit * speeds[key]).quantize(_DECIMALS) for key in ("start", "step"))
    lengths = {key: value / speeds["step"] * step for key, value in speeds.items()}
    lengths |= {"start": start, "stop": start + count * step}
    return {key: float(value) for key, value in lengths.items()}


def _rpm(value):
    """Return the number of a text in rpm, None of anything else."""
    match = units.RPM.fullmatch(value.strip()) if isinstance(value, str) else None
    return Decimal(match[1]) if match else None


def _tuning(value, pair):
    """Return the tuning of a text in rpm, those of a list, anything else as it is."""
    if isinstance(value, list):
        return [_tuning(entry, pair) for entry in value]
    rpm = _rpm(value)
    return value if rpm is None else float(rpm) * rate(pair)


def rate(pair):
    """Return the tuning of 1 rpm, of any pair where that is None."""
    if pair is None:
        return 1e-4
    return 2.0 * math.pi * pair.teeth / (60.0 * pair.mean_eigenfrequency)


def _changed(pair, change):
    """Return the gears of a case; while its changes are refused, those of all."""
    if pair is None or not isinstance(change, dict):
        return pair
    try:
        return GearPairSection.model_validate(pair.model_dump() | change)
    except ValidationError:
        return pair
