"""Verdicts on methods by difficult problems: every rule, on constructed outcomes; the matrix."""

import math

import numpy as np
import pytest

from gearlib import GearPair, integrators
from gearlib.data import gathering, status, storage
from gearlib.studies.trials import difficult_problems, failures
from gearlib.studies.trials.difficult_problems import Problem
from gearlib.studies.trials.failures import VERDICTS, Outcome, decide

PAIR = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.6, backlash=4.0)
CONTACTS = ((1, 0), (0, 1))
#: A settled orbit of one period, height 2, one bounce a period.
REFERENCE = Outcome(status.OK, (1.0, 0.0), -0.5, 1.5, (0.8, 0.2, 0.0), 1.0, 1, CONTACTS)


def problem(quantity, tolerance=1e-2, **changes):
    return Problem("", PAIR, 2.0, quantity=quantity, tolerance=tolerance, **changes)


def verdict(quantity, reference=REFERENCE, tolerance=1e-2, orbit=(), **changes):
    """Return the verdict on a reference with some of its values changed."""
    question = problem(quantity, tolerance, orbit=orbit)
    return decide(question, reference._replace(**changes), reference)


CHAOS = REFERENCE._replace(period=0)
SMALL = REFERENCE._replace(low=0.99, high=1.01)
REST = Outcome(status.OK, (1.0, 0.0), 1.0, 1.0, (1.0, 0.0, 0.0), 0.0, 1)
AWAY = REFERENCE._replace(state=(2.0, 0.0))
BESIDE = REFERENCE._replace(state=(1.001, 0.0))
#: quantity, what is different from the reference, verdict, the reference
JUDGED = [
    # Heights beyond all bounds.
    ("state", {"state": (9.0, 0.0), "high": 1999.0}, "invented_motion"),
    ("state", {"state": (9.0, 0.0), "high": 2e4}, "diverged"),
    ("state", {"state": (9.0, 0.0), "high": math.inf}, "diverged"),
    # Over the height 2; a velocity counts nu = 2 times.
    ("state", {"state": (1.019, 0.0)}, "right"),
    ("state", {"state": (1.021, 0.0)}, "inaccurate"),
    ("state", {"state": (1.0, -0.009)}, "right"),
    ("state", {"state": (1.0, -0.011)}, "inaccurate"),
    # A small motion is measured in static deflections.
    ("state", {"state": (1.005, 0.0)}, "right", SMALL),
    # One per cent of the height is the tolerance, five per cent another orbit.
    ("orbit", {"high": 1.515}, "right"),
    ("orbit", {"high": 1.55, "contacts": ()}, "inaccurate"),
    ("orbit", {"high": 1.65}, "wrong_attractor"),
    ("orbit", {"high": 1.55, "period": 2}, "wrong_attractor"),
    ("orbit", {"high": 1.55, "bounces": 2.0}, "wrong_attractor"),
    ("orbit", {"high": 1.55, "fractions": (0.7, 0.3, 0.0)}, "wrong_attractor"),
    ("orbit", {"period": 2, "fractions": (0.7, 0.3, 0.0)}, "right"),
    # A larger orbit is another attractor, not an invention.
    ("orbit", {"high": 9.0}, "wrong_attractor"),
    # Chaos goes by label and fractions.
    (
        "fractions",
        {"fractions": (0.795, 0.205, 0.0), "state": (7.0, 7.0), "contacts": ()},
        "right",
        CHAOS,
    ),
    ("fractions", {"fractions": (0.77, 0.23, 0.0), "contacts": ()}, "inaccurate", CHAOS),
    ("fractions", {"fractions": (0.7, 0.3, 0.0)}, "wrong_attractor", CHAOS),
    ("fractions", {"period": 3}, "wrong_attractor", CHAOS),
    # (x - 1)^2 / 2 + (nu v)^2 / 2 about the rest position 1: what grows is invented.
    ("energy", {"state": (1.0, 0.5)}, "right", AWAY),
    ("energy", {"state": (2.1, 0.0)}, "invented_motion", AWAY),
    ("energy", {"state": (1.9, 0.0)}, "inaccurate", AWAY),
    # Deviations from the orbit (1, 0).
    ("deviation", {"state": (1.002, 0.0)}, "invented_motion", BESIDE),
    ("deviation", {"state": (1.0, 0.0)}, "inaccurate", BESIDE),
    ("deviation", {"state": (0.999, 0.0)}, "right", BESIDE),
    # Motion from rest; one that does not repeat may be any height.
    ("state", {"state": (1.5, 0.0), "low": 0.5, "high": 1.5}, "invented_motion", REST),
    ("state", {"state": (1.5, 0.0), "high": 9.0}, "inaccurate", CHAOS),
]


@pytest.mark.parametrize(("quantity", "changes", "expected", "reference"),
                         [(*row, REFERENCE)[:4] for row in JUDGED])  # fmt: skip
def test_each_rule_on_constructed_outcomes(quantity, changes, expected, reference):
    found, off = verdict(quantity, reference, orbit=(1.0, 0.0), **changes)
    assert found == expected
    if quantity == "state" and math.isfinite(changes.get("high", 0.0)):
        # Of a motion less than a static deflection high in these.
        height = max(1.0, reference.high - reference.low)
        x, v = (abs(a - b) for a, b in zip(changes["state"], reference.state, strict=True))
        assert off == pytest.approx(max(x, 2.0 * v) / height)


def test_how_far_off_deviations_and_runs_without_an_end_are():
    assert verdict("deviation", BESIDE, orbit=(1.0, 0.0), state=(1.002, 0.0))[1] == (
        pytest.approx(1.0)
    )
    ends = {status.OVERFLOW: "diverged"} | dict.fromkeys(
        (status.EVENT_LIMIT, status.NOT_CONVERGED, status.STALLED), "stalled"
    )
    for code, expected in ends.items():
        found, off = decide(problem("state"), Outcome(code), REFERENCE)
        assert found == expected and math.isnan(off)


@pytest.mark.parametrize(
    ("contacts", "wrong"),
    [((), 2), (CONTACTS[:1], 1), (CONTACTS[::-1], 2), ((*CONTACTS, (1, 0)), 1)]
    + [(((1, 0), (0, -1)), 1), (((1, 0), (0, -1), (-1, 0)), 2), (CONTACTS, 0)],
)
def test_other_events_are_missed_events_if_the_state_is_off(contacts, wrong):
    assert failures.wrong_contacts(contacts, CONTACTS) == wrong
    assert verdict("state", contacts=contacts)[0] == "right"
    expected = "missed_event" if wrong else "inaccurate"
    assert verdict("state", contacts=contacts, state=(1.5, 0.0))[0] == expected
    found = verdict("contacts", tolerance=0.0, contacts=contacts)
    assert found == ("missed_event" if wrong else "right", wrong)


def test_extrema_of_an_orbit_are_looked_for_between_the_steps():
    def highest(quantity, method, **options):
        question = Problem("", PAIR, 0.7, quantity=quantity, tolerance=1e-2, record_periods=1)
        return failures.run(question, method, options, 4).high

    exact = highest("orbit", "exact")
    between, at_steps = (
        abs(highest(quantity, "rk4", steps_per_period=16) - exact)
        for quantity in ("orbit", "state")
    )
    # The steps themselves are good to 1e-3.
    assert between < 2e-3 and at_steps > 4.0 * between


def test_the_judge_is_never_the_method_itself():
    known = difficult_problems.problems()
    for key, question in known.items():
        for method, module in integrators.METHODS.items():
            if module.supports(question.model):
                judge, options = failures.reference_method(question, method)
                assert judge != method or (method == "scipy" and options["rtol"] == 1e-13), key
    assert failures.reference_method(known["rest_near"], "rk4") == ("exact", {})
    assert failures.reference_method(known["rest_near"], "exact") == ("taylor", {})
    assert failures.reference_method(known["cubic_damping"], "rk4") == ("taylor", {})
    assert failures.reference_method(known["cubic_damping"], "taylor")[0] == "scipy"
    assert failures.reference_method(known["stiff_bearings"], "scipy") == ("exact", {})


CHOSEN = ["graze_past_6", "rest_near", "stiff_bearings", "conservative"]


def column(chosen, *trial):
    """Return the verdicts of a trial on some problems."""
    known = difficult_problems.problems()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(failures, "problems", lambda: {name: known[name] for name in chosen})
        return failures.compute(*trial)


@pytest.fixture(scope="module")
def columns():
    short = {"solver": "LSODA", "rtol": 1e-4}
    trials = ("rk4-40", "rk4", {"steps_per_period": 40}), ("lsoda", "scipy", short)
    return [column(CHOSEN, *trial) for trial in trials]


def test_the_matrix_has_units_flags_and_both_columns(columns, tmp_path):
    matrix = gathering.gather_failures(columns)
    assert matrix.verdict.dims == ("problem", "trial")
    assert matrix.trial.values.tolist() == ["rk4-40", "lsoda"]
    assert matrix.problem.values.tolist() == CHOSEN
    assert matrix.verdict.attrs["flag_meanings"].split() == VERDICTS
    refused = matrix.sel(problem="stiff_bearings", trial="rk4-40")
    assert VERDICTS[int(refused.verdict)] == "refused" and np.isnan(refused.error)
    assert "it takes one degree of freedom" in refused.message.item()
    for name in CHOSEN:
        state = difficult_problems.problems()[name].state
        start = state if len(state) == 2 else [math.nan] * 2
        one = matrix.sel(problem=name)
        np.testing.assert_array_equal([one.displacement, one.velocity], start)
    assert matrix.words.dims == ("problem",) and matrix.options.dims == ("trial",)
    storage.write(matrix, tmp_path / "matrix.nc")
    assert storage.read(tmp_path / "matrix.nc").equals(matrix)
