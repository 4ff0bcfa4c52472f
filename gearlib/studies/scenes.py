"""Scenes: the time courses of a few runs, side by side in one dataset."""

import xarray as xr

from gearlib.runs.simulation import simulate
from gearlib.studies.model_comparison import build


def compute(cases, model, six_degrees, run):
    """Return the recorded time courses and orbit summaries of some cases.

    Parameters
    ----------
    cases : list of dict
        Each with title, tuning and pair (keyword arguments of `GearPair`).
    model : str
        A name in `gearlib.studies.model_comparison.LADDER`.
    six_degrees : dict
        What `SixDegreePair` needs beyond the pair.
    run : dict
        Keyword arguments of `gearlib.simulate`, the same for all cases.

    Returns
    -------
    xarray.Dataset
        The variables of `gearlib.simulate` over (case, phase) and (case), without the events;
        the phase counts from the start of the record; model.
    """
    runs = []
    for case in cases:
        pair = build(model, case["pair"], six_degrees)
        dataset = simulate(pair, case["tuning"], **run).drop_dims("event")
        phase = (dataset.phase - dataset.phase[0]).assign_attrs(dataset.phase.attrs)
        phase.attrs["long_name"] = "mesh phase from the start of the record"
        title = xr.Variable((), case["title"], {"long_name": "case of the scene"})
        runs.append(dataset.assign_coords(phase=phase, case=title))
    scene = xr.concat(
        runs,
        dim="case",
        data_vars="all",
        coords="minimal",
        compat="equals",
        join="exact",
        combine_attrs="drop_conflicts",
    )
    name = xr.Variable((), model, {"long_name": "smallest model that carries the scene"})
    return scene.assign(model=name)
