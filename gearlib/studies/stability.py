"""Parametric resonance: tongues over the tuning and other parameters, causes of contact loss."""

import math

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from gearlib.analysis.tongues import meissner, search
from gearlib.data.motions import stretches
from gearlib.data.result import result
from gearlib.data.status import flags_of
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep

#: Parameters of the chart beside the tuning.
PLANES = ("stiffness_ratio", "contact_ratio", "damping")
#: Largest damping of the chart over the damping that closes the last tongue.
_HEADROOM = 1.15
#: Bounds of the tongues next to a tuning, shares of it.
_NEXT_TONGUES = 0.7, 1.5
#: Tunings of the scan for contact lost from rest, and its reach in widths of the tongue.
_SCAN_TUNINGS, _SCAN_REACH = 301, 1.5
#: Tunings of the scan for the forced loss of contact, and its range of tuning.
_FORCED_TUNINGS, _FORCED_RANGE = 51, 0.5
#: Penetration of the flank line, static deflections, that is rounding.
_ROUNDING = 1e-9

NONE, PARAMETRIC, FORCED = 0, 1, 2
CAUSES = ("none", "parametric instability", "forced response")


def chart(pair, tunings, settings):
    """Return growth and tongues of a gear pair over the tuning and each parameter of `PLANES`.

    `settings` hold damping_ratios of the tongues, least_stiffness_ratio and values, the number of
    values of each parameter. In the plane of damping, tongues have the damping of their row.
    """
    pair = GearPair(**pair).replace(material_damping=0.0)
    dampings, count = settings["damping_ratios"], settings["values"]
    span = {"start": float(tunings[0]), "stop": float(tunings[-1])}
    undamped = search.tongues(pair, **span)
    highest = _HEADROOM * max(undamped.closing_damping.values, default=0.0)
    values = {
        "stiffness_ratio": np.linspace(settings["least_stiffness_ratio"], 1.0, count),
        "contact_ratio": np.linspace(1.0, 2.0, count),
        "damping": np.linspace(0.0, highest or 0.1, count),
    }
    own = {name: getattr(pair, name) for name in PLANES[:2]} | {"damping": dampings[0]}
    planes = []
    for plane, row_values in values.items():
        columns = []
        for damping in dampings if plane != "damping" else dampings[:1]:
            damped = search.varied(pair, "damping", damping)
            edges = search.tongues(damped, parameter=plane, values=row_values, **span)
            edges = edges[["tuning_from", "tuning_to"]].swap_dims({plane: "row"}).drop_vars(plane)
            columns.append(edges.assign_coords(damping=damping))
        grown = meissner.growth(**own | {plane: row_values[:, None]}, tuning=np.array(tunings))
        planes.append(
            xr.concat(columns, "damping", join="outer").assign(
                value=("row", row_values), growth=(("row", "tuning"), grown)
            )
        )
    data = xr.concat(planes, xr.IndexVariable("plane", [*PLANES]), join="outer")
    points = _pinched_tongues(pair, data.order.values, settings["least_stiffness_ratio"])
    data = data.assign(
        closing_damping=undamped.closing_damping.reindex(order=data.order),
        own_value=("plane", [pair.stiffness_ratio, pair.contact_ratio, 0.0]),
        **{name: ("point", column) for name, column in points.items()},
    ).assign_coords(tuning=np.array(tunings))
    title = "Tongues of parametric resonance"
    return result(title, pair, data, method="closed form", **settings)


def _pinched_tongues(pair, orders, least_stiffness_ratio):
    """Return plane, value and tuning of the tongues without damping that have the width zero."""
    points = []
    for order in orders:
        for plane, fixed in (PLANES[:2], PLANES[1::-1]):
            places = meissner.coexistence(order, **{fixed: getattr(pair, fixed)})
            points += [(plane, *place) for place in places]
    least = {"stiffness_ratio": least_stiffness_ratio}
    points = [point for point in points if point[1] >= least.get(point[0], 0.0)]
    planes, values, tunings = zip(*points, strict=True) if points else ((), (), ())
    return {
        "point_plane": np.array(planes, object),
        "point_value": np.array(values, float),
        "point_tuning": np.array(tunings, float),
    }


def contact_loss(pairs, tuning, start, stop, run):
    """Return the tongues of gear pairs that differ in damping, and the cause of lost contact.

    Without loss of contact a mesh has one orbit of one mesh period. Contact is lost at `tuning`
    because that orbit leaves the flank, or because deviations from it grow in a tongue. `start` and
    `stop` bound the tongues, `run` holds periods and initial_state of the motion from rest. NaN: a
    closed tongue; a loss of contact that begins or ends beyond the scan.
    """
    low, high = _NEXT_TONGUES
    bounds = {"start": min(start, low * tuning), "stop": max(stop, high * tuning)}
    bounds["start"] = max(search.MIN_TUNING, bounds["start"])
    models = [GearPair(**parameters) for parameters in pairs.values()]
    every = [search.tongues(model, **bounds) for model in models]
    parts = [
        one[["tuning_from", "tuning_to"]].assign(_facts(model, tuning, one, run))
        for model, one in zip(models, every, strict=True)
    ]
    data = xr.concat(parts, xr.IndexVariable("damping", [*pairs]), join="outer")
    # It depends on the order alone.
    closings = xr.concat([one.closing_damping for one in every], "model", join="outer")
    data = data.assign(closing_damping=closings.max("model"), asked=tuning)
    title = "Parametric resonance of the dampings"
    dataset = result(title, models[0], data, method="closed form", pairs=pairs, **run)
    dataset["cause"].attrs |= flags_of(CAUSES)
    return dataset


def _facts(pair, tuning, tongues, run):
    """Return the facts about one pair at a tuning, by their names."""
    inside = (tongues.tuning_from <= tuning) & (tuning <= tongues.tuning_to)
    distance = np.abs(tongues.growth_tuning - tuning).where(~inside, 0.0)
    order = int(distance.idxmin("order")) if distance.size else 0
    ratios = pair.contact_ratio, pair.stiffness_ratio, pair.damping_ratio
    growth = float(meissner.growth(*ratios, tuning))
    least = orbit_min(pair, tuning)
    cause = FORCED if least < -_ROUNDING else PARAMETRIC if growth > 0.0 else NONE
    lost, first, last = _loss_from_rest(pair, tuning, order, run)
    return {
        "damping_ratio": pair.damping_ratio,
        "nearest_order": np.int32(order),
        "growth": growth,
        "orbit_min": least,
        "lost": np.int8(lost),
        "loss_from": first,
        "loss_to": last,
        "forced_from": _forced_from(pair, tuning),
        "cause": np.int8(cause),
    }


def orbit_min(pair, tuning):
    """Return the least displacement, static deflections, of the orbit without loss of contact."""
    state, linear = meissner.orbit(pair, tuning), meissner.linear_pair(pair)
    curve = sweep(linear, [tuning], periods=1, record_periods=1, initial_state=state)
    return float(curve.displacement_min[0])


def _loss_from_rest(pair, tuning, order, run):
    """Return whether the motion from rest loses contact, and the first and last tuning around."""
    low = high = tuning
    if order:
        low, high = (1.0 / k for k in reversed(meissner.gap(meissner.equation_of(pair), order)))
    reach = _SCAN_REACH * (high - low) + 1e-3
    scan = np.linspace(min(low, tuning) - reach, max(high, tuning) + reach, _SCAN_TUNINGS)
    curve = sweep(pair, scan, record_periods=run["periods"], **run)
    lost = curve.displacement_min.values < -_ROUNDING
    here = int(np.argmin(np.abs(scan - tuning)))
    for first, last in stretches(lost):
        if first <= here <= last:
            begins = float(scan[first]) if first else math.nan
            return True, begins, float(scan[last]) if last < scan.size - 1 else math.nan
    return False, math.nan, math.nan


def _forced_from(pair, tuning):
    """Return the first tuning from one up at which the orbit itself leaves the flank, or NaN."""
    scan = np.linspace(tuning, tuning + _FORCED_RANGE, _FORCED_TUNINGS)
    below = np.flatnonzero([orbit_min(pair, nu) < 0.0 for nu in scan])
    if not below.size:
        return math.nan
    if not below[0]:
        return tuning
    ends = scan[below[0] - 1 : below[0] + 1]
    return float(brentq(lambda nu: orbit_min(pair, nu), *ends, xtol=1e-12))


def rows(tongues):
    """Yield the table of causes at the tuning in question: a head and a row for each damping."""
    of_tongue = ["tuning_from", "tuning_to", "closing_damping"]
    of_motion = ["orbit_min", "loss_from", "loss_to", "forced_from"]
    head = ["damping", "damping_ratio", "tuning", "cause", "lost", "order"]
    yield [*head, *of_tongue, "growth_percent", *of_motion]
    for damping in tongues.damping.values:
        facts = tongues.sel(damping=damping)
        order = int(facts.nearest_order)
        tongue = facts.reindex(order=[order]).squeeze("order")
        growth = 100.0 * math.expm1(float(facts.growth))
        numbers = [float(tongue[name]) for name in of_tongue]
        numbers += [growth, *(float(facts[name]) for name in of_motion)]
        yield [
            damping,
            f"{float(facts.damping_ratio):.6g}",
            f"{float(facts.asked):g}",
            CAUSES[int(facts.cause)],
            "yes" if facts.lost else "no",
            order or "",
            *("" if math.isnan(number) else f"{number:.10g}" for number in numbers),
        ]
