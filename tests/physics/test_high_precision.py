"""Runs in many digits against closed forms, matrix exponentials and Taylor steps of mpmath."""

import math

import mpmath
import pytest

from gearlib import GearPair, OneDegreePair
from gearlib.studies.trials import references
from tests.independent.systems import describe, move
from tests.references import propagate_pair

RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "damping": 0.06}
#: Ten of 50 digits are for the growth of rounding over six periods of bouncing.
DIGITS = mpmath.mpf(10) ** -40


def exact_number(value):
    """Convert a decimal number, given as text or mpf, to an mpf without rounding it to a float."""
    return mpmath.mpf(str(value))


@pytest.mark.parametrize(
    ("changes", "tuning", "state"),
    [
        ({"backlash_ratio": 4.0, "damping": 0.0}, 0.9, (0.0, 0.0)),  # reaches the coast-side flank
        ({"backlash_ratio": 1.0, "damping": 2.0, "backlash_damping": 1.0}, 0.3, (-3.0, 1.0)),
        ({"backlash_ratio": 0.0, "damping": 0.05}, 0.85, (0.0, -1.5)),  # no play between the flanks
        ({"backlash_ratio": math.inf}, 0.9, (0.5, -2.0)),
        ({"backlash_ratio": 4.0}, 0.75, (-4.0, 0.0)),  # from rest on the coast-side flank
        ({"backlash_ratio": 2.0, "contact_ratio": 2.0, "stiffness_ratio": 1.0}, 0.9, (2.0, -2.0)),
    ],
)
def test_linear_high_precision_runs_match_closed_forms(changes, tuning, state):
    """Compare runs in 50 digits with closed forms of the linear motions between events."""
    pair = GearPair.from_ratios(**(RATIOS | changes))
    end, phases, contacts = references.run_precisely(pair, tuning, periods=6, digits=50, state=state)
    (x, v), *events = propagate_pair(pair, tuning, periods=6, state=state)
    assert [*map(tuple, contacts.tolist())] == [event[1:3] for event in events]
    assert max(abs(exact_number(a) - b) for a, b in zip(end, (x, v), strict=True)) < DIGITS
    for phase, event in zip(phases, events, strict=True):
        assert abs(exact_number(phase) - event[0]) < DIGITS


#: Static deflection and eigenfrequency are 1, and so all ratios floats without rounding.
PAIR = GearPair(
    max_stiffness=1.0,
    stiffness_ratio=0.5,
    contact_ratio=1.5,
    reduced_mass=0.75,
    load=0.75,
    backlash=0.5,
    material_damping=0.09375,
    backlash_damping=0.046875,
)


def test_high_precision_runs_with_cubic_damping_match_the_independent_program():
    """Compare a run in 36 digits with an independent program that works in 40 digits."""
    model = OneDegreePair(pair=PAIR, cubic_damping=0.75, backlash_cubic_damping=0.1875)
    with mpmath.workdps(40):
        # `move` integrates the equations with the code of `tests.independent`.
        tuning, periods, state = 0.75, 2, (0.0, -1.0)
        reference = move(describe(model), tuning, periods, state, context=mpmath.mp)
        end, _, contacts = references.run_precisely(model, tuning, periods, digits=36, state=state)
        events = [[event.before, event.after] for event in reference.events]
        assert contacts.tolist() == events and events
        components = zip(end, reference.mesh_state(), strict=True)
        # Eight of the 36 digits allow for the growth of rounding.
        assert max(abs(exact_number(a) - b) for a, b in components) < mpmath.mpf(10) ** -28
