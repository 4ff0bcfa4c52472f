"""Causes of contact loss at a tuning: parametric instability, or the forced motion.

Without loss of contact the mesh has one orbit of one mesh period, which its mean load and the
changing stiffness force upon it. Contact is lost either because that orbit itself leaves the flank,
or although it does not, because deviations from it grow: in a tongue.
"""

import math

import numpy as np
from scipy.optimize import brentq

from gearlib.analysis.tongues import meissner
from gearlib.analysis.tongues.search import closing_damping, find
from gearlib.data.result import result, stacked
from gearlib.data.status import flags_of
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep

#: Tunings of the scan for contact lost from rest, about the tongue, and its reach in gap widths.
_SCAN, _REACH = 301, 1.5
#: Tunings of the scan for the forced loss of contact, and how far it looks, in tuning.
_FORCED_SCAN, _FORCED_REACH = 51, 0.5
#: Where tongues next to a tuning are looked for, in shares of it.
_NEXT = 0.7, 1.5
#: Contact lost by less, in static deflections, is rounding.
_TOUCH = 1e-9

NONE, PARAMETRIC, FORCED = 0, 1, 2
CAUSES = {NONE: "none", PARAMETRIC: "parametric instability", FORCED: "forced response"}


def compute(pairs, tuning, start, stop, run):
    """Return the tongues of the dampings of one pair, and what happens at a tuning.

    pairs: keyword arguments of `GearPair` by the name of the damping; tuning: the tuning in
    question; start, stop (range of tunings whose tongues are listed; widened to those next to the
    tuning); run: periods, initial_state of the motion from rest.

    NaN: a closed tongue; a loss of contact that begins or ends beyond the scan, or not near.
    """
    low, high = _NEXT
    start, stop = min(start, low * tuning), max(stop, high * tuning)
    models = {name: GearPair(**parameters) for name, parameters in pairs.items()}
    tongues = {name: find(pair, start, stop) for name, pair in models.items()}
    orders = sorted({one.order for found in tongues.values() for one in found})
    edges = np.full((2, len(models), len(orders)), np.nan)
    for i, found in enumerate(tongues.values()):
        for one in found:
            edges[:, i, orders.index(one.order)] = one.start, one.stop
    some = next(iter(models.values()))
    free = {one.order: one for one in find(some.replace(material_damping=0.0), start, stop)}
    closings = [closing_damping(some, free[n]) if n in free else math.nan for n in orders]
    data = stacked({"damping": list(models)}, lambda name: _facts(models[name], tuning, run)) | {
        "tuning_from": (("damping", "order"), edges[0]),
        "tuning_to": (("damping", "order"), edges[1]),
        "closing_damping": ("order", closings),
        "asked": tuning,
    }
    title = "Parametric resonance of the dampings"
    coords = {"damping": list(models), "order": np.array(orders, np.int32)}
    dataset = result(title, some, data, coords, method="closed form", pairs=pairs, **run)
    dataset["cause"].attrs |= flags_of(CAUSES.values())
    return dataset


def _facts(pair, tuning, run):
    """Return the facts about one pair at a tuning, by their names."""
    equation = meissner.equation_of(pair)
    near = find(pair, *(share * tuning for share in _NEXT))
    nearest = min(near, key=lambda one: _distance(one, tuning), default=None)
    least = orbit_min(pair, tuning)
    contact_ratio, stiffness_ratio, damping = ratios(pair)
    growth = float(meissner.growth(contact_ratio, stiffness_ratio, damping, tuning))
    loss = _loss_about(pair, tuning, equation, nearest, run)
    cause = FORCED if least < -_TOUCH else (PARAMETRIC if growth > 0.0 else NONE)
    return {
        "damping_ratio": pair.damping_ratio,
        "nearest_order": np.int32(nearest.order if nearest else 0),
        "growth": growth,
        "orbit_min": least,
        "lost": np.int8(loss[0]),
        "loss_from": loss[1],
        "loss_to": loss[2],
        "forced_from": _forced_from(pair, tuning),
        "cause": np.int8(cause),
    }


def _distance(tongue, tuning):
    """Return 0 inside a tongue, else the distance to its strongest tuning."""
    return 0.0 if tongue.start <= tuning <= tongue.stop else abs(tongue.peak - tuning)


def ratios(pair):
    """Return (contact ratio, stiffness ratio, damping ratio) of a `GearPair`."""
    return pair.contact_ratio, pair.stiffness_ratio, pair.damping_ratio


def orbit_min(pair, tuning):
    """Return the least displacement, static deflections, of the orbit without loss of contact."""
    state = meissner.orbit(pair, tuning)
    linear = meissner.linear_pair(pair)
    one = sweep(linear, [tuning], periods=1, record_periods=1, initial_state=state)
    return float(one.displacement_min[0])


def _loss_about(pair, tuning, equation, nearest, run):
    """Return (whether the motion from rest parts flanks, first, last tuning about where it does).

    To the step of the scan, which spans some widths of the gap; NaN: beyond it.
    """
    if nearest is None:
        curve = sweep(pair, [tuning], record_periods=run["periods"], **run)
        return float(curve.displacement_min[0]) < -_TOUCH, math.nan, math.nan
    low, high = (1.0 / k for k in reversed(meissner.gap(equation, nearest.order)))
    reach = _REACH * (high - low) + 1e-3
    scan = np.linspace(min(low, tuning) - reach, max(high, tuning) + reach, _SCAN)
    curve = sweep(pair, scan, record_periods=run["periods"], **run)
    lost = curve.displacement_min.values < -_TOUCH
    here = int(np.argmin(np.abs(scan - tuning)))
    if not lost[here]:
        return False, math.nan, math.nan
    kept = np.nonzero(~lost)[0]
    before, after = kept[kept < here], kept[kept > here]
    first = scan[before[-1] + 1] if before.size else math.nan
    last = scan[after[0] - 1] if after.size else math.nan
    return True, float(first), float(last)


def _forced_from(pair, tuning):
    """Return the first tuning from one up at which the orbit itself leaves the flank, or NaN."""
    scan = np.linspace(tuning, tuning + _FORCED_REACH, _FORCED_SCAN)
    values = [orbit_min(pair, nu) for nu in scan]
    if values[0] < 0.0:
        return tuning
    below = np.nonzero(np.array(values) < 0.0)[0]
    if not below.size:
        return math.nan
    i = below[0]
    return float(brentq(lambda nu: orbit_min(pair, nu), scan[i - 1], scan[i], xtol=1e-12))


def rows(tongues):
    """Yield what happens at the tuning in question as a table, a row for each damping."""
    own = ["tuning_from", "tuning_to", "closing_damping"]
    rest = ["orbit_min", "loss_from", "loss_to", "forced_from"]
    names = ["damping", "damping_ratio", "tuning", "cause", "lost", "order"]
    yield [*names, *own, "growth_percent", *rest]
    for name in tongues.damping.values:
        one = tongues.sel(damping=name)
        order = int(one.nearest_order)
        tongue = one.sel(order=order) if order else None
        edges = [math.nan] * 3 if tongue is None else [float(tongue[key]) for key in own]
        grown = 100.0 * math.expm1(float(one.growth))
        numbers = [*edges, grown, *(float(one[key]) for key in rest)]
        yield [
            name,
            f"{float(one.damping_ratio):.6g}",
            f"{float(one.asked):g}",
            CAUSES[int(one.cause)],
            "yes" if one.lost else "no",
            order or "",
            *("" if math.isnan(number) else f"{number:.10g}" for number in numbers),
        ]
