"""Scenes: the time courses of a few runs, side by side in one dataset."""

import xarray as xr

from gearlib.models.six_degrees import SixDegreePair
from gearlib.pair import GearPair
from gearlib.simulation import simulate


def compute(cases, six_degrees, run):
    """Return the recorded time courses and orbit summaries of some cases.

    Parameters
    ----------
    cases : list of dict
        Each with title, tuning and pair (keyword arguments of `GearPair`).
    six_degrees : dict or None
        What `SixDegreePair` needs beyond the pair; None: one degree of freedom.
    run : dict
        Keyword arguments of `gearlib.simulate`, the same for all cases.

    Returns
    -------
    xarray.Dataset
        The variables of `gearlib.simulate` over (case, phase) and (case), without the events;
        the phase counts from the start of the record.
    """
    runs = []
    for case in cases:
        pair = GearPair(**case["pair"])
        model = pair if six_degrees is None else SixDegreePair(pair=pair, **six_degrees)
        dataset = simulate(model, case["tuning"], **run).drop_dims("event")
        phase = (dataset.phase - dataset.phase[0]).assign_attrs(dataset.phase.attrs)
        phase.attrs["long_name"] = "mesh phase from the start of the record"
        title = xr.Variable((), case["title"], {"long_name": "case of the scene"})
        runs.append(dataset.assign_coords(phase=phase, case=title))
    return xr.concat(
        runs,
        dim="case",
        data_vars="all",
        coords="minimal",
        compat="equals",
        join="exact",
        combine_attrs="drop_conflicts",
    )
