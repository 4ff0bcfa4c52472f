"""Check each rule for verdicts on methods of integration, by constructed outcomes of runs."""

import math

import numpy as np
import pytest

from gearlib import GearPair, integrators
from gearlib.data import status
from gearlib.studies.trials import difficult_problems, failures
from gearlib.studies.trials.difficult_problems import Problem
from gearlib.studies.trials.failures import Outcome, classify_run

GEAR_PAIR = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.6, backlash_ratio=4.0)
#: Contact states (before, after) of two events: 1 drive, 0 no contact.
REFERENCE_CONTACTS = ((1, 0), (0, 1))
STALLED_STATUSES = (status.EVENT_LIMIT, status.NOT_CONVERGED, status.STALLED)
#: A settled orbit of period 1 with a peak-to-peak displacement of 2 and one bounce per period.
REFERENCE = Outcome(status.OK, (1.0, 0.0), -0.5, 1.5, (0.8, 0.2, 0.0), 1.0, 1, REFERENCE_CONTACTS)
CHAOTIC_REFERENCE = REFERENCE._replace(period=0)
SMALL_REFERENCE = REFERENCE._replace(low=0.99, high=1.01)
MOTION_AT_REST = Outcome(status.OK, (1.0, 0.0), 1.0, 1.0, (1.0, 0.0, 0.0), 0.0, 1)
#: Motions that end far from, and close to, the static equilibrium (1, 0).
FAR_FROM_EQUILIBRIUM, NEAR_EQUILIBRIUM = (
    REFERENCE._replace(state=(2.0, 0.0)),
    REFERENCE._replace(state=(1.001, 0.0)),
)


def judge(quantity, reference=REFERENCE, tolerance=1e-2, **changes):
    """Return the verdict and the error of an outcome that differs from the reference by `changes`.

    `quantity` is what the problem compares, such as "state", and `tolerance` its largest error.
    """
    problem = Problem("", GEAR_PAIR, 2.0, quantity=quantity, tolerance=tolerance, orbit=(1.0, 0.0))
    return classify_run(problem, reference._replace(**changes), reference)


def fraction_changes(drive_fraction):
    """Return changes to an outcome without events and with a fraction of time in drive contact."""
    return {"fractions": (drive_fraction, 1.0 - drive_fraction, 0.0), "contacts": ()}


@pytest.mark.parametrize(
    ("quantity", "reference", "changes", "expected"),
    [
        *(("orbit", REFERENCE, {"status": code}, "stalled") for code in STALLED_STATUSES),
        ("orbit", REFERENCE, {"status": status.OVERFLOW}, "diverged"),
        # The height decides whether a motion has diverged.
        ("state", REFERENCE, {"state": (9.0, 0.0), "high": 1999.0}, "invented_motion"),
        ("state", REFERENCE, {"state": (9.0, 0.0), "high": 2e4}, "diverged"),
        ("state", REFERENCE, {"state": (9.0, 0.0), "high": math.inf}, "diverged"),
        # Errors are relative to the height 2 of REFERENCE. Velocities are multiplied by nu = 2.
        ("state", REFERENCE, {"state": (1.019, 0.0)}, "right"),
        ("state", REFERENCE, {"state": (1.021, 0.0)}, "inaccurate"),
        ("state", REFERENCE, {"state": (1.0, -0.009)}, "right"),
        ("state", REFERENCE, {"state": (1.0, -0.011)}, "inaccurate"),
        # A small motion is measured in static deflections.
        ("state", SMALL_REFERENCE, {"state": (1.005, 0.0)}, "right"),
        # A motion that starts at rest must not grow; one that does not repeat may have any height.
        (
            "state",
            MOTION_AT_REST,
            {"state": (1.5, 0.0), "low": 0.5, "high": 1.5},
            "invented_motion",
        ),
        ("state", CHAOTIC_REFERENCE, {"state": (1.5, 0.0), "high": 9.0}, "inaccurate"),
        # An error up to 1 % of the height is tolerated; above 5 % the orbit is a different one.
        ("orbit", REFERENCE, {"high": 1.515}, "right"),
        ("orbit", REFERENCE, {"high": 1.55, "contacts": ()}, "inaccurate"),
        ("orbit", REFERENCE, {"high": 1.65}, "wrong_attractor"),
        ("orbit", REFERENCE, {"high": 1.55, "period": 2}, "wrong_attractor"),
        ("orbit", REFERENCE, {"high": 1.55, "bounces": 2.0}, "wrong_attractor"),
        ("orbit", REFERENCE, {"high": 1.55, **fraction_changes(0.7)}, "wrong_attractor"),
        ("orbit", REFERENCE, {"period": 2, **fraction_changes(0.7)}, "right"),
        # A larger orbit is another attractor, not an invented motion.
        ("orbit", REFERENCE, {"high": 9.0}, "wrong_attractor"),
        # Chaotic motions are compared by label and fractions of time.
        ("fractions", CHAOTIC_REFERENCE, {"state": (7.0, 7.0), **fraction_changes(0.795)}, "right"),
        ("fractions", CHAOTIC_REFERENCE, fraction_changes(0.77), "inaccurate"),
        ("fractions", CHAOTIC_REFERENCE, fraction_changes(0.7), "wrong_attractor"),
        ("fractions", CHAOTIC_REFERENCE, {"period": 3}, "wrong_attractor"),
        # The energy is (x - 1)^2 / 2 + (nu v)^2 / 2, and a motion whose energy grows is invented.
        ("energy", FAR_FROM_EQUILIBRIUM, {"state": (1.0, 0.5)}, "right"),
        ("energy", FAR_FROM_EQUILIBRIUM, {"state": (2.1, 0.0)}, "invented_motion"),
        ("energy", FAR_FROM_EQUILIBRIUM, {"state": (1.9, 0.0)}, "inaccurate"),
        # Deviations are distances from the orbit (1, 0).
        ("deviation", NEAR_EQUILIBRIUM, {"state": (1.002, 0.0)}, "invented_motion"),
        ("deviation", NEAR_EQUILIBRIUM, {"state": (1.0, 0.0)}, "inaccurate"),
        ("deviation", NEAR_EQUILIBRIUM, {"state": (0.999, 0.0)}, "right"),
    ],
)
def test_rules_give_verdicts_on_constructed_outcomes(quantity, reference, changes, expected):
    """Each outcome must get the expected verdict, and a state error relative to the height."""
    name, error = judge(quantity, reference, **changes)
    # A run that was aborted, as its status says, has no error.
    assert name == expected and math.isnan(error) == ("status" in changes)
    if quantity == "state" and math.isfinite(changes.get("high", 0.0)):
        # Errors of motions smaller than one static deflection are relative to this deflection.
        height, nu = max(1.0, reference.high - reference.low), 2.0
        x_error, v_error = np.abs(np.subtract(changes["state"], reference.state))
        assert error == pytest.approx(max(x_error, nu * v_error) / height)


# The reference has the events (1, 0) and (0, 1), contact states before and after. Events that are
# missing, spurious or out of order are counted.
@pytest.mark.parametrize(
    ("contacts", "wrong_count"),
    [
        ((), 2),
        (REFERENCE_CONTACTS[:1], 1),
        (REFERENCE_CONTACTS[::-1], 2),
        ((*REFERENCE_CONTACTS, (1, 0)), 1),
    ]
    + [(((1, 0), (0, -1)), 1), (((1, 0), (0, -1), (-1, 0)), 2), (REFERENCE_CONTACTS, 0)],
)
def test_wrong_events_count_as_missed_only_if_the_state_is_wrong(contacts, wrong_count):
    """Wrong events must give the verdict "missed_event" only if the final state is wrong, too.

    If a problem compares contacts, the error must be the number of wrong events.
    """
    assert judge("state", contacts=contacts)[0] == "right"
    expected = "missed_event" if wrong_count else "inaccurate"
    assert judge("state", contacts=contacts, state=(1.5, 0.0))[0] == expected
    expected = "missed_event" if wrong_count else "right"
    assert judge("contacts", tolerance=0.0, contacts=contacts) == (expected, wrong_count)


def test_only_scipy_at_its_smallest_tolerance_is_its_own_reference():
    """For every other method the reference must be a run by a different method."""
    for key, problem in difficult_problems.build_problems().items():
        for method, module in integrators.METHODS.items():
            if module.supports(problem.model):
                reference, options = failures.choose_reference_method(problem, method)
                assert reference != method or (method == "scipy" and options["rtol"] == 1e-13), key
