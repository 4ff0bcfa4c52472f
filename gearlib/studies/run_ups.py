"""Compute run-ups and run-downs through resonance, and the mesh orders of the slowest run.

In a sweep the motion settles at every speed, whereas a run-up passes through each speed once. In
faster run-ups, jumps occur further beyond the folds, and the peak is lower.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from gearlib.analysis.order_maps import order_map
from gearlib.data.result import make_result
from gearlib.models.pair import GearPair
from gearlib.runs.run_up import run_up

DIRECTIONS = ("up", "down")
#: Approximate number of blocks of the order map, and samples per mesh period of its run.
_ORDER_MAP_BLOCKS, SAMPLES_PER_PERIOD = 480, 128


def run_ups_at_several_rates(
    model: Any,
    pair: GearPair,
    start: float,
    stop: float,
    revolutions: Sequence[int],
    *,
    mesh_orders: int,
    damping,
) -> xr.Dataset:
    """Compute tuning and displacement extrema in each revolution of several run-ups and run-downs.

    In each run the tuning rises linearly from `start` to `stop` and falls back at the same rate.
    The tuning is mesh frequency over natural frequency of `pair`; `model` runs at the same speeds.
    `revolutions` is a list with the number of revolutions from `start` to `stop` for each run. The
    dataset also has an order map of the force in the slowest run, up to the multiple `mesh_orders`
    of the mesh order. `damping` is the name of the damping combination.
    """
    start_speed = float(model.speed(model.tuning_from(pair, start)))
    stop_tuning = model.tuning_from(pair, stop)
    stop_speed = float(model.speed(stop_tuning))
    names = ("tuning", "displacement_max", "displacement_min")
    shape = len(revolutions), len(DIRECTIONS), max(revolutions)
    data = {name: np.full(shape, np.nan) for name in names}
    for i, count in enumerate(revolutions):
        mean_speed = 0.5 * (start_speed + stop_speed)  # rpm
        seconds = 60.0 * count / mean_speed
        speed_course = [(0.0, start_speed), (seconds, stop_speed), (2.0 * seconds, start_speed)]
        is_slowest = count == max(revolutions)
        samples = SAMPLES_PER_PERIOD if is_slowest else 0
        run = run_up(model, speed=speed_course, samples_per_period=samples)
        values = {
            "tuning": run.revolution_speed / stop_speed * stop_tuning,
            "displacement_max": run.displacement_max / model.static_deflection,
            "displacement_min": run.displacement_min / model.static_deflection,
        }
        speed_falls = run.revolution_time.values >= seconds
        for j, in_direction in enumerate((~speed_falls, speed_falls)):  # in the order of DIRECTIONS
            for name in names:
                data[name][i, j, : in_direction.sum()] = values[name].values[in_direction]
        if is_slowest:
            resolution = 1.0 / max(1, round(2 * count / _ORDER_MAP_BLOCKS))
            options = {"orders": range(mesh_orders * model.teeth + 1), "resolution": resolution}
            order_map_of_slowest = order_map(run, variable="dynamic_force", **options)
    attrs = {"units": "1", "long_name": "revolutions in each direction"}
    coords = {"revolutions": ("revolutions", list(revolutions), attrs)}
    coords |= {"direction": list(DIRECTIONS)}
    dims = "revolutions", "direction", "point"
    variables = {name: (dims, values) for name, values in data.items()}
    dataset = xr.Dataset(variables | {"damping": damping}, coords)
    # In the CF conventions, a coordinate called "time" needs a reference date.
    map_names = ["amplitude", "rpm", "overall", "teeth", "order_resolution"]
    dataset = dataset.merge(order_map_of_slowest[map_names].rename(time="block"))
    dataset = make_result("Run-ups of a gear mesh", model, dataset, method="exact")
    return dataset.assign_attrs(
        {name: order_map_of_slowest.attrs[name] for name in ("variable", "amplitude")}
    )
