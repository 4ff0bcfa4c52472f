"""Run-ups and run-downs through the resonance at several rates, and the orders of the slowest.

Beside the sweeps of Fig. 3, which settle at every speed, a run-up passes each speed once: the
faster it goes, the further its jumps lie behind the folds, and the lower is the peak. The smallest
model, one degree of freedom with two levels of stiffness, has run-ups in closed forms.
"""

import numpy as np
import xarray as xr

from gearlib.analysis.order_maps import order_map
from gearlib.data.result import result
from gearlib.models.pair import GearPair
from gearlib.runs.run_up import run_up

#: Points of a curve, and columns of an order map, in each direction.
_POINTS = 240
DIRECTIONS = ("up", "down")
#: Samples in a mesh period, from which the order map comes.
SAMPLES = 128


def compute(pair, start, stop, revolutions, *, mesh_orders, damping):
    """Return extrema of run-ups over the tuning, and the order map of the slowest.

    pair: as in `described`; start, stop: tunings; revolutions: shape (r,), of each way;
    mesh_orders: highest order of the map over teeth; damping: its name.

    Over (revolutions, direction, point): tuning, displacement_max and displacement_min (static
    deflections), NaN where a run has fewer revolutions than points. The map is that of the dynamic
    force, as in `gearlib.order_map`, blocks next to each other joined by their powers.
    """
    model = GearPair(**pair)
    ends = [float(model.speed(nu)) for nu in (start, stop)]
    shape = len(revolutions), len(DIRECTIONS), _POINTS
    columns = {name: np.full(shape, np.nan) for name in ("tuning", "largest", "least")}
    slowest = max(revolutions)
    for i, count in enumerate(revolutions):
        seconds = 120.0 * count / sum(ends)
        course = [(0.0, ends[0]), (seconds, ends[1]), (2.0 * seconds, ends[0])]
        samples = SAMPLES if count == slowest else 0
        run = run_up(model, speed=course, samples_per_period=samples)
        for j, way in enumerate(_ways(run.revolution_time.values, seconds)):
            groups = _groups(way)
            size = len(groups)
            speed = np.add.reduceat(run.revolution_speed.values[way], groups) / _sizes(way, groups)
            columns["tuning"][i, j, :size] = speed / ends[1] * stop
            most = np.maximum.reduceat(run.displacement_max.values[way], groups)
            least = np.minimum.reduceat(run.displacement_min.values[way], groups)
            columns["largest"][i, j, :size] = most / model.static_deflection
            columns["least"][i, j, :size] = least / model.static_deflection
        if count == slowest:
            map_of = run, seconds
    run, seconds = map_of
    whole = order_map(run, variable="dynamic_force", highest=mesh_orders * model.teeth)
    orders = _thinned(whole, seconds)
    over = ("revolutions", "direction", "point")
    data = {
        "tuning": (over, columns["tuning"]),
        "displacement_max": (over, columns["largest"]),
        "displacement_min": (over, columns["least"]),
        "damping": damping,
    }
    for name in ("amplitude", "rpm", "overall", "teeth", "order_resolution"):
        data[name] = orders[name].variable
    coords = {"revolutions": list(revolutions), "direction": list(DIRECTIONS)}
    coords |= {name: orders[name].variable for name in ("time", "order")}
    about = {"units": "1", "long_name": "revolutions of each way"}
    # CF knows times of day only: a block is at seconds since the start of the run.
    dataset = xr.Dataset(data, coords).rename(time="block")
    dataset["revolutions"].attrs |= about
    found = result("Run-ups of a gear mesh", model, dataset, method="closed forms")
    return found.assign_attrs({name: orders.attrs[name] for name in ("variable", "amplitude")})


def _ways(times, turn):
    """Return the numbers of what lies on the way up, and down."""
    return np.flatnonzero(times < turn), np.flatnonzero(times >= turn)


def _groups(way):
    """Return where groups of neighbours begin, at most as many as points."""
    count = min(_POINTS, len(way))
    return np.arange(count) * len(way) // count


def _sizes(way, groups):
    return np.diff(np.append(groups, len(way)))


def _thinned(found, turn):
    """Return an order map of fewer blocks: the root mean squares of neighbours."""
    parts = []
    for way in _ways(found.time.values, turn):
        groups, own = _groups(way), found.isel(time=way)
        sizes = _sizes(way, groups)

        def mean(values, groups=groups, sizes=sizes):
            return np.add.reduceat(values, groups) / sizes.reshape(-1, *[1] * (values.ndim - 1))

        part = own[["amplitude", "overall", "rpm", "teeth", "order_resolution"]].isel(time=groups)
        for name in ("amplitude", "overall"):
            part[name].values[...] = np.sqrt(mean(own[name].values ** 2))
        part["rpm"].values[...] = mean(own.rpm.values)
        parts.append(part.assign_coords(time=("time", mean(own.time.values), own.time.attrs)))
    return xr.concat(parts, "time", data_vars="minimal", combine_attrs="override")
