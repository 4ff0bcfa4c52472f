"""Derivatives of run-ups: against differences of a second code in 40 digits."""

import os

import mpmath as mp
import numpy as np
import pytest

import gearlib
from tests.paper import PAPER
from tests.references import reference_pair_run_up

FIELDS = (
    "max_stiffness",
    "stiffness_ratio",
    "contact_ratio",
    "reduced_mass",
    "load",
    "backlash",
    "material_damping",
    "backlash_damping",
)
COURSE = ("driven_mass", "base_radius", "initial_displacement", "initial_velocity", "speed")


def differences(pair, run, along, course):
    """Return name of a variable -> its derivative along a direction, by differences in 40 digits.

    `along` has what parameters change by.
    """
    values = {field: getattr(pair, field) for field in (*FIELDS, "teeth")}
    values |= {name: course[name] for name in ("driven_mass", "base_radius")} | {"speed": 1.0}
    for one, start in zip(("displacement", "velocity"), course["initial_state"], strict=True):
        values[f"initial_{one}"] = start
    events = np.column_stack([run[f"event_{one}"] for one in ("time", "from", "to")]).tolist()
    events = [(t, int(a), int(b)) for t, a, b in events]
    with mp.workdps(40):
        step = mp.mpf("1e-15")
        moved = [
            {name: values[name] + sign * step * rate for name, rate in along.items()}
            for sign in (1, -1)
        ]
        rows = course["speed"], course["load"], events, run.time.values[::5].tolist()
        up, down = (reference_pair_run_up.run_up(values | one, *rows) for one in moved)
        return {
            one: np.array(
                [float((a - b) / (2 * step)) for a, b in zip(up[one], down[one], strict=True)]
            )
            for one in up
        }


@pytest.mark.parametrize("seed", range(2))
def test_derivatives_are_those_of_forty_digits(seed):
    rng = np.random.default_rng(seed)
    pair = PAPER.replace(
        material_damping=rng.uniform(1500.0, 3000.0),
        backlash_damping=rng.uniform(500.0, 2500.0),
        contact_ratio=rng.uniform(1.3, 1.7),
        backlash=(40e-6, 8e-6)[seed],
        teeth=5,
    )
    top = float(pair.speed(1.0))
    course = {
        "speed": [(0.0, 0.6 * top), (0.006, 1.1 * top), (0.01, 0.9 * top)],
        "load": [(0.0, 1.0), (0.004, 1.0), (0.004, 0.5)],
        "driven_mass": 0.5 * pair.reduced_mass,
        "base_radius": 0.05,
        "initial_state": (0.7, 0.3),
    }
    names = (*FIELDS, *COURSE)
    run = gearlib.run_up(pair, samples_per_period=8, sensitivities=names, **course)
    assert run.sensitivity_status == 0
    assert (run.event_to == -1).any() or not seed
    # All at once, each by a random share of its size; one by one if asked for.
    sizes = {name: getattr(pair, name) for name in FIELDS} | dict.fromkeys(COURSE, 1.0)
    sizes |= {name: course[name] for name in ("driven_mass", "base_radius")}
    along = [{name: rng.uniform(-1.0, 1.0) * size for name, size in sizes.items()}]
    if os.environ.get("GEARLIB_PROPERTIES"):
        along += [{name: size} for name, size in sizes.items()]
    for slopes in along:
        for one, wanted in differences(pair, run, slopes, course).items():
            got = sum(rate * run[f"d_{one}_d_{name}"].values for name, rate in slopes.items())
            got = got[::5] if run[one].dims == ("time",) else got
            assert np.abs(got - wanted).max() <= 1e-9 * np.abs(wanted).max(), (slopes, one)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"sensitivities": ("tuning",)}, "sensitivities = 'tuning' is not allowed: it must be one"),
        ({"sensitivities": ("load", "load")}, "names must be all different"),
        ({"sensitivities": 7}, "sensitivities = 7 is not allowed: it must be a sequence of names"),
        ({"sensitivities": "driven_mass"}, "with base_radius = None"),
        ({"sensitivities": "load", "load": [(0.0, 1.0), (0.1, 2.0)]}, "must change by steps"),
        (
            {"sensitivities": "contact_ratio", "model": PAPER.replace(contact_ratio=1.0)},
            "contact_ratio = 1.0",
        ),
    ],
)
def test_what_has_no_derivative_is_refused(given, words):
    with pytest.raises(ValueError, match="not allowed") as told:
        gearlib.run_up(**{"model": PAPER, "start": 1e3, "stop": 1100.0, "duration": 0.05} | given)
    assert words in str(told.value)
