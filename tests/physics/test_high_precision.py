"""Runs in many digits against closed forms, matrix exponentials and Taylor steps of mpmath."""

import math
from decimal import Decimal, localcontext

import mpmath
import numpy as np
import pytest

from gearlib import Fourier, GearPair, Harmonics, OneDegreePair
from gearlib.config import load
from gearlib.studies.trials import high_precision, problems, references
from tests.independent.systems import describe, move
from tests.paper import CONFIG
from tests.references import of_pair

RATIOS = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "damping": 0.06}
#: Of 50 digits ten may go to the growth of rounding over six periods of bouncing.
DIGITS = mpmath.mpf(10) ** -40


def digits_of(value):
    return mpmath.mpf(str(value))


@pytest.mark.parametrize(
    ("changes", "tuning", "state"),
    [
        ({"backlash": 4.0}, 0.7, (0.0, 0.0)),  # never leaves the flank
        ({"backlash": 4.0, "backlash_damping": 0.06}, 0.9, (0.0, 0.0)),  # bounces
        ({"backlash": 4.0, "damping": 0.0}, 0.9, (0.0, 0.0)),  # reaches the far flank
        ({"backlash": 1.0, "damping": 2.0, "backlash_damping": 1.0}, 0.3, (-3.0, 1.0)),
        ({"backlash": 0.0, "damping": 0.05}, 0.85, (0.0, -1.5)),  # no way between the flanks
        ({"backlash": math.inf}, 0.9, (0.5, -2.0)),
        ({"backlash": 4.0}, 0.75, (-4.0, -1.0)),  # from the far flank line, through it
        ({"backlash": 4.0}, 0.75, (-4.0, 0.0)),  # from rest on it
        ({"backlash": 2.0, "contact_ratio": 1.0}, 0.9, (-1.0, 0.3)),  # constant stiffness
        ({"backlash": 2.0, "contact_ratio": 2.0, "stiffness_ratio": 1.0}, 0.9, (2.0, -2.0)),
    ],
)
def test_one_degree_against_closed_forms(changes, tuning, state):
    pair = GearPair.from_ratios(**(RATIOS | changes))
    found = high_precision.run(pair, tuning, 6, 50, state)
    x, v, events = of_pair(pair, tuning, 6, state)
    assert [event[1:] for event in found.events] == [event[1:3] for event in events]
    assert max(abs(digits_of(a) - b) for a, b in zip(found.state, (x, v), strict=True)) < DIGITS
    for event, expected in zip(found.events, events, strict=True):
        assert abs(digits_of(event.phase) - expected[0]) < DIGITS


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


@pytest.mark.parametrize(
    "dampings",
    [
        {"cubic_damping": 0.09375},
        {"quadratic_damping": 0.1875, "backlash_quadratic_damping": 0.09375},
        {"quadratic_damping": 0.75, "backlash_cubic_damping": 0.1875},
    ],
)
def test_nonlinear_damping_against_the_independent_program(dampings):
    model = OneDegreePair(pair=PAIR, **dampings)
    with mpmath.workdps(40):
        expected = move(describe(model), 0.75, 2, (0.0, -1.0), context=mpmath.mp)
        found = high_precision.run(model, 0.75, 2, 36, (0.0, -1.0))
        events = [(one.before, one.after) for one in expected.events]
        assert [event[1:] for event in found.events] == events and events
        end = expected.mesh_state()
        off = max(abs(digits_of(a) - b) for a, b in zip(found.state, end, strict=True))
        # Of 36 digits some go to the growth of rounding.
        assert off < mpmath.mpf(10) ** -28


def test_what_is_not_run_in_many_digits_is_refused():
    for more in (
        {"cubic_stiffness": 1.0},
        {"profile": Fourier(1)},
        {"excitation": Harmonics((0.1,))},
        {"deviation": Harmonics((0.1,))},
    ):
        with pytest.raises(ValueError, match="OneDegreePair with these .* must be rectangular"):
            high_precision.run(OneDegreePair(pair=PAIR, **more), 0.75, 1)


def series(*coefficients):
    return [Decimal(value) for value in coefficients]


def test_the_first_zero_of_a_series():
    with localcontext(prec=50):
        # (t - 1/2)^2 - 1e-20, falling at 1/2 - 1e-10 and rising again; a sampled sign misses it.
        dip = series("0.25", "-1", "1")
        dip[0] -= Decimal("1e-20")
        root = high_precision._first_zero(dip, Decimal(1))
        assert abs(root - (Decimal("0.5") - Decimal("1e-10"))) < Decimal("1e-35")
        dip[0] += Decimal("2e-20")
        assert high_precision._first_zero(dip, Decimal(1)) is None
        # Of two zeros the first: (1/4 - t) (3/4 - t).
        first = high_precision._first_zero(series("0.1875", "-1", "1"), Decimal(1))
        assert abs(first - Decimal("0.25")) < Decimal("1e-40")
        # (t - 1/3)^2, to the last digit.
        touch = [Decimal(1) / 9, Decimal(-2) / 3, Decimal(1)]
        with pytest.raises(high_precision.Unresolved):
            high_precision._first_zero(touch, Decimal(1))


def test_digits_are_added_until_they_are_enough(monkeypatch):
    # Twenty periods without damping lose some twenty digits.
    settings = load(CONFIG).model_dump()["work_precision"] | {"conservative_periods": 20}
    problem = problems.build("conservative", CONFIG["gear_pair"], {}, settings)
    expected = references.reference(problem)
    monkeypatch.setattr(references, "DIGITS", (12, 24, 48, 96))
    found = references.reference(problem)
    np.testing.assert_array_equal(found.state, expected.state)
    monkeypatch.setattr(references, "DIGITS", (12, 24))
    with pytest.raises(ValueError, match="periods = 20 is not allowed for .*'conservative'"):
        references.reference(problem)
