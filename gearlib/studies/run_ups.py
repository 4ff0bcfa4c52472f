"""Run-ups and run-downs through the resonance at several rates, and the orders of the slowest.

Beside the sweeps of Fig. 3, which settle at every speed, a run-up passes each speed once: the
faster it goes, the further its jumps lie behind the folds, and the lower is the peak.
"""

import numpy as np
import xarray as xr

from gearlib.analysis.order_maps import order_map
from gearlib.data.result import result
from gearlib.models.pair import GearPair
from gearlib.runs.run_up import run_up

DIRECTIONS = ("up", "down")
#: Blocks of the order map, about, and samples in a mesh period from which it comes.
_BLOCKS, SAMPLES = 480, 128


def compute(pair, start, stop, revolutions, *, mesh_orders, damping):
    """Return extrema of run-ups over tuning, and the order map of the slowest.

    `start` and `stop` are tunings, `revolutions` those of each way, `mesh_orders` the highest order
    of the map over teeth, `damping` its name. Over (revolutions, direction, point): tuning and
    extrema of the displacement in each revolution.
    """
    model = GearPair(**pair)
    ends = [float(model.speed(nu)) for nu in (start, stop)]
    names = ("tuning", "displacement_max", "displacement_min")
    shape = len(revolutions), len(DIRECTIONS), max(revolutions)
    columns = {name: np.full(shape, np.nan) for name in names}
    for i, count in enumerate(revolutions):
        seconds = 120.0 * count / sum(ends)
        course = [(0.0, ends[0]), (seconds, ends[1]), (2.0 * seconds, ends[0])]
        slowest = count == max(revolutions)
        run = run_up(model, speed=course, samples_per_period=SAMPLES if slowest else 0)
        tuning = run.revolution_speed / ends[1] * stop
        extrema = [run[name] / model.static_deflection for name in names[1:]]
        falls = run.revolution_time.values >= seconds
        for name, values in zip(names, (tuning, *extrema), strict=True):
            for j, way in enumerate((~falls, falls)):
                columns[name][i, j, : way.sum()] = values.values[way]
        if slowest:
            options = {"orders": range(mesh_orders * model.teeth + 1), "resolution": 1.0}
            options["resolution"] /= max(1, round(2 * count / _BLOCKS))
            blocks = order_map(run, variable="dynamic_force", **options)
    data = {name: (("revolutions", "direction", "point"), x) for name, x in columns.items()}
    about = {"units": "1", "long_name": "revolutions of each way"}
    coords = {"revolutions": ("revolutions", list(revolutions), about)}
    dataset = xr.Dataset(data | {"damping": damping}, coords | {"direction": list(DIRECTIONS)})
    # CF knows times of day only: a block is at seconds since the start of the run.
    shown = ["amplitude", "rpm", "overall", "teeth", "order_resolution"]
    dataset = dataset.merge(blocks[shown].rename(time="block"))
    dataset = result("Run-ups of a gear mesh", model, dataset, method="closed forms")
    return dataset.assign_attrs({name: blocks.attrs[name] for name in ("variable", "amplitude")})
