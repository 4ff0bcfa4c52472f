"""`main_resonance`: the tunings at which a mesh loses contact, jumps and vibrates most.

Near its main resonance a gear mesh loses contact, and its motion jumps. In a run-up the tuning
increases slowly, in a run-down it decreases. Orbits near the static equilibrium show in which range
of tunings contact is lost. The branch is continued into this range from both ends by
pseudo-arclength. The motion jumps at a fold, where the branch turns back; folds are computed to
rounding error.
"""

import functools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from gearlib.analysis.orbits import tracing
from gearlib.analysis.orbits.shooting import NoOrbit, Shooting, periodic_orbit
from gearlib.analysis.orbits.special_points import FOLD, BranchPoint, branch_point, locate
from gearlib.analysis.orbits.tracing import ContinuationFailed
from gearlib.data import status
from gearlib.engines import orbit as columns
from gearlib.runs.run_arguments import MAX_EVENTS

#: Quantities that `main_resonance` computes.
QUANTITIES = ("onset", "jump_up", "jump_down", "peak", "resonance_force_ratio")
_EXTREMUM_COLUMNS = {"peak": columns.X_MAX, "resonance_force_ratio": columns.FORCE_MAX}
#: Exceptions that are raised if a quantity cannot be computed.
_FAILURES = (ContinuationFailed, NoOrbit, np.linalg.LinAlgError)

#: Tunings at which orbits are computed first, and tuning interval of the main resonance.
_SCAN_TUNINGS = np.geomspace(0.5, 1.8, 23)
_RESONANCE_BOUNDS = (0.65, 1.5)
#: If contact is never lost, the branch consists of the largest scanned orbit and this number of
#: orbits on either side.
_NEIGHBOURS = 3
#: The clearance is bounded below by minus this value, in units of the static deflection.
_MAX_LOSS_DEPTH = 0.1
#: First, largest and smallest step along a branch, and longest step in which it may turn sharply.
_FIRST_STEP, _MAX_STEP, _MIN_STEP, _MAX_TURNING_STEP = 0.1, 0.4, 1e-5, 1e-3
#: Largest component of the state, in units of the static deflection, above which the largest step
#: is proportional to it.
_LARGE_STATE = 2.0
_MAX_EASY_CORRECTIONS, _MAX_POINTS = 3, 4000
#: Unit of the tuning in the scaled unknowns.
_TUNING_SCALE = 0.5
#: A branch towards lower tunings ends at its first tuning times this ratio.
_MIN_TUNING_RATIO = 0.25
#: Reasons why a branch ends: at a fold, or beyond the resonance.
_FOLD_REACHED, _RESONANCE_PASSED = "fold", "passed"
#: Relative step of the tuning past a fold, and number of excitation periods in which the motion
#: settles after the jump.
_STEP_PAST_FOLD, _SETTLING_REPEATS = 0.002, 160
#: Largest number of jumps to higher branches before the jump down.
_MAX_JUMPS_TO_HIGHER_BRANCHES = 4
#: Smallest modulus of a Floquet multiplier that counts as unstable.
_MAX_STABLE_MODULUS = 1.0 + 1e-6
#: Distance before a fold, relative to a step, at which an extremum is compared with the extremum at
#: the fold.
_FRACTION_BEFORE_FOLD = 1e-3
#: Tolerance of the position of a peak, relative to a step.
_PEAK_TOLERANCE = 1e-6


@dataclass(frozen=True)
class MainResonance:
    """Tunings of the special points of a main resonance; NaN for a point that does not exist."""

    onset: float = math.nan  #: first loss of contact in a run-up
    jump_up: float = math.nan  #: first fold in a run-up, where the motion jumps up
    jump_down: float = math.nan  #: fold in a run-down where the motion jumps down
    peak: float = math.nan  #: largest displacement on the stable branch in a run-down
    resonance_force_ratio: float = math.nan  #: largest mesh force on the same branch
    #: Name of a special point -> state of its orbit at the start of a mesh period, shape (n,).
    states: dict = field(default_factory=dict)
    #: Names of the quantities that could not be computed.
    failed: frozenset = frozenset()
    #: Largest displacement at the peak, in units of the static deflection.
    peak_displacement: float = math.nan
    #: Largest mesh force on the branch, relative to the load.
    peak_force: float = math.nan


def main_resonance(model, quantities=QUANTITIES):
    """Find the tunings of contact loss, jumps and largest vibration near the main resonance.

    The tuning is mesh frequency over mean natural frequency; the main resonance is near 1.

    Parameters
    ----------
    model : Model
        With several degrees of freedom `quantities` must not contain "peak" and
        "resonance_force_ratio".
    quantities : sequence of str
        Names from `QUANTITIES` to compute; all other quantities are NaN.

    Returns
    -------
    MainResonance
        In a run-down the motion may jump to higher branches, with coast-side contact, before it
        jumps down at the fold ``jump_down``. The branch may have a period doubling before this
        fold. Peaks are searched for only on the branch before its first fold. Quantities that could
        not be computed are listed in its attribute ``failed``.
    """
    unknowns_by_name: dict = {}  # quantity -> scaled unknowns of its orbit
    extrema: dict = {}  # peak -> its value
    failed = set()
    try:
        search = _ResonanceSearch(model)
    except _FAILURES:
        return MainResonance(failed=frozenset(quantities))
    for name in quantities:
        try:
            if name in _EXTREMUM_COLUMNS:
                unknowns, extrema[name] = search.peak(_EXTREMUM_COLUMNS[name])
            else:
                # The other quantities are methods of the search, e.g. `onset`.
                unknowns = getattr(search, name)()
        except _FAILURES:
            failed.add(name)
            continue
        if unknowns is not None:
            unknowns_by_name[name] = unknowns
    return MainResonance(
        **{name: search.tuning(unknowns) for name, unknowns in unknowns_by_name.items()},
        states={name: search.state(unknowns) for name, unknowns in unknowns_by_name.items()},
        peak_displacement=extrema.get("peak", math.nan),
        peak_force=extrema.get("resonance_force_ratio", math.nan),
        failed=frozenset(failed),
    )


class _ResonanceSearch:
    """Search for the special points near the main resonance of a model.

    An orbit is represented by the scaled unknowns of the shooting equation: state, then tuning.
    """

    def __init__(self, model: Any):
        """Compute orbits near the static equilibrium over a range of tunings around the resonance.

        The tuning is mesh frequency over natural frequency. The orbits show at which tunings
        contact is lost.
        """
        self.model = model
        self.problem = Shooting(model, 1.0, model.repeats, ("tuning",), (_TUNING_SCALE,))
        #: Unit vector of the tuning in the scaled unknowns.
        self.tuning_axis = np.eye(self.problem.units.size)[-1]
        orbits = [self._orbit_near_equilibrium(tuning) for tuning in _SCAN_TUNINGS]
        self.scanned_orbits = [unknowns for unknowns, _, _ in orbits]
        displacement_ranges = np.array([displacement_range for _, displacement_range, _ in orbits])
        in_contact = np.array([clearance >= 0.0 for _, _, clearance in orbits])
        low, high = _RESONANCE_BOUNDS
        near_resonance = (_SCAN_TUNINGS > low) & (_SCAN_TUNINGS < high)
        #: Index of the scanned orbit with the largest displacement range near the resonance.
        self.largest_index = int(np.where(near_resonance, displacement_ranges, -np.inf).argmax())
        #: A tuning at which contact is lost; NaN if contact is never lost.
        self.tuning_of_loss = float(_SCAN_TUNINGS[self.largest_index])
        if in_contact[self.largest_index]:
            # Contact may be lost between the scanned tunings, so the smallest clearance is searched
            # for.
            ratio = _SCAN_TUNINGS[1] / _SCAN_TUNINGS[0]
            bounds = self.tuning_of_loss / ratio, self.tuning_of_loss * ratio
            minimum = minimize_scalar(self._clearance, bounds=bounds, method="bounded")
            self.tuning_of_loss = float(minimum.x) if minimum.fun < 0.0 else math.nan
        below = np.flatnonzero(in_contact & (_SCAN_TUNINGS < self.tuning_of_loss))
        above = np.flatnonzero(in_contact & (_SCAN_TUNINGS > self.tuning_of_loss))
        #: Scaled unknowns of the nearest scanned orbits without contact loss below and above the
        #: tuning `tuning_of_loss`; None if there is none.
        self.orbit_below_loss = self.scanned_orbits[below[-1]] if below.size else None
        self.orbit_above_loss = self.scanned_orbits[above[0]] if above.size else None

    def tuning(self, unknowns: np.ndarray) -> float:
        """Return the tuning of an orbit, the last of its scaled unknowns."""
        return float(unknowns[-1] * self.problem.units[-1])

    def state(self, unknowns: np.ndarray) -> np.ndarray:
        """Return the full state of an orbit at the start of a mesh period."""
        _, _, segment_states = self.problem.unpack(unknowns)
        return segment_states[0]

    def _orbit_near_equilibrium(self, tuning: float) -> tuple:
        """Find the orbit near the static equilibrium at a tuning.

        Return (scaled unknowns of the orbit, displacement range, clearance). The clearance is the
        smallest distance of a loaded flank from losing contact, in units of the static deflection.
        It is negative if contact is lost, and at least -_MAX_LOSS_DEPTH. If no orbit is found,
        return the unknowns of the static state, 0 and -_MAX_LOSS_DEPTH.
        """
        model = self.model
        static_state = model.propagator(tuning).initial_state(model.static_state(tuning))
        try:
            state = periodic_orbit(model, tuning, guess=static_state, period=model.repeats).state
        except NoOrbit:
            return self.problem.unknowns(static_state, [tuning]), 0.0, -_MAX_LOSS_DEPTH
        unknowns = self.problem.unknowns(state, [tuning])
        _, record = self.problem.record(unknowns, model.repeats)
        x_min, x_max = record.summary[..., columns.X_MIN], record.summary[..., columns.X_MAX]
        clearance = max(model.clearances(x_min, x_max).min(), -_MAX_LOSS_DEPTH)
        return unknowns, (x_max - x_min).max(), clearance

    def _clearance(self, tuning: float) -> float:
        """Return the clearance of the orbit at a tuning, see `_orbit_near_equilibrium`."""
        return self._orbit_near_equilibrium(tuning)[2]

    def onset(self) -> np.ndarray | None:
        """Return the scaled unknowns of the orbit at which contact is first lost in a run-up.

        In a run-up the tuning increases. Return None if contact is never lost, or if all scanned
        orbits below the resonance lose contact.
        """
        if self.orbit_below_loss is None:
            return None
        # The clearance changes sign between this tuning and `tuning_of_loss`.
        lower_tuning = self.tuning(self.orbit_below_loss)
        precision = np.finfo(float).eps
        tuning = brentq(
            self._clearance, lower_tuning, self.tuning_of_loss, xtol=precision, rtol=4.0 * precision
        )
        return self._orbit_near_equilibrium(tuning)[0]

    def _extremum(self, unknowns: np.ndarray, column: int) -> float:
        """Return the largest value of a summary column of an orbit over all meshes.

        `unknowns` are the scaled unknowns of the orbit. `column` is X_MAX (largest displacement) or
        FORCE_MAX (largest mesh force) of `engines.orbit`.
        """
        _, record = self.problem.record(unknowns, self.model.repeats)
        return float(record.summary[..., column].max())

    def jump_up(self) -> np.ndarray | None:
        """Return the scaled unknowns of the first fold in a run-up, or None if there is no fold.

        At the fold the branch turns back, and the motion jumps to a larger amplitude.
        """
        if self.orbit_below_loss is None:
            return None
        fold, _ = self._follow_branch(self.orbit_below_loss, increasing=True)
        return self._stable_fold(fold)

    @functools.cached_property
    def _run_down_branch(self) -> tuple:
        """First fold in a run-down or None, and list of the `BranchPoint`s before it.

        If contact is never lost, there is no fold, and the points are the scanned orbits around the
        one with the largest displacement range.
        """
        if self.orbit_above_loss is not None:
            return self._follow_branch(self.orbit_above_loss, increasing=False)
        start_index = max(self.largest_index - _NEIGHBOURS, 0)
        orbits = self.scanned_orbits[start_index : self.largest_index + _NEIGHBOURS + 1]
        # A plane normal to the tuning axis fixes the tuning of the corrected orbit.
        axis = self.tuning_axis
        solutions = [tracing.correct_to_curve(self.problem, orbit, axis)[0] for orbit in orbits]
        return None, [branch_point(solution, axis) for solution in solutions]

    def jump_down(self) -> np.ndarray | None:
        """Return the scaled unknowns of the fold where the motion jumps down in a run-down.

        At an earlier fold the motion may jump to a branch of larger amplitude, which is then
        followed to its own fold; a simulation just past each fold shows which case applies. Return
        None if the motion passes through the resonance without a jump down.
        """
        fold, _ = self._run_down_branch
        for _ in range(_MAX_JUMPS_TO_HIGHER_BRANCHES):
            if fold is None:
                break
            # Simulate at a slightly lower tuning, where the branch has no orbit any more.
            tuning = (1.0 - _STEP_PAST_FOLD) * fold.value
            periods = _SETTLING_REPEATS * self.model.repeats
            propagator = self.problem.propagator(self.model, tuning)
            states = fold.solution.state[None]
            states, status_codes = propagator.propagate_many(states, periods, MAX_EVENTS)
            if status_codes[0] != status.OK:
                raise ContinuationFailed(status.MESSAGES[int(status_codes[0])])
            steady_state = self.problem.unknowns(states[0], [tuning])
            _, record = self.problem.record(steady_state, self.model.repeats)
            x_min, x_max = record.summary[..., columns.X_MIN], record.summary[..., columns.X_MAX]
            # A higher branch has a larger displacement range than the fold.
            if not x_max.max() - x_min.min() > fold.displacement_range:
                return self._stable_fold(fold)
            fold, _ = self._follow_branch(steady_state, increasing=False)
        return None

    def _follow_branch(self, start: np.ndarray, increasing: bool) -> tuple:
        """Follow a branch from an orbit to its first fold or beyond the resonance.

        `start` are the scaled unknowns of the orbit, from which the tuning is increased or
        decreased. Return (fold or None, list of the `BranchPoint`s before it). Without a fold the
        branch ends past the scanned orbit without contact loss on the other side of the resonance,
        or where the tuning leaves the scanned range. Raise ContinuationFailed if none of these is
        reached.
        """
        problem = self.problem
        sign = 1.0 if increasing else -1.0
        end_orbit = self.orbit_above_loss if increasing else self.orbit_below_loss
        min_tuning, max_tuning = _MIN_TUNING_RATIO * self.tuning(start), _SCAN_TUNINGS[-1]
        solution, _ = tracing.correct_to_curve(problem, start, self.tuning_axis)
        tangent = tracing.unit_tangent(solution.jacobian, sign * self.tuning_axis)
        points = [branch_point(solution, tangent)]

        def has_passed(point: BranchPoint) -> bool:
            """Return whether a point lies beyond the resonance or outside the range of tunings.

            Beyond the resonance means past the tuning of `end_orbit` and, in a run-down, without
            contact loss.
            """
            if not min_tuning < point.value < max_tuning:
                return True
            is_beyond = end_orbit is not None and sign * (point.unknowns - end_orbit)[-1] > 0.0
            # In a run-down contact loss may persist below the tuning of its onset in a run-up.
            has_contact = "F" not in point.contacts
            return is_beyond and (increasing or has_contact)

        def step(length: float) -> tuple[float, str]:
            """Continue the branch by a step; append its end, or the fold within the step.

            `length` is the arc length of the step. Return (arc length of the next step, reason why
            the branch ends here, or "" if it continues).
            """
            previous = points[-1]
            # A fold just past a grazing is so sharp that the branch may turn within a short step.
            allow_corner = length < _MAX_TURNING_STEP
            solution, tangent, corrections = tracing.take_step(
                problem, previous.unknowns, previous.tangent, length, allow_corner=allow_corner
            )
            new = branch_point(solution, tangent)
            # There is a fold if the tuning changes its direction within the step.
            if sign * tangent[-1] < 0.0:
                located = locate(problem, previous, new, FOLD)
                if located is None:
                    raise ContinuationFailed("the branch turns without a fold")
                _, fold = located
                points.append(fold)
                return length, _FOLD_REACHED
            # There are two folds if the cubic that interpolates both points and tangents has a
            # tuning that runs backwards at its midpoint.
            difference = new.unknowns - previous.unknowns
            midpoint_slope = 6.0 * difference[-1] / length - (previous.tangent + tangent)[-1]
            if sign * midpoint_slope < 0.0:
                raise ContinuationFailed("two folds lie within the step")
            points.append(new)
            max_length = _MAX_STEP * max(1.0, np.abs(new.unknowns[:-1]).max() / _LARGE_STATE)
            length = tracing.next_step_length(
                length, corrections, _MAX_EASY_CORRECTIONS, max_length
            )
            return length, _RESONANCE_PASSED if has_passed(new) else ""

        end_reason = tracing.follow_curve(step, points, _FIRST_STEP, _MIN_STEP, _MAX_POINTS)
        if end_reason not in (_FOLD_REACHED, _RESONANCE_PASSED):
            raise ContinuationFailed(end_reason)
        fold = points.pop() if end_reason == _FOLD_REACHED else None
        return fold, points

    def _stable_fold(self, fold: BranchPoint | None) -> np.ndarray | None:
        """Return the scaled unknowns of a fold, or None, and check stability up to the fold.

        Raise ContinuationFailed if the motion becomes unstable before the fold: then a Floquet
        multiplier other than the one at 1 lies outside the unit circle. With one degree of freedom
        and damping the other multiplier is always below 1 and is not checked.
        """
        if fold is None:
            return None
        multipliers = fold.solution.multipliers
        other_multipliers = np.delete(multipliers, np.argmin(np.abs(multipliers - 1.0)))
        if self.model.size > 2 and (np.abs(other_multipliers) >= _MAX_STABLE_MODULUS).any():
            raise ContinuationFailed("the branch becomes unstable before the fold")
        return fold.unknowns

    def peak(self, column: int) -> tuple:
        """Return (scaled unknowns, extremum) of the orbit with the largest extremum in a run-down.

        The extremum of an orbit is its largest displacement or mesh force: `column` is X_MAX or
        FORCE_MAX, a column of the summary. The branch is searched up to its first fold.
        """
        fold, branch = self._run_down_branch
        if fold is not None:
            branch = [*branch, fold]
        points = [point.unknowns for point in branch]
        extrema = [self._extremum(unknowns, column) for unknowns in points]
        i, last_index = int(np.argmax(extrema)), len(points) - 1

        def point_at(position: float) -> Any:
            """Return the scaled unknowns of the orbit at a fractional index in the branch points.

            At index 2.5, e.g., the midpoint between points 2 and 3 is corrected to the branch in
            the plane normal to the chord.
            """
            k = min(int(position), last_index - 1)
            chord = points[k + 1] - points[k]
            predicted = points[k] + (position - k) * chord
            normal = chord / np.linalg.norm(chord)
            return tracing.correct_to_curve(self.problem, predicted, normal)[0].unknowns

        def negative_extremum(position: float) -> float:
            """Return minus the extremum of the orbit at a fractional index in the points."""
            return -self._extremum(point_at(position), column)

        # The extremum may be largest at the fold, the end of the branch.
        before_fold = last_index - _FRACTION_BEFORE_FOLD
        is_fold = fold is not None and i == last_index
        if is_fold and -negative_extremum(before_fold) <= extrema[i]:
            return points[i], extrema[i]
        bounds = max(i - 1, 0), min(i + 1, last_index)
        options = {"xatol": _PEAK_TOLERANCE}
        peak = minimize_scalar(negative_extremum, bounds=bounds, method="bounded", options=options)
        return point_at(peak.x), -float(peak.fun)
