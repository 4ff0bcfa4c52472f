"""Periodic orbits and their Floquet multipliers by shooting over n mesh periods.

An orbit of period n is a fixed point of the Poincaré map over n mesh periods. Newton's method uses
the exact Jacobian matrix of this map, the monodromy matrix, from the variational equations with
saltation matrices at contact events. Stable and unstable orbits are therefore accurate to rounding
error. Derivatives with respect to a parameter are central differences, which affect only the rate
of convergence.

At a grazing the one-sided derivatives differ: an orbit that touches a flank line is marked as
grazing, and its multipliers are valid only on one side of the grazing.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
import xarray as xr
from annotated_types import Ge, Le
from scipy.linalg import block_diag

from gearlib import checks
from gearlib.analysis.orbits.tracing import ContinuationFailed, difference_quotient, with_parameter
from gearlib.data import status
from gearlib.data.motions import as_float_array
from gearlib.data.result import make_result
from gearlib.data.status import CONTACT_FLAGS
from gearlib.engines import orbit as columns
from gearlib.integrators import choose_method
from gearlib.parameters import INTEGER, Count, checked
from gearlib.runs.run_arguments import MAX_EVENTS, Tuning

#: Largest residual of an orbit, as returned by `scaled_norm`.
MAX_RESIDUAL = 1e-12
#: Number of mesh periods of the motion from rest whose final state is the default guess.
_TRANSIENT_PERIODS = 400
_MAX_NEWTON_STEPS, _MAX_HALVINGS = 60, 12
#: Largest number of mesh periods of an orbit, to limit memory, and of a shooting segment.
MAX_PERIODS, _MAX_SEGMENT_PERIODS = 100_000, 32
#: Tolerance of the modulus of a multiplier on the unit circle. The error of a double multiplier is
#: the square root of the machine precision.
_CIRCLE_TOLERANCE = 1e-7
#: Largest distance between two states that are a shorter period apart at which this period is
#: tried, and largest distance between equal orbits, in units of the static deflection.
_SHORTER_PERIOD_TOLERANCE, _SAME_ORBIT_TOLERANCE = 1e-6, 1e-9
#: Distance from a flank line at which an orbit touches it, relative to the displacement range.
_TOUCH_TOLERANCE = 1e-9


class NoOrbit(RuntimeError):
    """Newton's method did not find an orbit; the message says what to try."""


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit."""

    model: object  #: the model
    tuning: float
    period: int  #: smallest period of the orbit, in mesh periods
    state: np.ndarray  #: full state at tau = 0, shape (n,)
    residual: float  #: largest difference between initial and final state, see `scaled_norm`
    multipliers: np.ndarray  #: Floquet multipliers over the period, complex, largest first
    pattern: tuple  #: sequence of contact states from tau = 0
    grazing: bool  #: whether it touches a flank line, so that its multipliers are one-sided

    @property
    def stable(self) -> bool:
        """Whether no Floquet multiplier lies outside the unit circle."""
        return is_stable(self.multipliers)

    def dataset(self) -> xr.Dataset:
        """Return the orbit as a dataset: state, multipliers, stability and contact pattern.

        The contact pattern is the sequence of contact states (1 drive side, 0 none, -1 coast side);
        the residual is the norm of final minus initial state, in units of the static deflection.
        """
        data = {
            "state": ("coordinate", self.state),
            "multiplier_real": ("multiplier", self.multipliers.real),
            "multiplier_imaginary": ("multiplier", self.multipliers.imag),
            # Each interval between two contact events has one contact state.
            "pattern": ("contact_phase", np.array(self.pattern, np.int8)),
            "stable": np.int8(self.stable),
            "grazing": np.int8(self.grazing),
            "residual": self.residual,
            "period": np.int32(self.period),
            "tuning": self.tuning,
        }
        title = "Periodic orbit of a gear mesh"
        dataset = make_result(title, self.model, data, method="shooting", tuning=self.tuning)
        dataset["pattern"].attrs |= CONTACT_FLAGS
        return dataset


def check_orbit(orbit: Any) -> None:
    """Raise ValueError unless the argument `orbit` is an `Orbit`."""
    checks.require(isinstance(orbit, Orbit), "orbit", orbit, "an Orbit")


@checked
def periodic_orbit(
    model,
    tuning: Tuning,
    *,
    guess=None,
    period: Annotated[int, Ge(1), Le(MAX_PERIODS), INTEGER] = 1,
    max_events: Count = MAX_EVENTS,
):
    """Find a periodic orbit near an initial guess by shooting (Newton's method).

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
        The model.
    tuning : float
        Mesh frequency over mean eigenfrequency.
    guess : array_like of float, shape (2,) or (n,), optional
        Displacement and dx/dtau at tau = 0, or a full state. By default the state that the motion
        from rest reaches after 400 mesh periods.
    period : int, default 1
        Number of mesh periods after which the orbit repeats; with run-out it must be a multiple of
        the run-out period. The result has the smallest period of the orbit, which may be shorter.
    max_events : int
        Largest number of contact events in one mesh period.

    Returns
    -------
    Orbit

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.
    NoOrbit
        If there is no orbit near the guess; the message says what to try.
    """
    choose_method(model, None, None)  # raises ValueError if `model` is not a model
    repeats = model.repeats
    allowed = f"a multiple of the {repeats} mesh periods after which the excitation repeats"
    checks.require(period % repeats == 0, "period", period, allowed)
    problem = Shooting(model, tuning, period, max_events=max_events)
    try:
        solution = _newton(problem, problem.initial_unknowns(_initial_state(problem, guess)))
    except ContinuationFailed as error:
        raise NoOrbit(str(error)) from None
    if not solution.converged:
        raise NoOrbit(
            f"no orbit of period {period} was found near the guess at tuning = {tuning!r}, the "
            f"best residual is {solution.residual_norm:.2g}: try a closer guess or another period"
        )
    return _orbit_of_shorter_period(solution) or as_orbit(solution)


def _orbit_of_shorter_period(solution: "Evaluation") -> Orbit | None:
    """Return the orbit if it already repeats after a shorter period, else None.

    `solution` solves the shooting equation over `solution.problem.period` mesh periods. The periods
    tried are divisors of this number that are multiples of the period of the excitation,
    `model.repeats`.
    """
    problem, state = solution.problem, solution.state
    model, tuning, max_events = problem.model, problem.tuning, problem.max_events
    propagator, period = problem.propagator(model, tuning), problem.period
    for shorter_period in range(model.repeats, period, model.repeats):
        if period % shorter_period:
            continue
        # The state after the shorter period must be close to the initial state.
        final_state, _, code = propagator.maps(state, shorter_period, max_events)
        if code != status.OK or problem.distance(final_state, state) > _SHORTER_PERIOD_TOLERANCE:
            continue
        try:
            orbit = periodic_orbit(
                model, tuning, guess=state, period=shorter_period, max_events=max_events
            )
        except NoOrbit:
            continue
        # Near a period doubling Newton's method may converge to another orbit of half the period.
        if problem.distance(orbit.state, state) <= _SAME_ORBIT_TOLERANCE:
            return orbit
    return None


class Shooting:
    """Shooting equation for periodic orbits; the unknowns are states and parameters of a model.

    Unknowns are scaled: divided by their `units`. Multiple shooting divides a long period into
    segments, each with its own initial state, to limit the growth of errors along an unstable
    orbit; with unknown parameters there is only one segment. The rigid-body rotation of a train,
    which no force opposes, is not an unknown: a reduced state is a full state without this
    rotation.
    """

    def __init__(
        self, model: Any, tuning, period, names=(), parameter_units=(), max_events=MAX_EVENTS
    ):
        """Set up the equation for orbits that repeat after `period` mesh periods.

        `tuning` is mesh frequency over mean natural frequency. `names` are the model parameters (or
        "tuning") that are unknown in addition to the initial state, and `parameter_units` are their
        scales: the change of a parameter that counts like a displacement of one static deflection.
        A mesh period may have at most `max_events` contact events.
        """
        self.model, self.tuning, self.period = model, tuning, period
        self.names, self.max_events = names, max_events
        self._propagator: Any = None
        #: Matrices from full to reduced states, shape (n, full size), and vice versa.
        self.reduction, self.lift = model.reduction()
        n = len(self.reduction)
        # -(-a // b) rounds the quotient a / b up.
        segment_count = 1 if names else -(-period // _MAX_SEGMENT_PERIODS)
        #: Mesh periods at which the segments start, followed by the end of the last one.
        self.segment_bounds = [period * i // segment_count for i in range(segment_count + 1)]
        #: Rigid-body rotations in the initial states of the segments, shape (segments, full size),
        #: or 0.
        self.rigid_rotations: Any = 0.0
        #: Index of the next segment (cyclic), and the permutation matrix from the initial states of
        #: all segments to the initial states of their next segments.
        self.next_segments = np.arange(1, segment_count + 1) % segment_count
        size = segment_count * n
        self.permutation = np.eye(size)[(np.arange(size) + n) % size]
        # The unit 1 / tuning makes velocities dx/dtau comparable with displacements.
        state_units = ([1.0] * (n // 2) + [1.0 / tuning] * (n // 2)) * segment_count
        #: Scale of each unknown.
        self.units = np.array([*state_units, *parameter_units])

    def unknowns(self, state: np.ndarray, parameter_values: Any) -> np.ndarray:
        """Return the scaled unknowns for a full state and the values of the unknown parameters."""
        return np.append(self.reduction @ state, parameter_values) / self.units

    def initial_unknowns(self, state: np.ndarray) -> np.ndarray:
        """Return the scaled unknowns of the motion that starts from a full state at tau = 0.

        They are the initial states of all shooting segments, without the rigid-body rotation of a
        train. The rotations are stored in `self.rigid_rotations`, shape (segments, full size),
        because `unpack` adds them again.
        """
        propagator = self.propagator(self.model, self.tuning)
        states = [state]
        for start, stop in pairwise(self.segment_bounds[:-1]):
            final_state, _ = self._propagate(propagator, states[-1], start, stop)
            states.append(final_state)
        full_states = np.array(states)
        reduced_states = full_states @ self.reduction.T
        self.rigid_rotations = full_states - reduced_states @ self.lift.T
        return reduced_states.ravel() / self.units

    def unpack(self, unknowns: np.ndarray) -> tuple:
        """Return (model, tuning, full initial states of the segments) for scaled unknowns.

        The unknowns are the reduced initial states of all shooting segments, then the unknown
        parameters, whose values the returned model and tuning have. The states have shape
        (segments, full size). Raise ValueError if the model does not allow a value.
        """
        values = unknowns * self.units
        model, tuning = self.model, self.tuning
        n = self.units.size - len(self.names)
        for name, value in zip(self.names, values[n:], strict=True):
            model, tuning = with_parameter(model, tuning, name, float(value))
        states = values[:n].reshape(-1, len(self.reduction)) @ self.lift.T
        return model, tuning, states + self.rigid_rotations

    def propagator(self, model: Any, tuning: float) -> Any:
        """Return the propagator (integrator of the equations of motion) of a model at a tuning.

        If the model is the same object as in the previous call, tables of its propagator are
        reused.
        """
        previous = self._propagator
        if previous is None or previous.model is not model:
            self._propagator = model.propagator(tuning)
        elif previous.tuning != tuning:
            self._propagator = previous.at(tuning)
        return self._propagator

    def _propagate(self, propagator: Any, state: np.ndarray, start: int, stop: int) -> tuple:
        """Propagate a full state; return (final state, transition matrix of each mesh period).

        The motion lasts from the start of mesh period `start` to the start of mesh period `stop`.
        Raise ContinuationFailed if the run fails, e.g. with too many contact events.
        """
        # The excitation repeats after `model.repeats` mesh periods.
        first_period = start % self.model.repeats
        final_state, transition_matrices, status_code = propagator.maps(
            state, stop - start, self.max_events, first_period
        )
        if status_code != status.OK:
            raise ContinuationFailed(f"the simulation failed: {status.MESSAGES[status_code]}")
        return final_state, transition_matrices

    def run(self, unknowns: np.ndarray) -> tuple:
        """Run all segments; return (tuning, initial states, final states, transition matrices).

        `unknowns` are the scaled unknowns. The states are full states, shape (segments, n). For
        each segment there is a list of transition matrices, the derivatives of the final with
        respect to the initial state, shape (n, n), of its mesh periods.
        """
        model, tuning, states = self.unpack(unknowns)
        propagator = self.propagator(model, tuning)
        transition_matrices, final_states = [], np.empty_like(states)
        for i, state in enumerate(states):
            start, stop = self.segment_bounds[i], self.segment_bounds[i + 1]
            final_states[i], segment_matrices = self._propagate(propagator, state, start, stop)
            transition_matrices.append(segment_matrices)
        return tuning, states, final_states, transition_matrices

    def record(self, unknowns: np.ndarray, periods: int, samples: int = 0) -> tuple:
        """Return (model, `Record` of the motion over a number of mesh periods) for scaled unknowns.

        The model has the values of the unknown parameters; the motion starts at the initial state
        of the first segment. `samples` is the number of samples per mesh period.
        """
        model, tuning, states = self.unpack(unknowns)
        propagator = self.propagator(model, tuning)
        return model, propagator.record(states[0], periods, self.max_events, samples)

    def evaluate(self, unknowns: np.ndarray) -> "Evaluation":
        """Evaluate the residuals and derivatives of the shooting equation at scaled unknowns.

        Raise ValueError if a parameter value is invalid, ContinuationFailed if the run fails.
        """
        return Evaluation(self, unknowns)

    def distance(self, state: np.ndarray, other_state: np.ndarray) -> float:
        """Return the distance between two full states up to a rigid-body rotation.

        It is the largest difference of a displacement or scaled velocity, in units of the static
        deflection.
        """
        return scaled_norm(self.reduction @ (state - other_state), other_state, self.tuning)


class Evaluation:
    """Shooting equation evaluated at scaled unknowns: residuals and their derivatives."""

    def __init__(self, problem: Shooting, unknowns: np.ndarray):
        """Run all segments and compute the residuals: final states minus the next initial states.

        The last segment is followed by the first one, because the orbit is periodic. `unknowns` are
        the scaled unknowns of the `problem`.
        """
        self.problem, self.unknowns = problem, unknowns
        tuning, states, final_states, transition_matrices = problem.run(unknowns)
        next_states = states if len(states) == 1 else states[problem.next_segments]
        differences = (final_states - next_states) @ problem.reduction.T
        self.state = states[0]  #: full state at tau = 0
        #: Transition matrix of each segment for reduced states.
        self.transition_matrices = [
            problem.reduction @ compose(segment_matrices) @ problem.lift
            for segment_matrices in transition_matrices
        ]
        self.residuals = differences.ravel() / problem.units[: differences.size]  #: shape (n,)
        self.residual_norm = scaled_norm(differences, states, tuning)
        self.converged = self.residual_norm <= MAX_RESIDUAL

    @cached_property
    def monodromy(self) -> np.ndarray:
        """Monodromy matrix: the transition matrix of reduced states over the whole period."""
        return compose(self.transition_matrices)

    @cached_property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers, complex, largest modulus first."""
        return floquet_multipliers(self.monodromy)

    @cached_property
    def jacobian(self) -> np.ndarray:
        """Derivatives of the residuals with respect to the scaled unknowns, (n, n + parameters).

        The derivatives with respect to the n state components are exact, from the transition
        matrices of the segments; those with respect to the unknown parameters are finite
        differences.
        """
        problem, n = self.problem, self.residuals.size
        units = problem.units[:n]
        # The residual is the final state of a segment minus the initial state of the next segment.
        matrices = self.transition_matrices
        block_matrix = block_diag(*matrices) if len(matrices) > 1 else matrices[0]
        state_columns = (block_matrix - problem.permutation) * units / units[:, None]

        def final_states(unknowns: np.ndarray) -> np.ndarray:
            """Return the final full states of all segments at scaled unknowns."""
            return problem.run(unknowns)[2]

        columns = [state_columns]
        for i in range(n, self.unknowns.size):
            derivative = difference_quotient(final_states, self.unknowns, i)
            columns.append((derivative @ problem.reduction.T).ravel() / units)
        return np.column_stack(columns)


def as_orbit(solution: Evaluation) -> Orbit:
    """Return a solution of the shooting equation as an `Orbit` with its contact pattern.

    The motion is simulated once more over the period to record its contact events.
    """
    problem, period = solution.problem, solution.problem.period
    model, tuning, states = problem.unpack(solution.unknowns)
    record = problem.propagator(model, tuning).record(states[0], period, problem.max_events)
    pattern, grazing = _contact_pattern(record, model.flank_lines, tuning)
    residual, multipliers = solution.residual_norm, solution.multipliers
    return Orbit(model, tuning, period, states[0], residual, multipliers, pattern, grazing)


def _newton(problem: Shooting, unknowns: np.ndarray) -> Evaluation:
    """Solve the shooting equation by a damped Newton iteration from scaled initial unknowns.

    A step is halved, at most _MAX_HALVINGS times, until the residual decreases. Return the last
    iterate, which may not have converged. Raise NoOrbit if the Jacobian matrix is singular.
    """
    solution = problem.evaluate(unknowns)
    for _ in range(_MAX_NEWTON_STEPS):
        if solution.converged:
            break
        try:
            step = -np.linalg.solve(solution.jacobian, solution.residuals)
        except np.linalg.LinAlgError:
            raise NoOrbit(
                f"the orbit has a Floquet multiplier 1 at tuning = {problem.tuning!r}, a fold: "
                "try a guess on either side of it"
            ) from None
        for _ in range(_MAX_HALVINGS):
            candidate = problem.evaluate(solution.unknowns + step)
            if candidate.residual_norm < solution.residual_norm:
                break
            step *= 0.5
        else:
            # Not even the shortest step decreases the residual.
            break
        solution = candidate
    return solution


def _initial_state(problem: Shooting, guess: Any) -> np.ndarray:
    """Convert the user's argument `guess` to a full state, shape (n,).

    A guess is a displacement and a velocity, shape (2,), or a full state, shape (n,). If it is
    None, return the state that the motion from rest reaches after at least _TRANSIENT_PERIODS mesh
    periods, rounded up to a multiple of the period of the orbit.
    """
    model, n = problem.model, problem.model.size
    propagator = problem.propagator(model, problem.tuning)
    if guess is None:
        # -(-a // b) rounds the quotient a / b up.
        periods = -(-_TRANSIENT_PERIODS // problem.period) * problem.period
        states = propagator.initial_state((0.0, 0.0))[None]
        final_states, status_codes = propagator.propagate_many(states, periods, problem.max_events)
        status_code = int(status_codes[0])
        if status_code != status.OK:
            raise NoOrbit(f"the simulation from rest failed: {status.MESSAGES[status_code]}")
        return final_states[0]
    values = as_float_array(guess)
    if values.shape not in ((2,), (n,)) or not np.isfinite(values).all():
        counts = "2" if n == 2 else f"2 or {n}"
        raise ValueError(f"guess = {guess!r} is not allowed: it must be {counts} finite numbers")
    # `initial_state` converts a displacement and a velocity to a full state.
    return values if values.size == n else propagator.initial_state(values)


def floquet_multipliers(monodromy: np.ndarray) -> np.ndarray:
    """Return the complex eigenvalues of a monodromy matrix, largest modulus first."""
    multipliers = np.linalg.eigvals(monodromy).astype(complex)
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]


def is_stable(multipliers: np.ndarray) -> bool:
    """Return whether no Floquet multiplier lies outside the unit circle, up to rounding errors.

    `multipliers` are complex numbers. An orbit without damping, whose multipliers lie on the unit
    circle, counts as stable.
    """
    return bool(np.abs(multipliers).max() < 1.0 + _CIRCLE_TOLERANCE)


def compose(maps: Any) -> np.ndarray:
    """Return the matrix product M_k ... M_2 M_1 of successive linear maps [M_1, ..., M_k].

    The product maps the initial state of the first map to the final state of the last one.
    """
    product = maps[0]
    for matrix in maps[1:]:
        product = matrix @ product
    return product


def scaled_norm(difference: np.ndarray, state: np.ndarray, tuning: float) -> float:
    """Return the largest absolute component of a state difference, with scaled velocities.

    `difference`, shape (..., n), has n / 2 displacements, then n / 2 velocities dx/dtau, on its
    last axis, in units of the static deflection. Velocities are multiplied by the tuning to make
    them comparable with displacements. If the largest component of `state` exceeds 100, the result
    is relative to a hundredth of this component, because rounding errors grow with the state.
    """
    weights = np.repeat([1.0, tuning], difference.shape[-1] // 2)
    return float(np.abs(weights * difference).max() / max(1.0, np.abs(state).max() * 1e-2))


def _contact_pattern(record: Any, flank_lines: tuple, tuning: float) -> tuple:
    """Return (sequence of contact states of an orbit, whether it grazes a flank line).

    `record` is the `Record` of the orbit over its period. `flank_lines` are the displacements at
    which drive-side and coast-side contact start; an orbit grazes a line if it touches or barely
    crosses it. A contact state is 1 for drive-side contact, 0 for no contact, -1 for coast-side
    contact. Without contact events the sequence has the code of each mesh.
    """
    events, summary = record.events, record.summary
    x_min, x_max = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
    tolerance = _TOUCH_TOLERANCE * np.maximum(1.0, x_max - x_min)
    # At a touch the displacement has an extremum on the flank line.
    touches_line = any(
        np.min(np.abs(extremum - line) - tolerance) < 0
        for extremum in (x_min, x_max)
        for line in flank_lines
    )
    if not len(events):
        return tuple(contact_states_without_events(x_min, x_max, *flank_lines)), touches_line
    contact_states = events[:, columns.EVENT_TO].astype(int).tolist()
    pattern = (int(events[0, columns.EVENT_FROM]), *contact_states)
    # An orbit whose extremum lies a distance d beyond a flank line crosses it at a speed of about
    # the square root of d.
    speeds = np.abs(events[:, columns.EVENT_VELOCITY]) * tuning
    return pattern, bool(touches_line or speeds.min() < np.sqrt(tolerance.min()))


def contact_states_without_events(x_min, x_max, drive_line: Any, coast_line: Any) -> list:
    """Return a list of the contact states of all meshes of an orbit without contact events.

    `x_min` and `x_max` are the smallest and the largest displacement of each of the m meshes, shape
    (m,), or () for a single mesh. `drive_line` and `coast_line` are the displacements at which
    drive-side and coast-side contact start. A contact state is 1 for drive-side contact, 0 for no
    contact, -1 for coast-side contact.
    """
    # One extremum may touch a flank line, so each comparison uses the other extremum.
    contact_states = np.where(x_max > drive_line, 1, np.where(x_min > coast_line, 0, -1))
    return np.atleast_1d(contact_states).tolist()
