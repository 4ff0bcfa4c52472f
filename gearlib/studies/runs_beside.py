"""A run, and where rounding decides it those from seeded starts beside in its place.

What a chaotic motion comes to after many mesh periods hangs on the last digit of its start. A run
is one of these if a start moved by a billionth of a static deflection leads it elsewhere.
"""

import numpy as np

from gearlib.runs.simulation import simulate
from gearlib.studies.trains import motions

#: What a variable says of a run.
FLAGS = {
    "flag_values": np.arange(2, dtype=np.int8),
    "flag_meanings": "unsettled free_of_rounding",
}
_EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")


def runs(model, tuning, run, settings):
    """Return the run from the start asked for, and those that tell what the motion is.

    Parameters
    ----------
    model : Model
    tuning : float
    run : dict
        Arguments of `gearlib.simulate`; initial_state, if given, as displacement and velocity.
    settings : dict
        starts, seed, and spread, the largest displacement added to a start, static deflections.

    Returns
    -------
    asked : xarray.Dataset
    told : list of xarray.Dataset
        Itself, where it is free of rounding; elsewhere one from each seeded start.
    """
    run = {"initial_state": (0.0, 0.0)} | run

    def begun(state, **other):
        return simulate(model, tuning, **run | other | {"initial_state": tuple(map(float, state))})

    state = np.asarray(run["initial_state"], float)
    asked, beside = begun(state), begun(motions.beside(state), samples_per_period=1)
    away = max(abs(float(asked[name] - beside[name])) for name in _EXTREMA)
    if away < motions.KEPT:
        return asked, [asked]
    added = np.random.default_rng(settings["seed"]).uniform(-1.0, 1.0, settings["starts"])
    starts = state + np.outer(settings["spread"] * added, (1.0, 0.0))
    return asked, [begun(start, samples_per_period=1) for start in starts]
