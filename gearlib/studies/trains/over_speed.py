"""Every mesh of the train of the configuration over speed, carried up and down."""

import numpy as np
import xarray as xr

from gearlib.data import provenance
from gearlib.data.variables import describe
from gearlib.models.trains.described import described
from gearlib.runs.sweeping import CARRIED, sweep

_KEPT = (
    "dynamic_factor",
    "load_sharing",
    "fraction_normal",
    "fraction_inverse",
    "period",
    "status",
)


def compute(train, tunings, settings):
    """Return the resonance characteristics of all meshes, from static equilibrium.

    Parameters
    ----------
    train : dict
        Arguments of `gearlib.models.trains.described.described`.
    tunings : sequence of float, shape (t,)
    settings : dict
        periods, record_periods: of every run, in periods of the reference mesh.

    Returns
    -------
    xarray.Dataset
        Over (direction, tuning, mesh): dynamic_factor, load_sharing, fraction_normal,
        fraction_inverse; over (direction, tuning): period, status; over tuning: speed.
    """
    model = described(**train)
    runs = [
        sweep(model, tunings, direction=direction, initial_state="static", **settings)
        for direction in CARRIED
    ]
    first = runs[0]
    data = {
        name: (("direction", *first[name].dims), np.array([run[name].values for run in runs]))
        for name in _KEPT
    }
    data["speed"] = ("tuning", first.speed.values)
    dataset = xr.Dataset(
        data,
        {
            "direction": list(CARRIED),
            "tuning": first.tuning.values,
            "mesh": list(model.mesh_names),
        },
    )
    dataset.attrs = provenance.attributes(
        "All meshes of a gear train over speed",
        model,
        method="exact",
        initial_state="static",
        **settings,
    )
    return describe(dataset)
