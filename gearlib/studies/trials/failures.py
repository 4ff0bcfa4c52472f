"""Judge methods on difficult problems by rules.

The reference of a run is the exact propagator if it can run the model, else Taylor steps. These
two are compared with each other; if only one of them can run the model, its reference is scipy's
DOP853, restarted at events, with a tolerance of 1e-13. The first rule that applies gives the
verdict:

==================  ===========================================================================
verdict             rule
==================  ===========================================================================
refused             the method cannot run the model
diverged            the motion left the range of floating-point numbers, or its height is more
                    than `DIVERGENCE_RATIO` times that of the reference (or times one static
                    deflection, if this is larger)
stalled             no end within `MAX_EVENTS` steps or phases a mesh period, iterations without
                    rest, or steps below the spacing of numbers
right               the error is within the tolerance of the problem (where fractions are
                    compared: and both motions repeat, or neither does)
wrong attractor     orbit or fractions are compared, and the period differs, or height (over that
                    of the reference), bounces per period or a fraction by more than
                    `MIN_ATTRACTOR_CHANGE`
invented motion     energy or deviation is compared, and is larger than that of the reference; or
                    the reference rests or repeats, and the height is more than `MAX_GROWTH`
                    times that of the reference
missed event        the record has other contact events, or in another order (not where orbit or
                    fractions are compared: those have no events in common one by one)
inaccurate          none of these
==================  ===========================================================================
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from gearlib import integrators
from gearlib.data import status
from gearlib.data.files import canonical_json
from gearlib.data.result import result_of_many, stacked
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.studies.trials.difficult_problems import Problem, problems

#: Names of the verdicts in the order of their codes.
VERDICTS = (
    "right inaccurate missed_event wrong_attractor invented_motion diverged stalled refused"
).split()
#: Orbits with larger relative differences are different attractors.
MIN_ATTRACTOR_CHANGE = 0.05
#: A motion whose height exceeds that of a steady reference by this factor is invented.
MAX_GROWTH = 2.0
#: A motion whose height exceeds that of the reference by this factor has diverged.
DIVERGENCE_RATIO = 1e3
#: Limit on steps or arcs per mesh period: more than any problem needs.
MAX_EVENTS = 30_000
#: Reference method and options for models that only one solver of the library can run.
SPLIT_REFERENCE = ("scipy", {"solver": "DOP853", "rtol": 1e-13, "atol": 1e-13, "events": True})


class Outcome(NamedTuple):
    """The quantities of a run that the rules compare."""

    status: int
    state: tuple = (math.nan, math.nan)  #: final coordinates and velocities, no free rotation
    low: float = math.nan  #: smallest recorded displacement
    high: float = math.nan  #: largest recorded displacement
    fractions: tuple = (
        math.nan,
    ) * 3  #: of time in drive-side contact, no contact, coast-side contact
    bounces: float = math.nan  #: per mesh period
    period: int = 0  #: mesh periods after which the motion repeats; 0: it does not
    contacts: tuple = ()  #: contact codes (before, after) of every event; of trains mesh by mesh
    evaluations: int = 0

    @property
    def height(self):
        """Height of the recorded motion, static deflections."""
        return self.high - self.low


def outcome_of(run: xr.Dataset, model: Any) -> Outcome:
    """Return the `Outcome` of a result of `gearlib.simulate`.

    Fractions and bounces of gear trains are means over the meshes.
    """
    if int(run.status) != status.OK:
        return Outcome(int(run.status))
    contacts, state = [run.event_from.values, run.event_to.values], run.final_state.values
    if model.mesh_names:
        # Simultaneous events of several meshes have no order in time.
        order = np.argsort(run.event_mesh.values, kind="stable")
        contacts = [codes[order] for codes in (run.event_mesh.values, *contacts)]
        state = model.reduction()[0] @ state
    names = ("fraction_drive", "contact_loss_fraction", "fraction_coast")
    return Outcome(
        status=status.OK,
        state=tuple(state),
        low=float(run.displacement_min.min()),
        high=float(run.displacement_max.max()),
        fractions=tuple(float(run[name].mean()) for name in names),
        bounces=float(run.bounces.mean()),
        period=int(run.period),
        contacts=tuple(zip(*(codes.tolist() for codes in contacts), strict=True)),
        evaluations=int(run.evaluations),
    )


def _distance(tuning: float, state: ArrayLike, other: ArrayLike) -> float:
    """Return the largest difference of two states, whose velocities are scaled by the tuning."""
    difference = np.abs(np.subtract(state, other))
    displacements, velocities = np.split(difference, 2)
    return float(max(displacements.max(), tuning * velocities.max()))


def wrong_contacts(contacts: Sequence, expected: Sequence) -> int:
    """Return the number of contact events that are missing, spurious or out of order."""
    differing = sum(a != b for a, b in zip(contacts, expected, strict=False))
    return differing + abs(len(contacts) - len(expected))


def energy_or_deviation(problem: Problem, outcome: Outcome) -> float:
    """Return the energy, or the distance from the orbit without contact loss.

    A method must not increase the one that its problem compares.
    """
    if problem.quantity == "energy":
        # The stiffness is constant: equilibrium is at 1, the natural frequency is 1 / nu.
        x, v = outcome.state
        return 0.5 * ((x - 1.0) ** 2 + (problem.tuning * v) ** 2)
    return _distance(problem.tuning, outcome.state, problem.orbit)


def error(problem: Problem, outcome: Outcome, reference: Outcome) -> float:
    """Return the error of a completed run in the quantity that its problem compares."""
    match problem.quantity:
        case "contacts":
            return float(wrong_contacts(outcome.contacts, reference.contacts))
        case "fractions":
            return float(np.abs(np.subtract(outcome.fractions, reference.fractions)).max())
        case "energy" | "deviation":
            expected = energy_or_deviation(problem, reference)
            return abs(energy_or_deviation(problem, outcome) - expected) / expected
        case "orbit":
            differences = outcome.low - reference.low, outcome.high - reference.high
            return max(map(abs, differences)) / reference.height
    distance = _distance(problem.tuning, outcome.state, reference.state)
    return distance / max(1.0, reference.height)


def _is_other_attractor(problem: Problem, outcome: Outcome, reference: Outcome) -> bool:
    """Return whether a run has settled on another motion than the reference."""
    # For motions that do not repeat, only fractions of time can be compared.
    changes = [*np.abs(np.subtract(outcome.fractions, reference.fractions))]
    if problem.quantity == "orbit":
        changes.append(abs(outcome.bounces - reference.bounces))
        changes.append(abs(outcome.height - reference.height) / reference.height)
    return outcome.period != reference.period or max(changes) > MIN_ATTRACTOR_CHANGE


def _is_spurious(problem: Problem, outcome: Outcome, reference: Outcome) -> bool:
    """Return whether a motion is larger than possible, which only errors of a method can cause."""
    if problem.quantity in ("energy", "deviation"):
        largest = energy_or_deviation(problem, reference)
        return energy_or_deviation(problem, outcome) > largest
    # A reference at rest also has a period, and a height of rounding errors.
    is_steady = reference.period > 0
    return is_steady and outcome.height > MAX_GROWTH * max(reference.height, problem.tolerance)


def classify_run(problem: Problem, outcome: Outcome, reference: Outcome) -> tuple[str, float]:
    """Return the verdict on a run by the first rule that applies, and the error of the run.

    The verdict is "right" if the error is within the tolerance of the problem, else a failure, such
    as "invented_motion" (larger than possible). The error is NaN if the run stopped early.
    """
    if outcome.status != status.OK:
        return "diverged" if outcome.status == status.OVERFLOW else "stalled", math.nan
    run_error = error(problem, outcome, reference)
    settles = problem.quantity in ("orbit", "fractions")
    both_or_none_repeat = (outcome.period == 0) == (reference.period == 0)
    if not outcome.height <= DIVERGENCE_RATIO * max(1.0, reference.height):
        return "diverged", run_error
    if run_error <= problem.tolerance and (both_or_none_repeat or problem.quantity != "fractions"):
        return "right", run_error
    if settles and _is_other_attractor(problem, outcome, reference):
        return "wrong_attractor", run_error
    if _is_spurious(problem, outcome, reference):
        return "invented_motion", run_error
    if not settles and outcome.contacts != reference.contacts:
        return "missed_event", run_error
    return "inaccurate", run_error


def run(
    problem: Problem, method: str, options: dict, periods: int, max_events: int = MAX_EVENTS
) -> Outcome:
    """Return the outcome of a method on a problem over a number of mesh periods.

    `max_events` limits the steps or arcs per mesh period.
    """
    result = simulate(
        problem.model,
        problem.tuning,
        periods=periods,
        record_periods=min(periods, problem.record_periods or periods),
        # Step methods find extrema only at the ends of steps and at samples.
        samples_per_period=256 if problem.quantity == "orbit" else 1,
        initial_state=problem.state,
        method=method,
        options=options,
        max_events=max_events,
        until_settled=True,
    )
    return outcome_of(result, problem.model)


def reference_method(problem: Problem, method: str) -> tuple[str, dict]:
    """Return name and options of the method that is the reference for `method` on a problem."""
    for reference_name in integrators.AUTOMATIC:
        if reference_name != method and integrators.METHODS[reference_name].supports(problem.model):
            return reference_name, {}
    return SPLIT_REFERENCE


def try_method(problem: Problem, method: str, options: dict) -> dict:
    """Run a method with these options on a problem; return the verdict, the error and further data.

    The dict has the variables of the dataset: verdict (index in `VERDICTS`), error in the quantity
    that the problem compares, evaluations of the right-hand side, judge (name of the method of the
    reference run), and message, which says why a run stopped early or, for the verdict "refused",
    why the method does not support the model.
    """
    verdict, run_error, periods, evaluations, reference_name = "refused", math.nan, 0, 0, ""
    message = integrators.reason_unsupported(problem.model, method)
    if not message:
        # Interpreted steps of scipy are thousands of times slower than compiled steps.
        short_periods = problem.short_periods if method == "scipy" else None
        periods = short_periods or problem.periods
        reference_name, reference_options = reference_method(problem, method)
        outcome = run(problem, method, options, periods)
        # The reference is practically not limited in its number of arcs.
        reference = run(problem, reference_name, reference_options, periods, max_events=1_000_000)
        verdict, run_error = classify_run(problem, outcome, reference)
        evaluations, message = outcome.evaluations, status.MESSAGES[outcome.status]
    return {
        "verdict": np.int8(VERDICTS.index(verdict)),
        "error": run_error,
        "periods": np.int32(periods),
        "evaluations": np.int64(evaluations),
        "judge": reference_name,
        "message": message,
    }


def judge_method(name: str, method: str, options: dict) -> xr.Dataset:
    """Run a method with these options on all difficult problems, and judge every run.

    The dataset has the dimensions problem and trial. A trial is a method with options; here there
    is only one, and `name` is its label in figures and tables that compare several.
    """
    problems_by_name = problems()

    def problem_variables(problem_name: str) -> dict:
        """Return the variables that define a problem; "words" is its description in the figure."""
        problem = problems_by_name[problem_name]
        # States of gear trains have more than two components and are not stored.
        x, v = problem.state if len(problem.state) == 2 else (math.nan, math.nan)
        return {
            "words": problem.description,
            "model": canonical_json(problem.model.as_dict()),
            "tuning": problem.tuning,
            "displacement": float(x),
            "velocity": float(v),
            "quantity": problem.quantity,
            "tolerance": problem.tolerance,
        }

    problem_axis = {"problem": list(problems_by_name)}
    axes = problem_axis | {"trial": [name]}
    data = stacked(axes, lambda key, _: try_method(problems_by_name[key], method, options))
    data |= stacked(problem_axis, problem_variables)
    texts = {"method": method, "options": canonical_json(options)}
    data |= {key: ("trial", np.array([text], dtype=object)) for key, text in texts.items()}
    title = "Verdicts on methods by difficult problems"
    dataset = result_of_many(title, data, axes, references=GearPair.references)
    dataset["verdict"].attrs |= status.flags_of(VERDICTS)
    return dataset
