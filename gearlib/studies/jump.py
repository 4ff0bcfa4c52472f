"""Where the motion from rest jumps between two orbits over the tuning, and what moves the jump.

Two tunings a step apart may belong to different attractors (Fig. 6 of the paper: 0.815 and
0.8151). The jump is looked for as what it is, the largest change of the orbit's height between
neighbouring tunings of a cold scan, and bisected: of the middle tuning the height decides to which
side it belongs. A continuous curve ends with two equal heights, and has no jump.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from gearlib.data.variables import describe
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier
from gearlib.runs.sweeping import sweep

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.integrators import rk45  # noqa: F401

#: Heights closer than this, in static deflections, are those of one orbit.
SAME_HEIGHT = 0.1

#: Kinds of variation, and what their value means.
KINDS = {
    "base": "the scene itself",
    "harmonics": "stiffness harmonics",
    "damping": "factor on the damping",
    "backlash": "factor on the backlash",
    "displacement": "initial displacement (static defl.)",
    "velocity": "initial velocity (static defl./rad)",
    "tolerance": "relative tolerance of a 4(5) pair",
}


class Jump(NamedTuple):
    """A jump of the orbit from rest between two tunings."""

    tuning: float  #: middle of the last interval; NaN: there is no jump
    below: float  #: height of the orbit just below, static deflections
    above: float  #: and just above
    switches: int  #: changes of height in the scan at least half as large as the largest


def find(pair, tunings, resolution, direction="cold", **run):
    """Return the `Jump` of a pair within a scan.

    Parameters
    ----------
    pair : GearPair, OneDegreePair or SixDegreePair
    tunings : sequence of float, shape (n,)
        The scan, rising, n >= 2.
    resolution : float
        Width of the last interval.
    direction : {"cold", "up", "down"}
        Of the scan. When the state is carried along, the bisection starts from the state on the
        side from which the jump is reached.
    **run
        Further arguments of `gearlib.sweep`.
    """
    tunings = np.asarray(tunings, float)
    scan = sweep(pair, tunings, direction=direction, **run)
    height = _heights(scan)
    steps, large = height_steps(height)
    i = int(np.argmax(steps))
    low, high = tunings[i], tunings[i + 1]
    below, above = height[i], height[i + 1]
    states = scan.final_state.values
    if direction != "cold":
        run["initial_state"] = tuple(states[i if direction == "up" else i + 1])
    while high - low > resolution:
        middle = 0.5 * (low + high)
        one = sweep(pair, [middle], **run)
        height = float(_heights(one)[0])
        is_below = abs(height - below) <= abs(height - above)
        if is_below:
            low, below = middle, height
        else:
            high, above = middle, height
        if (direction == "up" and is_below) or (direction == "down" and not is_below):
            run["initial_state"] = tuple(one.final_state.values[0])
    if not abs(above - below) > SAME_HEIGHT:
        return Jump(np.nan, float(below), float(above), 0)
    return Jump(0.5 * (low + high), float(below), float(above), int(large.sum()))


def height_steps(height):
    """Return the steps between neighbouring heights of a scan, and which count as switches.

    Parameters
    ----------
    height : ndarray, shape (n,)
        n >= 2; NaN for a run that could not go on: no orbit is like it.

    Returns
    -------
    steps : ndarray, shape (n - 1,)
    large : ndarray of bool, shape (n - 1,)
        At least half as large as the largest, and no difference within one orbit.
    """
    steps = np.nan_to_num(np.abs(np.diff(height)), nan=0.0)
    return steps, steps >= max(0.5 * steps.max(), SAME_HEIGHT)


def _heights(curve):
    return (curve.displacement_max - curve.displacement_min).values


def variations(pair, settings):
    """Yield (kind, value, model, changed arguments of `sweep`) of every variation.

    Parameters
    ----------
    pair : GearPair
    settings : dict
        harmonics, factors, displacements, velocities, tolerances: lists of values.
    """
    yield "base", 0.0, pair, {}
    for n in settings["harmonics"]:
        yield "harmonics", n, OneDegreePair(pair=pair, profile=Fourier(n)), {}
    for factor in settings["factors"]:
        damped = pair.replace(
            material_damping=factor * pair.material_damping,
            backlash_damping=factor * pair.backlash_damping,
        )
        yield "damping", factor, damped, {}
    for factor in settings["factors"]:
        yield "backlash", factor, pair.replace(backlash=factor * pair.backlash), {}
    for x in settings["displacements"]:
        yield "displacement", x, pair, {"initial_state": (x, 0.0)}
    for v in settings["velocities"]:
        yield "velocity", v, pair, {"initial_state": (0.0, v)}
    for rtol in settings["tolerances"]:
        # ode45's defaults keep this ratio of the two.
        options = {"rtol": rtol, "atol": 1e-3 * rtol}
        yield "tolerance", rtol, pair, {"method": "rk45", "options": options}


def compute(pair, tunings, settings, run):
    """Return the jump of the motion from rest and of all its variations.

    Parameters
    ----------
    pair : dict
        Keyword arguments of `GearPair`.
    tunings : sequence of float, shape (n,)
        The scan.
    settings : dict
        As of `variations`, and resolution.
    run : dict
        periods, record_periods, initial_state.

    Returns
    -------
    xarray.Dataset
        height over tuning, of the base; over variation: kind, value, jump (NaN: none in the
        scan), shift against the base, height_below, height_above, switches.
    """
    pair = GearPair(**pair)
    rows = []
    for kind, value, model, changed in variations(pair, settings):
        found = find(model, tunings, settings["resolution"], **run | changed)
        rows.append((kind, float(value), *found))
    kind, value, jump, below, above, switches = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    base = sweep(pair, tunings, **run)
    dataset = xr.Dataset(
        {
            "height": ("tuning", _heights(base)),
            "kind": ("variation", kind.astype(object)),
            "value": ("variation", value),
            "jump": ("variation", jump),
            "shift": ("variation", jump - jump[0]),
            "height_below": ("variation", below),
            "height_above": ("variation", above),
            "switches": ("variation", switches.astype(np.int32)),
        },
        {"tuning": base.tuning.values, "variation": np.arange(kind.size)},
    )
    dataset.attrs = base.attrs | {"title": "Jump of the motion from rest, and what moves it"}
    return describe(dataset)
