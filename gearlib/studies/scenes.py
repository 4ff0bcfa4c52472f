"""Scenes: the time courses of a few runs, side by side in one dataset."""

import numpy as np
import xarray as xr

from gearlib.data.variables import describe
from gearlib.studies import runs_beside
from gearlib.studies.model_comparison import build


def of_comparison(comparison, cases, six_degrees, run, starts):
    """Return the scene by the model that its comparison chose; arguments as in `compute`."""
    return compute(cases, comparison.chosen.item(), six_degrees, run, starts)


def compute(cases, model, six_degrees, run, starts):
    """Return the recorded time courses and orbit summaries of some cases.

    cases: each with title, tuning and pair (keyword arguments of `GearPair`); model: a name in
    `gearlib.studies.model_comparison.LADDER`; six_degrees: what `SixDegreePair` needs beyond the
    pair; run: keyword arguments of `gearlib.simulate`, the same for all cases; starts (starts,
    seed, spread: as in `gearlib.studies.runs_beside.runs`).

    The variables of `gearlib.simulate` over (case, phase) and (case), without the events; the phase
    counts from the start of the record; model; free_of_rounding, whether rounding does not decide
    the run; losing_share, of the seeded starts from which contact is lost where it does, 0 or 1
    elsewhere.
    """
    courses = []
    for case in cases:
        pair = build(model, case["pair"], six_degrees)
        asked, told = runs_beside.runs(pair, case["tuning"], run, starts)
        dataset = asked.drop_dims("event")
        dataset["free_of_rounding"] = (), np.int8(told[0] is asked), runs_beside.FLAGS
        dataset["losing_share"] = (), np.mean([float(one.bounces) > 0.0 for one in told])
        phase = (dataset.phase - dataset.phase[0]).assign_attrs(dataset.phase.attrs)
        phase.attrs["long_name"] = "mesh phase from the start of the record"
        title = xr.Variable((), case["title"], {"long_name": "case of the scene"})
        courses.append(describe(dataset.assign_coords(phase=phase, case=title), pair))
    scene = xr.concat(
        courses,
        dim="case",
        data_vars="all",
        coords="minimal",
        compat="equals",
        join="exact",
        combine_attrs="drop_conflicts",
    )
    name = xr.Variable((), model, {"long_name": "smallest model that carries the scene"})
    return scene.assign(model=name)
