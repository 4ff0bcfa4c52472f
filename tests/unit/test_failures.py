"""Verdicts on methods in difficult problems: each rule on constructed outcomes."""

import math

import numpy as np
import pytest

from gearlib import GearPair, integrators
from gearlib.data import status
from gearlib.studies.trials import difficult_problems, failures
from gearlib.studies.trials.difficult_problems import Problem
from gearlib.studies.trials.failures import Outcome, classify_run

PAIR = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.6, backlash_ratio=4.0)
CONTACTS = ((1, 0), (0, 1))
STALLED = (status.EVENT_LIMIT, status.NOT_CONVERGED, status.STALLED)
#: A settled orbit of period 1 with height 2 and one bounce a period.
REFERENCE = Outcome(status.OK, (1.0, 0.0), -0.5, 1.5, (0.8, 0.2, 0.0), 1.0, 1, CONTACTS)
CHAOS = REFERENCE._replace(period=0)
SMALL = REFERENCE._replace(low=0.99, high=1.01)
REST = Outcome(status.OK, (1.0, 0.0), 1.0, 1.0, (1.0, 0.0, 0.0), 0.0, 1)
#: Motions that end far from the static equilibrium (1, 0), and close to it.
AWAY, BESIDE = REFERENCE._replace(state=(2.0, 0.0)), REFERENCE._replace(state=(1.001, 0.0))


def verdict(quantity, reference=REFERENCE, tolerance=1e-2, **changes):
    """Return the verdict and error of an outcome that differs from the reference by `changes`."""
    problem = Problem("", PAIR, 2.0, quantity=quantity, tolerance=tolerance, orbit=(1.0, 0.0))
    return classify_run(problem, reference._replace(**changes), reference)


def fractions(normal):
    """Return changes of an outcome without events; `normal` is the time fraction of drive side."""
    return {"fractions": (normal, 1.0 - normal, 0.0), "contacts": ()}


@pytest.mark.parametrize(
    ("quantity", "reference", "changes", "expected"),
    [
        *(("orbit", REFERENCE, {"status": code}, "stalled") for code in STALLED),
        ("orbit", REFERENCE, {"status": status.OVERFLOW}, "diverged"),
        # The height decides whether a motion has diverged.
        ("state", REFERENCE, {"state": (9.0, 0.0), "high": 1999.0}, "invented_motion"),
        ("state", REFERENCE, {"state": (9.0, 0.0), "high": 2e4}, "diverged"),
        ("state", REFERENCE, {"state": (9.0, 0.0), "high": math.inf}, "diverged"),
        # Errors are relative to the height 2 of REFERENCE; errors of velocities count nu = 2 times.
        ("state", REFERENCE, {"state": (1.019, 0.0)}, "right"),
        ("state", REFERENCE, {"state": (1.021, 0.0)}, "inaccurate"),
        ("state", REFERENCE, {"state": (1.0, -0.009)}, "right"),
        ("state", REFERENCE, {"state": (1.0, -0.011)}, "inaccurate"),
        # A small motion is measured in static deflections.
        ("state", SMALL, {"state": (1.005, 0.0)}, "right"),
        # A motion that starts at rest must not grow; one that does not repeat may have any height.
        ("state", REST, {"state": (1.5, 0.0), "low": 0.5, "high": 1.5}, "invented_motion"),
        ("state", CHAOS, {"state": (1.5, 0.0), "high": 9.0}, "inaccurate"),
        # An error of one per cent of the height is tolerated, and five per cent mean another orbit.
        ("orbit", REFERENCE, {"high": 1.515}, "right"),
        ("orbit", REFERENCE, {"high": 1.55, "contacts": ()}, "inaccurate"),
        ("orbit", REFERENCE, {"high": 1.65}, "wrong_attractor"),
        ("orbit", REFERENCE, {"high": 1.55, "period": 2}, "wrong_attractor"),
        ("orbit", REFERENCE, {"high": 1.55, "bounces": 2.0}, "wrong_attractor"),
        ("orbit", REFERENCE, {"high": 1.55, **fractions(0.7)}, "wrong_attractor"),
        ("orbit", REFERENCE, {"period": 2, **fractions(0.7)}, "right"),
        # A larger orbit is another attractor, not an invented motion.
        ("orbit", REFERENCE, {"high": 9.0}, "wrong_attractor"),
        # Chaotic motions are compared by label and fractions of time.
        ("fractions", CHAOS, {"state": (7.0, 7.0), **fractions(0.795)}, "right"),
        ("fractions", CHAOS, fractions(0.77), "inaccurate"),
        ("fractions", CHAOS, fractions(0.7), "wrong_attractor"),
        ("fractions", CHAOS, {"period": 3}, "wrong_attractor"),
        # The energy is (x - 1)^2 / 2 + (nu v)^2 / 2, and a motion whose energy grows is invented.
        ("energy", AWAY, {"state": (1.0, 0.5)}, "right"),
        ("energy", AWAY, {"state": (2.1, 0.0)}, "invented_motion"),
        ("energy", AWAY, {"state": (1.9, 0.0)}, "inaccurate"),
        # Deviations are distances from the orbit (1, 0).
        ("deviation", BESIDE, {"state": (1.002, 0.0)}, "invented_motion"),
        ("deviation", BESIDE, {"state": (1.0, 0.0)}, "inaccurate"),
        ("deviation", BESIDE, {"state": (0.999, 0.0)}, "right"),
    ],
)
def test_rules_give_verdicts_on_constructed_outcomes(quantity, reference, changes, expected):
    """Constructed outcomes must get the expected verdict and the defined relative error."""
    name, error = verdict(quantity, reference, **changes)
    assert name == expected and math.isnan(error) == ("status" in changes)
    if quantity == "state" and math.isfinite(changes.get("high", 0.0)):
        # Errors of small motions are relative to one static deflection.
        height = max(1.0, reference.high - reference.low)
        x, v = np.abs(np.subtract(changes["state"], reference.state))
        assert error == pytest.approx(max(x, 2.0 * v) / height)


# The reference has the events (1, 0) and (0, 1), contact states before and after. Events that are
# missing, spurious or out of order are counted.
@pytest.mark.parametrize(
    ("contacts", "wrong_count"),
    [((), 2), (CONTACTS[:1], 1), (CONTACTS[::-1], 2), ((*CONTACTS, (1, 0)), 1)]
    + [(((1, 0), (0, -1)), 1), (((1, 0), (0, -1), (-1, 0)), 2), (CONTACTS, 0)],
)
def test_wrong_events_count_as_missed_only_if_the_state_is_wrong(contacts, wrong_count):
    """Where states are compared, wrong events must count as missed only if the state is wrong."""
    assert verdict("state", contacts=contacts)[0] == "right"
    expected = "missed_event" if wrong_count else "inaccurate"
    assert verdict("state", contacts=contacts, state=(1.5, 0.0))[0] == expected
    expected = "missed_event" if wrong_count else "right"
    assert verdict("contacts", tolerance=0.0, contacts=contacts) == (expected, wrong_count)


def test_only_scipy_at_its_least_tolerance_is_its_own_reference():
    for key, problem in difficult_problems.build_problems().items():
        for method, module in integrators.METHODS.items():
            if module.supports(problem.model):
                reference, options = failures.choose_reference_method(problem, method)
                assert reference != method or (method == "scipy" and options["rtol"] == 1e-13), key
