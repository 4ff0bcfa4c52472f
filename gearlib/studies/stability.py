"""Study parametric resonance: stability charts with instability tongues, causes of contact loss."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from gearlib.analysis.tongues import meissner, search
from gearlib.data.motions import true_intervals
from gearlib.data.result import make_result
from gearlib.data.status import flag_attributes
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep

#: Parameters that the stability chart varies together with the tuning.
PLANES = ("stiffness_ratio", "contact_ratio", "damping")
#: Largest damping of the chart relative to the damping that closes the last tongue.
_DAMPING_MARGIN = 1.15
#: Largest damping ratio of the chart if there is no tongue.
_DEFAULT_MAX_DAMPING = 0.1
#: Range in which the tongue nearest to a tuning is searched, relative to this tuning.
_TONGUE_RANGE = 0.7, 1.5
#: Number of tunings of the scan for contact loss from rest, and its margin in tongue widths.
_REST_SCAN_TUNINGS, _REST_SCAN_WIDTHS = 301, 1.5
#: Minimum of this margin in tuning, because tongues may have zero width.
_MIN_REST_SCAN_MARGIN = 1e-3
#: Number of tunings, and range of tuning, of the scan for forced contact loss.
_FORCED_SCAN_TUNINGS, _FORCED_SCAN_RANGE = 51, 0.5
#: Negative displacements up to this size, in static deflections, may be rounding errors.
_DISPLACEMENT_TOLERANCE = 1e-9

#: Codes of the causes of contact loss, and their names.
NONE, PARAMETRIC, FORCED = 0, 1, 2
CAUSES = ("none", "parametric instability", "forced response")


def compute_stability_chart(pair: GearPair, tunings: Sequence[float], settings: dict) -> xr.Dataset:
    """Compute growth rates and instability tongues over tuning and each parameter of `PLANES`.

    A tongue is an interval of tunings (mesh frequency over natural frequency) in which the motion
    without contact loss is unstable. `settings` has the keys damping_ratios (for which tongues are
    computed), least_stiffness_ratio (lower limit of the stiffness ratio), and values (number of
    values of each parameter). In the dataset, own_value is the value of each parameter for the
    undamped pair, and closing_damping the damping ratio at which a tongue vanishes.
    """
    model = pair.replace(material_damping=0.0)
    dampings, count = settings["damping_ratios"], settings["values"]
    tuning_range = {"start": float(tunings[0]), "stop": float(tunings[-1])}
    undamped = search.tongues(model, **tuning_range)
    max_damping = _DAMPING_MARGIN * max(undamped.closing_damping.values, default=0.0)
    plane_values = {
        "stiffness_ratio": np.linspace(settings["least_stiffness_ratio"], 1.0, count),
        "contact_ratio": np.linspace(1.0, 2.0, count),
        "damping": np.linspace(0.0, max_damping or _DEFAULT_MAX_DAMPING, count),
    }
    parameters = {
        "stiffness_ratio": model.stiffness_ratio,
        "contact_ratio": model.contact_ratio,
        "damping": dampings[0],
    }
    planes = []
    for plane, values in plane_values.items():
        tongues = []
        # In the plane "damping", the rows have different damping.
        plane_dampings = dampings[:1] if plane == "damping" else dampings
        for damping in plane_dampings:
            damped = search.replace_parameter(model, "damping", damping)
            edges = search.tongues(damped, parameter=plane, values=values, **tuning_range)
            edges = edges[["tuning_from", "tuning_to"]].swap_dims({plane: "row"}).drop_vars(plane)
            tongues.append(edges.assign_coords(damping=damping))
        plane_parameters = parameters | {plane: values[:, None]}
        growth = meissner.growth(**plane_parameters, tuning=np.array(tunings))
        chart = xr.concat(tongues, "damping", join="outer")
        planes.append(chart.assign(value=("row", values), growth=(("row", "tuning"), growth)))
    data = xr.concat(planes, xr.IndexVariable("plane", [*PLANES]), join="outer")
    points = _find_zero_width_points(model, data.order.values, settings["least_stiffness_ratio"])
    data = data.assign(
        **points,
        closing_damping=undamped.closing_damping.reindex(order=data.order),
        own_value=("plane", [model.stiffness_ratio, model.contact_ratio, 0.0]),
    ).assign_coords(tuning=np.array(tunings))
    title = "Tongues of parametric resonance"
    return make_result(title, model, data, method="closed form", **settings)


def _find_zero_width_points(
    pair: GearPair, orders: Sequence[int], min_stiffness_ratio: float
) -> dict[str, tuple[str, np.ndarray]]:
    """Find the points of the stability chart where undamped tongues have zero width.

    A tongue is an interval of unstable tunings (mesh frequency over natural frequency). Return
    variables with the plane (the parameter that varies), the value of this parameter, and the
    tuning of each point. All other parameters are those of `pair`. `orders` are the numbers n of
    the tongues, which lie near the tunings 2 / n. Points with stiffness ratios below
    `min_stiffness_ratio` are omitted.
    """
    points = []
    fixed_parameters = {"stiffness_ratio": "contact_ratio", "contact_ratio": "stiffness_ratio"}
    for order in orders:
        for plane, fixed_parameter in fixed_parameters.items():
            fixed_value = {fixed_parameter: getattr(pair, fixed_parameter)}
            for value, tuning in meissner.coexistence_points(order, **fixed_value):
                if plane != "stiffness_ratio" or value >= min_stiffness_ratio:
                    points.append((plane, value, tuning))
    return {
        "point_plane": ("point", np.array([plane for plane, _, _ in points], object)),
        "point_value": ("point", np.array([value for _, value, _ in points], float)),
        "point_tuning": ("point", np.array([tuning for _, _, tuning in points], float)),
    }


def find_contact_loss_causes(
    pairs: dict[str, GearPair], tuning: float, start: float, stop: float, run: dict
) -> xr.Dataset:
    """Compute instability tongues of gear pairs with different damping, and why contact is lost.

    `pairs` maps names of damping combinations to pairs. At `tuning` (mesh frequency over natural
    frequency; variable "asked") contact is lost for one of two reasons: either the forced
    period-one orbit has displacements below zero, or perturbations of this orbit grow in a tongue,
    an interval of unstable tunings. Tongues are searched between the tunings `start` and `stop`.
    `run` has the keys periods and initial_state of the motion from rest. Edges of closed tongues
    and ends of contact loss outside the scanned range are NaN.
    """
    lower, upper = _TONGUE_RANGE
    start = max(search.MIN_TUNING, min(start, lower * tuning))
    stop = max(stop, upper * tuning)
    models = [*pairs.values()]
    tongues = [search.tongues(model, start=start, stop=stop) for model in models]
    dampings = [
        data[["tuning_from", "tuning_to"]].assign(_analyse_contact_loss(model, tuning, data, run))
        for model, data in zip(models, tongues, strict=True)
    ]
    data = xr.concat(dampings, xr.IndexVariable("damping", [*pairs]), join="outer")
    # The closing damping only depends on the order.
    closing_dampings = xr.concat([data.closing_damping for data in tongues], "model", join="outer")
    data = data.assign(closing_damping=closing_dampings.max("model"), asked=tuning)
    title = "Parametric resonance of the dampings"
    parameters = {name: pair.as_dict() for name, pair in pairs.items()}
    dataset = make_result(title, models[0], data, method="closed form", pairs=parameters, **run)
    dataset["cause"].attrs |= flag_attributes(CAUSES)
    return dataset


def _analyse_contact_loss(pair: GearPair, tuning: float, tongues: xr.Dataset, run: dict) -> dict:
    """Find nearest tongue, growth rate, contact loss and its cause at a tuning.

    The tuning is mesh frequency over natural frequency. `tongues` has the intervals of unstable
    tunings of the pair. The nearest tongue contains the tuning or has the nearest maximum of the
    growth rate. `run` has arguments of `gearlib.sweep`. The cause is NONE, PARAMETRIC
    (perturbations grow) or FORCED (the forced orbit loses contact). Return variable -> value.
    """
    is_inside = (tongues.tuning_from <= tuning) & (tuning <= tongues.tuning_to)
    distance = np.abs(tongues.growth_tuning - tuning).where(~is_inside, 0.0)
    order = int(distance.idxmin("order")) if distance.size else 0
    ratios = pair.contact_ratio, pair.stiffness_ratio, pair.damping_ratio
    growth = float(meissner.growth(*ratios, tuning))
    min_displacement = min_orbit_displacement(pair, tuning)
    cause = NONE
    if min_displacement < -_DISPLACEMENT_TOLERANCE:
        cause = FORCED
    elif growth > 0.0:
        cause = PARAMETRIC
    loses_contact, loss_from, loss_to = _find_contact_loss_from_rest(pair, tuning, order, run)
    return {
        "damping_ratio": pair.damping_ratio,
        "nearest_order": np.int32(order),
        "growth": growth,
        "orbit_min": min_displacement,
        "lost": np.int8(loses_contact),
        "loss_from": loss_from,
        "loss_to": loss_to,
        "forced_from": _find_forced_contact_loss(pair, tuning),
        "cause": np.int8(cause),
    }


def min_orbit_displacement(pair: GearPair, tuning: float) -> float:
    """Return the minimum displacement of the forced orbit, in units of the static deflection.

    The orbit is computed without loss of contact, for the linear pair without backlash. If the
    result is negative, the pair loses contact. `tuning` is mesh frequency over natural frequency.
    """
    state, linear = meissner.orbit_state(pair, tuning), meissner.without_backlash(pair)
    curve = sweep(linear, [tuning], periods=1, record_periods=1, initial_state=state)
    return float(curve.displacement_min[0])


def _find_contact_loss_from_rest(pair, tuning, order, run) -> tuple[bool, float, float]:
    """Find whether the motion from rest loses contact at a tuning, and in which range of tunings.

    The scan covers `tuning` (mesh frequency over natural frequency) and the nearest instability
    tongue, whose number is `order`, or 0 if there is none. `run` has arguments of `gearlib.sweep`.
    Return (contact is lost, lower end, upper end); an end outside the scanned range is NaN.
    """
    lower = upper = tuning
    if order:
        gap: Any = meissner.find_gap(meissner.equation_of_pair(pair), order)  # range of 1 / tuning
        upper, lower = (1.0 / end for end in gap)
    margin = _REST_SCAN_WIDTHS * (upper - lower) + _MIN_REST_SCAN_MARGIN
    first_tuning, last_tuning = min(lower, tuning) - margin, max(upper, tuning) + margin
    scan = np.linspace(first_tuning, last_tuning, _REST_SCAN_TUNINGS)
    # All periods are evaluated, because transient contact loss counts, too.
    curve = sweep(pair, scan, record_periods=run["periods"], **run)
    loses_contact = curve.displacement_min.values < -_DISPLACEMENT_TOLERANCE
    nearest = int(np.argmin(np.abs(scan - tuning)))
    for i, j in true_intervals(loses_contact):
        if i <= nearest <= j:
            begin = float(scan[i]) if i > 0 else math.nan
            end = float(scan[j]) if j < scan.size - 1 else math.nan
            return True, begin, end
    return False, math.nan, math.nan


def _find_forced_contact_loss(pair: GearPair, tuning: float) -> float:
    """Find the lowest tuning, from `tuning` upwards, at which the forced orbit loses contact.

    The tuning is mesh frequency over natural frequency. A scan brackets the zero of the minimum
    displacement, which a root finder refines. Return NaN if the scan finds no contact loss.
    """
    scan = np.linspace(tuning, tuning + _FORCED_SCAN_RANGE, _FORCED_SCAN_TUNINGS)
    losses = np.flatnonzero([min_orbit_displacement(pair, nu) < 0.0 for nu in scan])
    if not losses.size:
        return math.nan
    i = losses[0]
    if i == 0:
        return tuning
    return float(
        brentq(lambda nu: min_orbit_displacement(pair, nu), scan[i - 1], scan[i], xtol=1e-12)
    )


def table_rows(tongues: xr.Dataset) -> Iterator[list]:
    """Yield the rows of the table of causes of contact loss, beginning with the column names.

    `tongues` is a dataset from `find_contact_loss_causes`; each damping combination has one row.
    orbit_min is the minimum displacement of the forced orbit. The motion from rest loses contact at
    tunings (mesh frequency over natural frequency) from loss_from to loss_to, the forced orbit at
    tunings above forced_from. growth_percent is the growth of perturbations per mesh period.
    """
    tongue_names = ["tuning_from", "tuning_to", "closing_damping"]
    motion_names = ["orbit_min", "loss_from", "loss_to", "forced_from"]
    header = ["damping", "damping_ratio", "tuning", "cause", "lost", "order"]
    yield [*header, *tongue_names, "growth_percent", *motion_names]
    for damping in tongues.damping.values:
        data = tongues.sel(damping=damping)
        order = int(data.nearest_order)  # 0 if there is no tongue; its edges are then NaN
        tongue = data.reindex(order=[order]).squeeze("order")
        growth = 100.0 * math.expm1(float(data.growth))
        numbers = [float(tongue[name]) for name in tongue_names]
        numbers += [growth, *(float(data[name]) for name in motion_names)]
        yield [
            damping,
            f"{float(data.damping_ratio):.6g}",
            f"{float(data.asked):g}",
            CAUSES[int(data.cause)],
            "yes" if data.lost else "no",
            order or "",
            *("" if math.isnan(number) else f"{number:.10g}" for number in numbers),
        ]
