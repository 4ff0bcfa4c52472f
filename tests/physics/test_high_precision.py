"""Compare high-precision runs with closed forms and with an independent program."""

import math

import mpmath
import pytest

from gearlib import GearPair, OneDegreePair
from gearlib.studies.trials import references
from tests.independent.systems import describe, move
from tests.references import propagate_pair

PAIR_RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "damping": 0.06}
#: Over six periods with contact loss, rounding errors may grow by ten of 50 digits.
MAX_ERROR = mpmath.mpf(10) ** -40


def exact_number(value):
    """Convert a decimal number, given as a string or mpf, to an mpf without rounding to a float."""
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
    """Runs in 50 digits must agree with the closed form of the motion between contact events."""
    pair = GearPair.from_ratios(**(PAIR_RATIOS | changes))
    end, phases, contacts = references.run_precisely(
        pair, tuning, periods=6, digits=50, state=state
    )
    (x, v), *events = propagate_pair(pair, tuning, periods=6, state=state)
    reference_phases = [phase for phase, _, _, _ in events]
    reference_contacts = [(before, after) for _, before, after, _ in events]
    assert [*map(tuple, contacts.tolist())] == reference_contacts
    assert max(abs(exact_number(a) - b) for a, b in zip(end, (x, v), strict=True)) < MAX_ERROR
    for phase, reference_phase in zip(phases, reference_phases, strict=True):
        assert abs(exact_number(phase) - reference_phase) < MAX_ERROR


#: Static deflection and natural frequency are 1, so that all ratios are floats without rounding.
EXACT_PAIR = GearPair(
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
    """A run in 36 digits must agree with an independent program that works in 40 digits."""
    model = OneDegreePair(pair=EXACT_PAIR, cubic_damping=0.75, backlash_cubic_damping=0.1875)
    with mpmath.workdps(40):
        # `move` is part of the independent program.
        tuning, periods, state = 0.75, 2, (0.0, -1.0)
        reference = move(describe(model), tuning, periods, state, context=mpmath.mp)
        end, _, contacts = references.run_precisely(model, tuning, periods, digits=36, state=state)
        events = [[event.before, event.after] for event in reference.events]
        assert contacts.tolist() == events and events
        components = zip(end, reference.mesh_state(), strict=True)
        # Rounding errors may grow by eight of the 36 digits.
        assert max(abs(exact_number(a) - b) for a, b in components) < mpmath.mpf(10) ** -28
