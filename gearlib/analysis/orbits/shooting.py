"""Periodic orbits and their Floquet multipliers by shooting over n mesh periods.

An orbit of period n is a fixed point of the map of the state over n mesh periods. Newton's method
uses the exact Jacobian matrix of this map, the monodromy matrix, from variational equations with
saltation matrices at flank crossings. Stable and unstable orbits are therefore accurate to rounding
error. Derivatives with respect to a parameter are central differences, which only affect the rate
of convergence.

At a grazing the one-sided derivatives differ: an orbit that touches a flank line is marked as
grazing, and its multipliers are valid on one side of the grazing only.
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
from gearlib.data.motions import float_array
from gearlib.data.result import result
from gearlib.data.status import CONTACT_FLAGS
from gearlib.engines import orbit as columns
from gearlib.integrators import choose_method
from gearlib.parameters import INTEGER, Count, checked
from gearlib.runs.run_arguments import MAX_EVENTS, Tuning

#: Largest residual of an orbit, as returned by `residual_size`.
MAX_RESIDUAL = 1e-12
#: Mesh periods after which the state of the motion from rest is the default guess.
_TRANSIENT_PERIODS = 400
_MAX_NEWTON_STEPS, _MAX_HALVINGS = 60, 12
#: Largest number of mesh periods of an orbit, which limits memory, and of a shooting segment.
MAX_PERIODS, _MAX_SEGMENT_PERIODS = 100_000, 32
#: Distance of a multiplier from the unit circle due to rounding errors: double multipliers have an
#: error of the square root of the machine precision.
_CIRCLE_TOLERANCE = 1e-7
#: Largest distance between the states one shorter period apart at which that period is tried, and
#: largest distance between equal orbits, in static deflections.
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
    period: int  #: smallest number of mesh periods after which it repeats
    state: np.ndarray  #: full state at tau = 0, shape (n,)
    residual: float  #: largest difference between initial and final state, see `residual_size`
    multipliers: np.ndarray  #: Floquet multipliers over the period, complex, largest first
    pattern: tuple  #: sequence of contact codes from tau = 0
    grazing: bool  #: whether it touches a flank line, where its multipliers are one-sided

    @property
    def stable(self) -> bool:
        """Whether no Floquet multiplier lies outside the unit circle."""
        return is_stable(self.multipliers)

    def dataset(self) -> xr.Dataset:
        """Return the orbit as a dataset: state, multipliers, stability and contact pattern.

        The contact pattern is the sequence of contact codes (1 drive side, 0 none, -1 coast side);
        residual is the difference between initial and final state, in static deflections.
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
        dataset = result(title, self.model, data, method="shooting", tuning=self.tuning)
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
    choose_method(model, None, None)  # raises ValueError unless `model` is a model
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
    """Search for an orbit of a shorter period that is equal to a solution; return None if none is.

    `solution` solves the shooting equation over `solution.problem.period` mesh periods. The periods
    tried are its divisors that are multiples of the period of the excitation, `model.repeats`.
    """
    problem, state = solution.problem, solution.state
    model, tuning, max_events = problem.model, problem.tuning, problem.max_events
    propagator, period = problem.propagator(model, tuning), problem.period
    for divisor in range(model.repeats, period, model.repeats):
        if period % divisor:
            continue
        # The state at the end of the shorter period must be near the initial state.
        end, _, code = propagator.maps(state, divisor, max_events)
        if code != status.OK or problem.distance(end, state) > _SHORTER_PERIOD_TOLERANCE:
            continue
        try:
            orbit = periodic_orbit(
                model, tuning, guess=state, period=divisor, max_events=max_events
            )
        except NoOrbit:
            continue
        # Near a period doubling Newton's method may find a different orbit of half the period.
        if problem.distance(orbit.state, state) <= _SAME_ORBIT_TOLERANCE:
            return orbit
    return None


class Shooting:
    """Shooting equation for periodic orbits; the unknowns are states and parameters of a model.

    Unknowns are divided by their `units`. Multiple shooting divides a long period into segments,
    each with its own initial state, which limits the growth of errors along an unstable orbit; with
    unknown parameters there is one segment. The rigid-body rotation of a train, which no force
    opposes, is not an unknown: without it a full state becomes a reduced state.
    """

    def __init__(
        self, model: Any, tuning, period, names=(), parameter_units=(), max_events=MAX_EVENTS
    ):
        """Set up the equation for orbits that repeat after `period` mesh periods.

        `tuning` is mesh frequency over mean natural frequency. `names` are the names of the model
        parameters (or "tuning") that are unknowns beside the initial state; `parameter_units` are
        the changes of these parameters that correspond to one static deflection, the unit of
        displacements. A mesh period may have at most `max_events` contact events.
        """
        self.model, self.tuning, self.period = model, tuning, period
        self.names, self.max_events = names, max_events
        self._propagator: Any = None
        #: Matrices from full to reduced states, shape (n, full size), and back.
        self.reduction, self.lift = model.reduction()
        n = len(self.reduction)
        # -(-a // b) rounds the quotient a / b up.
        segments = 1 if names else -(-period // _MAX_SEGMENT_PERIODS)
        #: Mesh periods at which the segments start, and at which the last one ends.
        self.segment_bounds = [period * i // segments for i in range(segments + 1)]
        #: Rigid-body rotations of the segments' initial states, shape (segments, full size), or 0.
        self.rotations: Any = 0.0
        #: Index of the segment that follows each segment, the first one after the last, and the
        #: permutation matrix from the initial states of all segments to those of the next ones.
        self.next_segments = np.arange(1, segments + 1) % segments
        self.permutation = np.eye(segments * n)[(np.arange(segments * n) + n) % (segments * n)]
        # Velocities dx/dtau are divided by 1 / tuning, so that they compare with displacements.
        state_units = ([1.0] * (n // 2) + [1.0 / tuning] * (n // 2)) * segments
        #: Value of one scaled unit of each unknown.
        self.units = np.array([*state_units, *parameter_units])

    def unknowns(self, state: np.ndarray, parameter_values: Any) -> np.ndarray:
        """Return the scaled unknowns for a full state and values of the unknown parameters."""
        return np.append(self.reduction @ state, parameter_values) / self.units

    def initial_unknowns(self, state: np.ndarray) -> np.ndarray:
        """Return the scaled unknowns of the motion that starts from a full state at tau = 0.

        The unknowns are the states at the starts of all shooting segments, without rigid-body
        rotation (a train may rotate freely). These rotations are kept in `self.rotations`, shape
        (segments, full size), and added again by `unpack`.
        """
        propagator = self.propagator(self.model, self.tuning)
        states = [state]
        for start, stop in pairwise(self.segment_bounds[:-1]):
            end, _ = self._propagate(propagator, states[-1], start, stop)
            states.append(end)
        full_states = np.array(states)
        reduced_states = full_states @ self.reduction.T
        self.rotations = full_states - reduced_states @ self.lift.T
        return reduced_states.ravel() / self.units

    def unpack(self, unknowns: np.ndarray) -> tuple:
        """Return (model, tuning, full initial states of the segments) for scaled unknowns.

        `unknowns` are the initial states of all shooting segments without rigid-body rotation, then
        the unknown parameters, divided by `self.units`. The returned model and tuning have the
        values of these parameters. The states have shape (segments, full size). Raise ValueError if
        the model does not allow a value.
        """
        values = unknowns * self.units
        model, tuning = self.model, self.tuning
        n = self.units.size - len(self.names)
        for name, value in zip(self.names, values[n:], strict=True):
            model, tuning = with_parameter(model, tuning, name, float(value))
        states = values[:n].reshape(-1, len(self.reduction)) @ self.lift.T
        return model, tuning, states + self.rotations

    def propagator(self, model: Any, tuning: float) -> Any:
        """Return the propagator, the integrator of the equations of motion, of a model at a tuning.

        It reuses tables of the propagator of the previous call if the model is the same object.
        """
        previous = self._propagator
        if previous is None or previous.model is not model:
            self._propagator = model.propagator(tuning)
        elif previous.tuning != tuning:
            self._propagator = previous.at(tuning)
        return self._propagator

    def _propagate(self, propagator: Any, state: np.ndarray, start: int, stop: int) -> tuple:
        """Return (final state, linearised map of each mesh period) of the motion from a full state.

        The motion lasts from the start of mesh period number `start` to the start of period number
        `stop`. Raise ContinuationFailed if the run fails, for example with too many contact events.
        """
        # The excitation repeats after `model.repeats` mesh periods.
        first_period = start % self.model.repeats
        end, maps, code = propagator.maps(state, stop - start, self.max_events, first_period)
        if code != status.OK:
            raise ContinuationFailed(f"the simulation failed: {status.MESSAGES[code]}")
        return end, maps

    def run(self, unknowns: np.ndarray) -> tuple:
        """Run all segments; return (tuning, initial states, final states, linearised maps).

        `unknowns` are the scaled unknowns. The states are full states, shape (segments, n). The
        maps are a list for each segment, with the matrix of derivatives of final by initial states,
        (n, n), for each of its mesh periods.
        """
        model, tuning, states = self.unpack(unknowns)
        propagator = self.propagator(model, tuning)
        maps, ends = [], np.empty_like(states)
        for i, state in enumerate(states):
            start, stop = self.segment_bounds[i], self.segment_bounds[i + 1]
            ends[i], segment_maps = self._propagate(propagator, state, start, stop)
            maps.append(segment_maps)
        return tuning, states, ends, maps

    def record(self, unknowns: np.ndarray, periods: int, samples: int = 0) -> tuple:
        """Return (model, `Record` of its motion over a number of mesh periods) for scaled unknowns.

        The model has the values of the unknown parameters; the motion starts at the initial state
        of the first segment. `samples` is the number of recorded samples in each mesh period.
        """
        model, tuning, states = self.unpack(unknowns)
        propagator = self.propagator(model, tuning)
        return model, propagator.record(states[0], periods, self.max_events, samples)

    def evaluate(self, unknowns: np.ndarray) -> "Evaluation":
        """Return the `Evaluation` (residuals and derivatives) of the shooting equation.

        `unknowns` are scaled. Raise ValueError if a parameter value is invalid, ContinuationFailed
        if the run fails.
        """
        return Evaluation(self, unknowns)

    def distance(self, first: np.ndarray, second: np.ndarray) -> float:
        """Return the distance between two full states, ignoring a rigid-body rotation between them.

        It is the largest difference of a displacement or scaled velocity, in static deflections.
        """
        return residual_size(self.reduction @ (first - second), second, self.tuning)


class Evaluation:
    """Shooting equation evaluated at scaled unknowns: residuals and their derivatives."""

    def __init__(self, problem: Shooting, unknowns: np.ndarray):
        """Run all segments and compute the residuals: final states minus the next initial states.

        After the last segment the next initial state is that of the first one, because the orbit is
        periodic. `unknowns` are the scaled unknowns of the `problem`.
        """
        self.problem, self.unknowns = problem, unknowns
        tuning, states, ends, maps = problem.run(unknowns)
        next_states = states if len(states) == 1 else states[problem.next_segments]
        differences = (ends - next_states) @ problem.reduction.T
        self.state = states[0]  #: full state at tau = 0
        #: Linearised maps of the segments for reduced states.
        self.maps = [
            problem.reduction @ compose(segment_maps) @ problem.lift for segment_maps in maps
        ]
        self.residuals = differences.ravel() / problem.units[: differences.size]  #: shape (n,)
        self.residual_norm = residual_size(differences, states, tuning)
        self.converged = self.residual_norm <= MAX_RESIDUAL

    @cached_property
    def monodromy(self) -> np.ndarray:
        """Monodromy matrix: the linearised map of reduced states over the whole period."""
        return compose(self.maps)

    @cached_property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers, complex, largest modulus first."""
        return floquet_multipliers(self.monodromy)

    @cached_property
    def jacobian(self) -> np.ndarray:
        """Derivatives of the residuals by the scaled unknowns, shape (n, n + parameters).

        The derivatives by the n states are exact, from the linearised maps of the segments; those
        by the unknown parameters are finite differences.
        """
        problem, n = self.problem, self.residuals.size
        units = problem.units[:n]
        # Residual: final state of a segment (its map) minus the next initial state (permutation).
        segment_maps = block_diag(*self.maps) if len(self.maps) > 1 else self.maps[0]
        state_columns = (segment_maps - problem.permutation) * units / units[:, None]

        def final_states(unknowns: np.ndarray) -> np.ndarray:
            """Return the final full states of all segments at scaled unknowns."""
            return problem.run(unknowns)[2]

        columns = [state_columns]
        for i in range(n, self.unknowns.size):
            derivative = difference_quotient(final_states, self.unknowns, i)
            columns.append((derivative @ problem.reduction.T).ravel() / units)
        return np.column_stack(columns)


def as_orbit(solution: Evaluation) -> Orbit:
    """Return a solution of the shooting equation as an `Orbit`, with its contact pattern.

    The motion is simulated once more over the period to record its contact events.
    """
    problem, period = solution.problem, solution.problem.period
    model, tuning, states = problem.unpack(solution.unknowns)
    record = problem.propagator(model, tuning).record(states[0], period, problem.max_events)
    pattern, grazing = _contact_pattern(record, model.flank_lines, tuning)
    residual, multipliers = solution.residual_norm, solution.multipliers
    return Orbit(model, tuning, period, states[0], residual, multipliers, pattern, grazing)


def _newton(problem: Shooting, unknowns: np.ndarray) -> Evaluation:
    """Solve the shooting equation by damped Newton iteration from scaled initial unknowns.

    A step is halved, at most _MAX_HALVINGS times, until the residual decreases. Return the last
    iterate, which need not have converged. Raise NoOrbit if the Jacobian matrix is singular.
    """
    solution = problem.evaluate(unknowns)
    for _ in range(_MAX_NEWTON_STEPS):
        if solution.converged:
            break
        try:
            step = -np.linalg.solve(solution.jacobian, solution.residuals)
        except np.linalg.LinAlgError:
            raise NoOrbit(
                f"the map has a multiplier 1 at tuning = {problem.tuning!r}: this is a fold; "
                "guess an orbit on either side of it"
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
    """Return the full state, shape (n,), that corresponds to the user's argument `guess`.

    A guess is a displacement and velocity, shape (2,), or a full state, shape (n,). With None,
    return the state that the motion from rest reaches after at least _TRANSIENT_PERIODS mesh
    periods, rounded up to a multiple of the period of the orbit.
    """
    model, n = problem.model, problem.model.size
    propagator = problem.propagator(model, problem.tuning)
    if guess is None:
        # -(-a // b) rounds the quotient a / b up.
        periods = -(-_TRANSIENT_PERIODS // problem.period) * problem.period
        rest_state = propagator.initial_state((0.0, 0.0))
        ends, codes = propagator.propagate_many(rest_state[None], periods, problem.max_events)
        code = int(codes[0])
        if code != status.OK:
            raise NoOrbit(f"the simulation from rest failed: {status.MESSAGES[code]}")
        return ends[0]
    values = float_array(guess)
    if values.shape not in ((2,), (n,)) or not np.isfinite(values).all():
        counts = "2" if n == 2 else f"2 or {n}"
        raise ValueError(f"guess = {guess!r} is not allowed: it must be {counts} finite numbers")
    # `initial_state` converts a displacement and velocity to a full state.
    return values if values.size == n else propagator.initial_state(values)


def floquet_multipliers(monodromy: np.ndarray) -> np.ndarray:
    """Return the complex eigenvalues of a monodromy matrix, largest modulus first."""
    multipliers = np.linalg.eigvals(monodromy).astype(complex)
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]


def is_stable(multipliers: np.ndarray) -> bool:
    """Return whether no Floquet multiplier lies outside the unit circle, within rounding errors.

    `multipliers` are complex numbers. An orbit without damping, whose multipliers lie on the
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


def residual_size(difference: np.ndarray, state: np.ndarray, tuning: float) -> float:
    """Return the largest absolute component of a difference of states, in static deflections.

    `difference`, shape (..., n), has n / 2 displacements, then n / 2 velocities dx/dtau, on its
    last axis. Velocities are multiplied by the tuning, so that they are comparable with
    displacements. If the largest component of `state` exceeds 100, the result is relative to a
    hundredth of this component, because rounding errors grow with the state.
    """
    weights = np.repeat([1.0, tuning], difference.shape[-1] // 2)
    return float(np.abs(weights * difference).max() / max(1.0, np.abs(state).max() * 1e-2))


def _contact_pattern(record: Any, flank_lines: tuple, tuning: float) -> tuple:
    """Return (sequence of contact codes of an orbit, whether it grazes a flank line).

    `record` is the `Record` of the orbit over its period. `flank_lines` are the displacements at
    which drive-side and coast-side contact start; an orbit grazes a line if it touches or barely
    crosses it. A contact code is 1 for drive-side contact, 0 for no contact, -1 for coast-side
    contact. Without contact events there is one code for each mesh.
    """
    events, summary = record.events, record.summary
    lowest, highest = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
    tolerance = _TOUCH_TOLERANCE * np.maximum(1.0, highest - lowest)
    # The displacement has an extremum on a flank line that it touches.
    touches_line = any(
        np.min(np.abs(extremum - line) - tolerance) < 0
        for extremum in (lowest, highest)
        for line in flank_lines
    )
    if not len(events):
        return tuple(codes_without_events(lowest, highest, *flank_lines)), touches_line
    codes = events[:, columns.EVENT_TO].astype(int).tolist()
    pattern = (int(events[0, columns.EVENT_FROM]), *codes)
    # An orbit whose extremum lies a distance d beyond a flank line crosses the line with a speed of
    # about the square root of d.
    speeds = np.abs(events[:, columns.EVENT_VELOCITY]) * tuning
    return pattern, bool(touches_line or speeds.min() < np.sqrt(tolerance.min()))


def codes_without_events(lowest, highest, drive_line: Any, coast_line: Any) -> list:
    """Return the contact code of each mesh of an orbit without contact events, as a list.

    `lowest` and `highest` are the smallest and largest displacements of the m meshes, shape (m,),
    or () for a single mesh. `drive_line` and `coast_line` are the displacements at which drive-side
    and coast-side contact start. A contact code is 1 for drive-side contact, 0 for no contact, -1
    for coast-side contact.
    """
    # An orbit on one side of a flank line may touch it with one extremum, so each comparison uses
    # the other extremum.
    codes = np.where(highest > drive_line, 1, np.where(lowest > coast_line, 0, -1))
    return np.atleast_1d(codes).tolist()
