"""The end of the motion from rest over a grid of tunings, for the page of the report."""

import numpy as np
import xarray as xr

from gearlib.data import provenance
from gearlib.data.summary import in_words
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate

#: What the page draws over the mesh phase; single precision is finer than any screen.
COURSES = ("displacement", "velocity", "dynamic_force")
_SCALARS = ("displacement_max", "displacement_min", "period", "bounces", "status")


def compute(pairs, tunings, run, periods_shown):
    """Return the last mesh periods of the motion from rest, for all dampings and tunings.

    pairs: keyword arguments of `GearPair` by the name of the damping; tunings: shape (n,); run:
    further arguments of `gearlib.simulate`. Extrema and period are those of the whole record;
    periods_shown: mesh periods of the courses, at most those recorded.

    displacement, velocity, dynamic_force over (damping, tuning, phase) in single precision, phase
    from the start of a mesh period; over (damping, tuning): displacement_max, displacement_min,
    period, bounces, status, final_state (component), motion (in words). A run that could not go on
    is NaN.
    """
    samples = periods_shown * run["samples_per_period"]
    models = {name: GearPair(**parameters) for name, parameters in pairs.items()}
    rows = [_facts(simulate(p, nu, **run), samples) for p in models.values() for nu in tunings]

    def over(name, *dims):
        values = np.array([row[name] for row in rows])
        shape = (len(models), len(tunings), *values.shape[1:])
        return ("damping", "tuning", *dims), values.reshape(shape)

    some = next(iter(models.values()))
    dataset = xr.Dataset(
        {
            **{name: over(name, "phase") for name in COURSES},
            **{name: over(name) for name in (*_SCALARS, "motion")},
            "final_state": over("final_state", "component"),
            "backlash_ratio": some.backlash_ratio,
        },
        {
            "damping": list(models),
            "tuning": np.asarray(tunings, float),
            "phase": np.arange(samples) * (2.0 * np.pi / run["samples_per_period"]),
            "component": ["displacement", "velocity"],
        },
    )
    dataset.attrs = provenance.attributes(
        "The end of the motion from rest over the tuning", some, method="exact", pairs=pairs, **run
    )
    return describe(dataset)


def _facts(run, samples):
    """Return what is kept of one run, by name."""
    return {
        **{name: run[name].values[-samples:].astype(np.float32) for name in COURSES},
        **{name: run[name].values for name in _SCALARS},
        "final_state": run.final_state.values.astype(np.float32),
        "motion": in_words(run),
    }
