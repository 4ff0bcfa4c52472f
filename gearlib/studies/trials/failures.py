"""Judge methods on difficult problems by rules.

The reference of a run is computed by the exact propagator if it supports the model, else by Taylor
steps. The references of these two methods are computed by the other one or, if that does not
support the model, by scipy's DOP853 with restarts at events and a tolerance of 1e-13. The first
rule that applies determines the verdict:

==================  ===========================================================================
verdict             rule
==================  ===========================================================================
refused             the method does not support the model
diverged            the motion left the range of floating-point numbers, or its height is more
                    than `DIVERGENCE_RATIO` times the height of the reference or one static
                    deflection, if that is larger
stalled             more than `MAX_EVENTS` steps or arcs in a mesh period, iterations that do not
                    converge, or steps below the spacing of floating-point numbers
right               the error is within the tolerance of the problem; if fractions are compared,
                    both motions repeat or neither does
wrong attractor     orbit or fractions are compared, and the period differs, or the relative
                    height, the bounces per period or a fraction differ by more than
                    `MIN_ATTRACTOR_CHANGE`
invented motion     energy or deviation is compared, and exceeds that of the reference; or the
                    reference rests or repeats, and the height is more than `MAX_GROWTH` times
                    the height of the reference
missed event        the record has other contact events or another order of events; not applied
                    if orbit or fractions are compared, as their motions differ event by event
inaccurate          none of these rules applies
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
from gearlib.data.result import evaluate_on_grid, make_study_result
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.studies.trials.difficult_problems import Problem, build_problems

#: Names of the verdicts; the index is the code.
VERDICTS = (
    "right inaccurate missed_event wrong_attractor invented_motion diverged stalled refused"
).split()
#: Orbits whose relative difference exceeds this value are different attractors.
MIN_ATTRACTOR_CHANGE = 0.05
#: A motion is spurious if its height exceeds the height of a steady reference by this factor.
MAX_GROWTH = 2.0
#: A motion has diverged if its height exceeds the height of the reference by this factor.
DIVERGENCE_RATIO = 1e3
#: Maximum number of steps or arcs per mesh period, more than any problem needs.
MAX_EVENTS = 30_000
#: Reference method and options for models that only one accurate method supports.
SPLIT_REFERENCE = ("scipy", {"solver": "DOP853", "rtol": 1e-13, "atol": 1e-13, "events": True})


class Outcome(NamedTuple):
    """The quantities of a run to which the rules apply; NaN if the run stopped early."""

    status: int
    state: tuple = (math.nan, math.nan)  #: final state without rigid-body rotation
    low: float = math.nan  #: smallest recorded displacement
    high: float = math.nan  #: largest recorded displacement
    #: Fractions of time in drive-side contact, without contact, in coast-side contact.
    fractions: tuple = (math.nan, math.nan, math.nan)
    bounces: float = math.nan  #: per mesh period
    period: int = 0  #: mesh periods after which the motion repeats; 0: not periodic
    contacts: tuple = ()  #: contact states (before, after) of events; sorted by mesh for trains
    evaluations: int = 0

    @property
    def height(self):
        """Return the peak-to-peak displacement of the recorded motion, in static deflections."""
        return self.high - self.low


def extract_outcome(run: xr.Dataset, model: Any) -> Outcome:
    """Extract the `Outcome`, the quantities to be compared, from a result of `gearlib.simulate`.

    `model` is the simulated model. Fractions of time and bounces of gear trains are means over the
    meshes. If the run stopped early, the outcome only has a status.
    """
    if int(run.status) != status.OK:
        return Outcome(int(run.status))
    contacts = [run.event_from.values, run.event_to.values]
    state = run.final_state.values
    if model.mesh_names:
        # Simultaneous events of several meshes have no order in time.
        order = np.argsort(run.event_mesh.values, kind="stable")
        contacts = [codes[order] for codes in (run.event_mesh.values, *contacts)]
        state = model.reduction()[0] @ state  # without rigid-body rotation
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


def _state_distance(tuning: float, state: ArrayLike, other: ArrayLike) -> float:
    """Return the maximum difference of two states over all coordinates.

    States are displacements followed by velocities (derivatives with respect to the mesh phase).
    Velocity differences are scaled by the tuning (mesh frequency over natural frequency).
    """
    difference = np.abs(np.subtract(state, other))
    displacements, velocities = np.split(difference, 2)
    return float(max(displacements.max(), tuning * velocities.max()))


def count_wrong_contacts(contacts: Sequence, expected: Sequence) -> int:
    """Count the contact events that are missing, spurious or out of order.

    Both arguments are sequences of events (contact state before, contact state after).
    """
    differing = sum(a != b for a, b in zip(contacts, expected, strict=False))
    return differing + abs(len(contacts) - len(expected))


def energy_or_deviation(problem: Problem, outcome: Outcome) -> float:
    """Return the energy of the final state, or its deviation from the orbit without contact loss.

    `problem.quantity` selects the quantity, "energy" or "deviation".
    """
    if problem.quantity == "energy":
        # The stiffness is constant, with equilibrium at 1 and the natural frequency 1 / tuning.
        displacement, velocity = outcome.state
        return 0.5 * ((displacement - 1.0) ** 2 + (problem.tuning * velocity) ** 2)
    return _state_distance(problem.tuning, outcome.state, problem.orbit)


def compute_error(problem: Problem, outcome: Outcome, reference: Outcome) -> float:
    """Return the error of a completed run in the quantity that the problem compares.

    `outcome` is the result of the method under test, and `reference` the accurate result.
    `problem.quantity` is "contacts", "fractions", "energy", "deviation", "orbit" (extrema) or
    "state".
    """
    match problem.quantity:
        case "contacts":
            return float(count_wrong_contacts(outcome.contacts, reference.contacts))
        case "fractions":
            return float(np.abs(np.subtract(outcome.fractions, reference.fractions)).max())
        case "energy" | "deviation":
            expected = energy_or_deviation(problem, reference)
            return abs(energy_or_deviation(problem, outcome) - expected) / expected
        case "orbit":
            differences = outcome.low - reference.low, outcome.high - reference.high
            return max(map(abs, differences)) / reference.height
    # The remaining quantity is "state".
    distance = _state_distance(problem.tuning, outcome.state, reference.state)
    return distance / max(1.0, reference.height)


def _is_other_attractor(problem: Problem, outcome: Outcome, reference: Outcome) -> bool:
    """Return whether a run has settled on a different motion than the reference.

    On a different motion, the period differs, or fractions of time, bounces or the relative height
    differ by more than `MIN_ATTRACTOR_CHANGE`.
    """
    # Chaotic motions can only be compared by fractions of time.
    changes = [*np.abs(np.subtract(outcome.fractions, reference.fractions))]
    if problem.quantity == "orbit":
        changes.append(abs(outcome.bounces - reference.bounces))
        changes.append(abs(outcome.height - reference.height) / reference.height)
    return outcome.period != reference.period or max(changes) > MIN_ATTRACTOR_CHANGE


def _is_spurious(problem: Problem, outcome: Outcome, reference: Outcome) -> bool:
    """Return whether a motion is larger than is physically possible.

    If energy or deviation is compared, it must not exceed the reference. Otherwise the height of
    the motion must not exceed that of a steady reference by the factor `MAX_GROWTH`.
    """
    if problem.quantity in ("energy", "deviation"):
        upper_limit = energy_or_deviation(problem, reference)
        return energy_or_deviation(problem, outcome) > upper_limit
    # A reference at rest has a period, too, and its height consists of rounding errors.
    is_steady = reference.period > 0
    return is_steady and outcome.height > MAX_GROWTH * max(reference.height, problem.tolerance)


def classify_run(problem: Problem, outcome: Outcome, reference: Outcome) -> tuple[str, float]:
    """Return the verdict on a run by the first rule that applies, and the error of the run.

    `outcome` is the result of the method under test, and `reference` the accurate result. The
    verdict is "right" if the error is within the tolerance of the problem, else the kind of
    failure, such as "missed_event". The error is NaN if the run stopped early.
    """
    if outcome.status != status.OK:
        return "diverged" if outcome.status == status.OVERFLOW else "stalled", math.nan
    run_error = compute_error(problem, outcome, reference)
    settles = problem.quantity in ("orbit", "fractions")
    both_or_none_repeat = (outcome.period == 0) == (reference.period == 0)
    # This condition is also true for NaN.
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


def run_method(
    problem: Problem, method: str, options: dict, periods: int, max_events: int = MAX_EVENTS
) -> Outcome:
    """Run a method with options on a problem over a number of mesh periods; return its `Outcome`.

    The run stops early if it exceeds `max_events` steps, or arcs between events, per mesh period.
    """
    result = simulate(
        problem.model,
        problem.tuning,
        periods=periods,
        record_periods=min(periods, problem.record_periods or periods),
        # Step methods evaluate extrema only at steps and samples, so many samples are needed.
        samples_per_period=256 if problem.quantity == "orbit" else 1,
        initial_state=problem.state,
        method=method,
        options=options,
        max_events=max_events,
        until_settled=True,
    )
    return extract_outcome(result, problem.model)


def choose_reference_method(problem: Problem, method: str) -> tuple[str, dict]:
    """Return the name and the options of the reference method for `method` on a problem.

    The reference method is the first automatic method of the library, other than `method`, that
    supports the model. If there is none, it is a solver of scipy with restarts at events.
    """
    for reference_name in integrators.AUTOMATIC:
        if reference_name != method and integrators.METHODS[reference_name].supports(problem.model):
            return reference_name, {}
    return SPLIT_REFERENCE


def judge_run(problem: Problem, method: str, options: dict) -> dict:
    """Run a method with these options on a problem; return verdict, error and further data.

    The dict has the keys verdict (index in `VERDICTS`), error in the quantity that the problem
    compares, periods of the run, evaluations of the right-hand side, judge (name of the reference
    method), and message, which states why the run stopped early or why the method does not support
    the model.
    """
    verdict, run_error, periods, evaluations, reference_name = "refused", math.nan, 0, 0, ""
    message = integrators.reason_unsupported(problem.model, method)
    if not message:
        # scipy is thousands of times slower, because its right-hand side is interpreted.
        short_periods = problem.short_periods if method == "scipy" else None
        periods = short_periods or problem.periods
        reference_name, reference_options = choose_reference_method(problem, method)
        outcome = run_method(problem, method, options, periods)
        # The reference must never reach the limit on arcs.
        reference = run_method(
            problem, reference_name, reference_options, periods, max_events=1_000_000
        )
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

    `method` is a name of `gearlib.methods`. The dataset has the dimensions problem and trial (a
    method with options). It has a single trial, labelled `name`, so that datasets of several
    methods can be concatenated.
    """
    problems_by_name = build_problems()

    def problem_variables(problem_name: str) -> dict:
        """Return the variables that define a problem; "words" is its label in the figure."""
        problem = problems_by_name[problem_name]
        displacement = velocity = math.nan
        if len(problem.state) == 2:  # longer states of gear trains are not stored
            displacement, velocity = problem.state
        return {
            "words": problem.description,
            "model": canonical_json(problem.model.as_dict()),
            "tuning": problem.tuning,
            "displacement": float(displacement),
            "velocity": float(velocity),
            "quantity": problem.quantity,
            "tolerance": problem.tolerance,
        }

    def verdict_variables(problem_name: str, trial: str) -> dict:
        """Return verdict, error and cost on a problem; `trial` is always `name`."""
        return judge_run(problems_by_name[problem_name], method, options)

    problem_axis = {"problem": list(problems_by_name)}
    axes = problem_axis | {"trial": [name]}
    data = evaluate_on_grid(axes, verdict_variables)
    data |= evaluate_on_grid(problem_axis, problem_variables)
    texts = {"method": method, "options": canonical_json(options)}
    data |= {key: ("trial", np.array([text], dtype=object)) for key, text in texts.items()}
    title = "Verdicts on methods by difficult problems"
    dataset = make_study_result(title, data, axes, references=GearPair.references)
    dataset["verdict"].attrs |= status.flag_attributes(VERDICTS)
    return dataset
