"""The verdict of one method on one problem, by rule; the whole matrix.

A run is judged against the reference that shares nothing with it but the model: the exact
propagator where it takes the model, else Taylor steps to rounding. These two are judged by each
other, and where only one of them takes the model, by scipy's DOP853 split at events at a
tolerance of 1e-13. The first rule that holds gives the verdict:

==================  ===========================================================================
verdict             rule
==================  ===========================================================================
refused             the method does not take the model
diverged            the motion left the range of floating-point numbers, or its height is more
                    than `FAR` times that of the reference (one static deflection if larger)
stalled             no end within `MAX_EVENTS` steps or phases a mesh period, iterations without
                    rest, or steps below the spacing of numbers
right               the error is within the tolerance of the problem (where fractions are
                    compared: and both motions repeat, or neither does)
wrong attractor     orbit or fractions are compared, and the period differs, or height (over that
                    of the reference), bounces per period or a fraction by more than `SHARE`
invented motion     energy or deviation is compared, and is larger than that of the reference; or
                    the reference rests or repeats, and the height is more than `GROWTH` times its
missed event        the record has other contact events, or in another order (not where orbit or
                    fractions are compared: those have no events in common one by one)
inaccurate          none of these
==================  ===========================================================================
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gearlib import integrators
from gearlib.data import status
from gearlib.data.files import canonical_json
from gearlib.data.result import result_of_many, stacked
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.studies.trials.difficult_problems import problems

if TYPE_CHECKING:  # loaded by name, for `workflow.sources`
    from gearlib.integrators import scipy_ivp  # noqa: F401

#: From right to worse; their order is that of the flags in the matrix.
VERDICTS = (
    "right inaccurate missed_event wrong_attractor invented_motion diverged stalled refused"
).split()
#: Change of an orbit that makes it another one; all of its quantities are of order 1.
SHARE = 0.05
#: Height over that of a steady reference which the problem does not have.
GROWTH = 2.0
#: Height over that of the reference which no motion of the problem can have.
FAR = 1e3
#: Most steps or phases in one mesh period: more than any problem needs, few enough to end.
MAX_EVENTS = 30_000
#: Judge of the library's own solvers where the other one does not take the model.
SPLIT = ("scipy", {"solver": "DOP853", "rtol": 1e-13, "atol": 1e-13, "events": True})


class Outcome(NamedTuple):
    """The quantities of a run that the rules compare."""

    status: int
    state: tuple = (math.nan, math.nan)  #: at the end, coordinates and rates; no free rotation
    low: float = math.nan  #: extrema of the record
    high: float = math.nan
    fractions: tuple = (math.nan,) * 3  #: of time in normal mesh, backlash, inverse mesh
    bounces: float = math.nan  #: per mesh period
    period: int = 0  #: mesh periods after which the motion repeats; 0: it does not
    contacts: tuple = ()  #: contact codes (before, after) of every event; of trains mesh by mesh
    evaluations: int = 0

    @property
    def height(self):
        """Height of the recorded motion, static deflections."""
        return self.high - self.low


def outcome_of(run, model):
    """Return the `Outcome` of a result of `gearlib.simulate`; of trains, means over the meshes."""
    if int(run.status) != status.OK:
        return Outcome(int(run.status))
    contacts, state = [run.event_from.values, run.event_to.values], run.final_state.values
    if model.mesh_names:
        # What several meshes do at once has no order.
        order = np.argsort(run.event_mesh.values, kind="stable")
        contacts = [codes[order] for codes in (run.event_mesh.values, *contacts)]
        state = model.reduction()[0] @ state
    names = ("fraction_normal", "fraction_backlash", "fraction_inverse")
    return Outcome(
        status.OK,
        tuple(state),
        float(run.displacement_min.min()),
        float(run.displacement_max.max()),
        tuple(float(run[name].mean()) for name in names),
        float(run.bounces.mean()),
        int(run.period),
        tuple(zip(*(codes.tolist() for codes in contacts), strict=True)),
        int(run.evaluations),
    )


def _distance(tuning, state, other):
    """Return the distance of two states, velocities in units of displacements."""
    off, half = np.abs(np.subtract(state, other)), len(state) // 2
    return float(max(off[:half].max(), tuning * off[half:].max()))


def wrong_contacts(contacts, expected):
    """Return how many events are missing, spurious or out of order."""
    differing = sum(a != b for a, b in zip(contacts, expected, strict=False))
    return differing + abs(len(contacts) - len(expected))


def amount(problem, outcome):
    """Return energy or deviation, where one is compared: what a method must not make more of."""
    if problem.quantity == "energy":
        # Constant stiffness, the mean one: rest position 1, natural frequency 1 / nu.
        x, v = outcome.state
        return 0.5 * ((x - 1.0) ** 2 + (problem.tuning * v) ** 2)
    return _distance(problem.tuning, outcome.state, problem.orbit)


def error(problem, outcome, reference):
    """Return the error of a complete run in the quantity of its problem."""
    match problem.quantity:
        case "contacts":
            return float(wrong_contacts(outcome.contacts, reference.contacts))
        case "fractions":
            return float(np.abs(np.subtract(outcome.fractions, reference.fractions)).max())
        case "energy" | "deviation":
            expected = amount(problem, reference)
            return abs(amount(problem, outcome) - expected) / expected
        case "orbit":
            off = max(abs(outcome.low - reference.low), abs(outcome.high - reference.high))
            return off / reference.height
    off = _distance(problem.tuning, outcome.state, reference.state)
    return off / max(1.0, reference.height)


def _is_other_attractor(problem, outcome, reference):
    """Return whether settled motions differ in more than their digits."""
    # Motions that do not repeat have no height in common, only fractions.
    changes = [*np.abs(np.subtract(outcome.fractions, reference.fractions))]
    if problem.quantity == "orbit":
        changes.append(abs(outcome.bounces - reference.bounces))
        changes.append(abs(outcome.height - reference.height) / reference.height)
    return outcome.period != reference.period or max(changes) > SHARE


def _is_invented(problem, outcome, reference):
    """Return whether a motion is larger than its problem has one."""
    if problem.quantity in ("energy", "deviation"):
        return amount(problem, outcome) > amount(problem, reference)
    # A reference at rest has a period as well, with a height of rounding.
    steady = reference.period > 0
    return steady and outcome.height > GROWTH * max(reference.height, problem.tolerance)


def decide(problem, outcome, reference):
    """Return (verdict, error) of a run against its reference, by the rules of the module."""
    if outcome.status != status.OK:
        return "diverged" if outcome.status == status.OVERFLOW else "stalled", math.nan
    off, settles = error(problem, outcome, reference), problem.quantity in ("orbit", "fractions")
    repeats = (outcome.period == 0) == (reference.period == 0)
    if not outcome.height <= FAR * max(1.0, reference.height):
        return "diverged", off
    if off <= problem.tolerance and (repeats or problem.quantity != "fractions"):
        return "right", off
    if settles and _is_other_attractor(problem, outcome, reference):
        return "wrong_attractor", off
    if _is_invented(problem, outcome, reference):
        return "invented_motion", off
    if not settles and outcome.contacts != reference.contacts:
        return "missed_event", off
    return "inaccurate", off


def run(problem, method, options, periods, max_events=MAX_EVENTS):
    """Return the `Outcome` of a method on a problem."""
    result = simulate(
        problem.model,
        problem.tuning,
        periods=periods,
        record_periods=min(periods, problem.record_periods or periods),
        # Extrema of step methods are those of step ends and samples.
        samples_per_period=256 if problem.quantity == "orbit" else 1,
        initial_state=problem.state,
        method=method,
        options=options,
        max_events=max_events,
        until_settled=True,
    )
    return outcome_of(result, problem.model)


def judge_of(problem, method):
    """Return (method, options) of the reference for a method on a problem."""
    for judge in integrators.AUTOMATIC:
        if judge != method and integrators.METHODS[judge].takes(problem.model):
            return judge, {}
    return SPLIT


def try_method(problem, method, options):
    """Return the verdict on one method, its error and how it was found, by variable."""
    verdict, off, periods, evaluations, judge = "refused", math.nan, 0, 0, ""
    message = integrators.refusal(problem.model, method)
    if not message:
        # scipy's steps are interpreted: thousands of times slower than compiled ones.
        brief = problem.brief_periods if method == "scipy" else None
        periods, (judge, judge_options) = brief or problem.periods, judge_of(problem, method)
        outcome = run(problem, method, options, periods)
        # The judge has no such bound: whatever it needs, the problem needs.
        reference = run(problem, judge, judge_options, periods, 1_000_000)
        verdict, off = decide(problem, outcome, reference)
        evaluations, message = outcome.evaluations, status.MESSAGES[outcome.status]
    return {
        "verdict": np.int8(VERDICTS.index(verdict)),
        "error": off,
        "periods": np.int32(periods),
        "evaluations": np.int64(evaluations),
        "judge": judge,
        "message": message,
    }


def compute(name, method, options):
    """Return the verdicts of one method on all problems: a column of the matrix by its name."""
    known = problems()

    def description(key):
        problem = known[key]
        # The states of trains have as many components as they have coordinates and rates.
        x, v = problem.state if len(problem.state) == 2 else (math.nan, math.nan)
        return {
            "words": problem.words,
            "model": canonical_json(problem.model.as_dict()),
            "tuning": problem.tuning,
            "displacement": float(x),
            "velocity": float(v),
            "quantity": problem.quantity,
            "tolerance": problem.tolerance,
        }

    each = {"problem": list(known)}
    axes = each | {"trial": [name]}
    data = stacked(axes, lambda key, _: try_method(known[key], method, options))
    data |= stacked(each, description)
    data |= {
        "method": ("trial", np.array([method], dtype=object)),
        "options": ("trial", np.array([canonical_json(options)], dtype=object)),
    }
    title = "Verdicts on methods by difficult problems"
    dataset = result_of_many(title, data, axes, references=GearPair.references)
    dataset["verdict"].attrs |= status.flags_of(VERDICTS)
    return dataset
