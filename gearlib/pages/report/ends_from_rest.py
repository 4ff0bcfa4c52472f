"""The end of the motion from rest over a grid of tunings, for the page of the report."""

import numpy as np

from gearlib.data.result import result, stacked
from gearlib.data.summary import in_words
from gearlib.models.described_pair import described
from gearlib.runs.simulation import simulate

#: What the page draws over the mesh phase; single precision is finer than any screen.
COURSES = ("displacement", "velocity", "dynamic_force")
_SCALARS = ("displacement_max", "displacement_min", "period", "bounces", "status")


def compute(pairs, tunings, run, periods_shown):
    """Return the last mesh periods of the motion from rest, for all dampings and tunings.

    pairs: arguments of `described` by the name of the damping; tunings: shape (n,); run:
    further arguments of `gearlib.simulate`. Extrema and period are those of the whole record;
    periods_shown: mesh periods of the courses, at most those recorded.

    displacement, velocity, dynamic_force over (damping, tuning, phase) in single precision, phase
    from the start of a mesh period; over (damping, tuning): displacement_max, displacement_min,
    period, bounces, status, final_state (component), motion (in words). A run that could not go on
    is NaN.
    """
    samples = periods_shown * run["samples_per_period"]
    models = {name: described(parameters) for name, parameters in pairs.items()}

    def end(name, nu):
        found = simulate(models[name], nu, **run)
        return {
            **{key: found[key].values[-samples:].astype(np.float32) for key in COURSES},
            **{key: found[key].values for key in _SCALARS},
            "final_state": found.final_state.values.astype(np.float32),
            "motion": in_words(found),
        }

    axes = {"damping": list(models), "tuning": np.asarray(tunings, float)}
    data, some = stacked(axes, end, "phase"), next(iter(models.values()))
    data["final_state"] = (*axes, "component"), data["final_state"][1]
    data["backlash_ratio"] = some.backlash_ratio
    coords = axes | {
        "phase": np.arange(samples) * (2.0 * np.pi / run["samples_per_period"]),
        "component": ["displacement", "velocity"],
    }
    title = "The end of the motion from rest over the tuning"
    return result(title, some, data, coords, method="exact", pairs=pairs, **run)
