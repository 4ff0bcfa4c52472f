"""A run, and where rounding decides it those from seeded starts in its place."""

import numpy as np

from gearlib.data.status import flags_of
from gearlib.runs.simulation import simulate
from gearlib.studies.many_starts import KEPT, beside, starts

#: What a variable says of a run.
FLAGS = flags_of(("unsettled", "free_of_rounding"))
_EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")


def runs(model, tuning, run, settings):
    """Return the run from the start asked for, and those that tell what the motion is.

    These are itself, where it is free of rounding; elsewhere one from each of the `starts`. `run`
    has the arguments of `gearlib.simulate`, a start as displacement and velocity.
    """
    run = {"initial_state": (0.0, 0.0)} | run

    def begun(state, **other):
        return simulate(model, tuning, **run | other | {"initial_state": tuple(map(float, state))})

    state = np.asarray(run["initial_state"], float)
    asked = begun(state, until_settled=True)
    near = begun(beside(state), samples_per_period=1)
    away = max(abs(float(asked[name] - near[name])) for name in _EXTREMA)
    if away < KEPT:
        return asked, [asked]
    return asked, [begun(z, samples_per_period=1) for z in starts(model, state, settings)]
