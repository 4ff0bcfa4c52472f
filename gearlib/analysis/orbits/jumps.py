"""`main_resonance`: the tunings at which a mesh loses contact, jumps and vibrates most.

Near its main resonance a gear mesh loses contact, and its motion jumps. Orbits from static
equilibrium show between which tunings contact is lost. From both ends of this range the branch is
followed into it by pseudo-arclength; the motion jumps where the branch turns round, at a fold,
which is then computed to rounding.
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
QUANTITIES = ("onset", "jump_up", "jump_down", "peak", "peak_dynamic_factor")
_EXTREMUM_COLUMNS = {"peak": columns.X_MAX, "peak_dynamic_factor": columns.FORCE_MAX}
#: Exceptions after which a quantity counts as not computed.
_FAILURES = (ContinuationFailed, NoOrbit, np.linalg.LinAlgError)

#: Tunings at which orbits from static equilibrium are computed, bounds of the main resonance.
_SCAN_TUNINGS = np.geomspace(0.5, 1.8, 23)
_RESONANCE_BOUNDS = (0.65, 1.5)
#: Largest depth of contact loss that is distinguished, in static deflections.
_MAX_LOSS_DEPTH = 0.1
#: First, largest and smallest step along a branch, and the longest within which it may turn.
_FIRST_STEP, _MAX_STEP, _MIN_STEP, _MAX_TURNING_STEP = 0.1, 0.4, 1e-5, 1e-3
#: Size of states above which the largest step grows with the state.
_LARGE_STATE = 2.0
_MAX_EASY_CORRECTIONS, _MAX_POINTS = 3, 4000
#: Tuning that weighs as much as a static deflection.
_TUNING_SCALE = 0.5
#: Share of its first tuning at which a branch that is followed down ends.
_MIN_TUNING_SHARE = 0.25
#: Reasons for the end of a branch.
_FOLD_REACHED, _RESONANCE_PASSED = "fold", "passed"
#: Relative tuning step behind a fold, where it shows to which motion the model jumps, and periods
#: of the excitation until that has settled.
_STEP_BEHIND_FOLD, _SETTLING_REPEATS = 0.002, 160
#: Largest number of jumps to higher branches before the motion falls.
_MAX_JUMPS_TO_HIGHER_BRANCHES = 4
#: Modulus of a multiplier above which deviations grow.
_MAX_STABLE_MODULUS = 1.0 + 1e-6
#: Share of a step before a fold at which an extremum is compared with the one at the fold.
_SHARE_BEFORE_FOLD = 1e-3
#: Tolerance of the position of a peak, as a share of a step.
_PEAK_TOLERANCE = 1e-6


@dataclass(frozen=True)
class MainResonance:
    """Tunings of the special points of a main resonance; NaN where there is none."""

    onset: float = math.nan  #: contact is first lost, running up
    jump_up: float = math.nan  #: first fold from below: the motion jumps up, running up
    jump_down: float = math.nan  #: fold at which the motion falls, running down
    peak: float = math.nan  #: largest displacement of the stable branch entered from above
    peak_dynamic_factor: float = math.nan  #: largest force of the same branch
    #: States at the start of a mesh period at these points, name -> array of shape (n,).
    states: dict = field(default_factory=dict)
    #: Names of the quantities that could not be computed.
    lost: frozenset = frozenset()
    #: Largest displacement at the peak, static deflections.
    peak_displacement: float = math.nan
    #: Largest mesh force at its peak over the load.
    peak_force: float = math.nan


def main_resonance(model, quantities=QUANTITIES):
    """Find where a mesh loses contact, jumps and moves most about its main resonance.

    Parameters
    ----------
    model : Model
        Of one degree of freedom; of more, without peaks, it takes longer.
    quantities : sequence of str
        Names of `QUANTITIES`; others stay NaN.

    Returns
    -------
    MainResonance
        The upper end of the range of contact loss may be followed downwards over several jumps to
        higher branches, which strike the far flank: ``jump_down`` is the fold from which the
        motion falls, whether or not its period doubles before; peaks are those of the branch up to
        its first fold.
    """
    points, values, failed = {}, {}, set()
    try:
        search = _Search(model)
    except _FAILURES:
        return MainResonance(lost=frozenset(quantities))
    for name in quantities:
        try:
            if name in _EXTREMUM_COLUMNS:
                point, values[name] = search.peak(_EXTREMUM_COLUMNS[name])
            else:
                point = getattr(search, name)()
        except _FAILURES:
            failed.add(name)
            continue
        if point is not None:
            points[name] = point
    return MainResonance(
        **{name: search.tuning(unknowns) for name, unknowns in points.items()},
        states={name: search.problem.model(unknowns)[2][0] for name, unknowns in points.items()},
        peak_displacement=values.get("peak", math.nan),
        peak_force=values.get("peak_dynamic_factor", math.nan),
        lost=frozenset(failed),
    )


class _Search:
    """Search for special points of one model; each is an array of scaled unknowns, or None."""

    def __init__(self, model: Any):
        """Compute orbits of the model from static equilibrium at tunings about the resonance."""
        self.model = model
        self.problem = Shooting(model, 1.0, model.repeats, ("tuning",), (_TUNING_SCALE,))
        #: Direction of the tuning in the unknowns.
        self.tuning_axis = np.eye(self.problem.units.size)[-1]
        orbits = [self._orbit_from_equilibrium(tuning) for tuning in _SCAN_TUNINGS]
        self.scan = [unknowns for unknowns, _, _ in orbits]
        heights = np.array([height for _, height, _ in orbits])
        in_contact = np.array([clearance >= 0.0 for _, _, clearance in orbits])
        low, high = _RESONANCE_BOUNDS
        near_resonance = (_SCAN_TUNINGS > low) & (_SCAN_TUNINGS < high)
        #: Index of the highest orbit of the scan, and a tuning at which contact is lost.
        self.highest = int(np.where(near_resonance, heights, -np.inf).argmax())
        self.tuning_with_loss = float(_SCAN_TUNINGS[self.highest])
        if in_contact[self.highest]:
            step = _SCAN_TUNINGS[1] / _SCAN_TUNINGS[0]
            bounds = self.tuning_with_loss / step, self.tuning_with_loss * step
            lowest = minimize_scalar(self._clearance, bounds=bounds, method="bounded")
            self.tuning_with_loss = float(lowest.x) if lowest.fun < 0.0 else math.nan
        below = np.flatnonzero(in_contact & (_SCAN_TUNINGS < self.tuning_with_loss))
        above = np.flatnonzero(in_contact & (_SCAN_TUNINGS > self.tuning_with_loss))
        #: Orbits of the scan that keep contact, nearest to the loss of contact on either side.
        self.below = self.scan[below[-1]] if below.size else None
        self.above = self.scan[above[0]] if above.size else None

    def tuning(self, unknowns: np.ndarray) -> float:
        """Return the tuning, the last of the scaled unknowns of an orbit."""
        return float(unknowns[-1] * self.problem.units[-1])

    def _orbit_from_equilibrium(self, tuning: float) -> tuple:
        """Return (scaled unknowns, height, clearance) of the orbit next to static equilibrium.

        The clearance is the smallest distance from the flank line, negative after contact loss,
        at least -_MAX_LOSS_DEPTH. It has this value, too, if there is no such orbit.
        """
        model = self.model
        start = model.propagator(tuning).start("static" if model.mesh_names else (1.0, 0.0))
        try:
            state = periodic_orbit(model, tuning, guess=start, period=model.repeats).state
        except NoOrbit:
            return self.problem.unknowns(start, [tuning]), 0.0, -_MAX_LOSS_DEPTH
        unknowns = self.problem.unknowns(state, [tuning])
        summary = self.problem.record(unknowns, model.repeats)[1].summary
        lowest, highest = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
        clearance = max((lowest - model.flank_lines[0]).min(), -_MAX_LOSS_DEPTH)
        return unknowns, (highest - lowest).max(), clearance

    def _clearance(self, tuning: float) -> float:
        """Return the smallest distance of `_orbit_from_equilibrium` from the flank line."""
        return self._orbit_from_equilibrium(tuning)[2]

    def onset(self) -> np.ndarray | None:
        """Return the scaled unknowns of the orbit at which contact is first lost, running up.

        Return None if contact is lost at all lower tunings.
        """
        if self.below is None:
            return None
        low, precision = self.tuning(self.below), np.finfo(float).eps
        tuning = brentq(
            self._clearance, low, self.tuning_with_loss, xtol=precision, rtol=4.0 * precision
        )
        return self._orbit_from_equilibrium(tuning)[0]

    def _extremum(self, unknowns: np.ndarray, column: int) -> float:
        """Return the largest value, over all meshes, in a column of the summary of an orbit.

        The columns are those of `gearlib.engines.orbit`.
        """
        record = self.problem.record(unknowns, self.model.repeats)[1]
        return float(record.summary[..., column].max())

    def jump_up(self) -> np.ndarray | None:
        """Return the scaled unknowns of the first fold running up, None if there is none."""
        if self.below is None:
            return None
        return self._stable_fold(self._follow_branch(self.below, True)[0])

    @functools.cached_property
    def _branch_down(self) -> tuple:
        """The first fold running down, or None, and the points of the branch before it."""
        if self.above is not None:
            return self._follow_branch(self.above, False)
        neighbours = self.scan[max(self.highest - 3, 0) : self.highest + 4]
        axis = self.tuning_axis
        solutions = [tracing.correct(self.problem, start, axis)[0] for start in neighbours]
        return None, [branch_point(solution, axis) for solution in solutions]

    def jump_down(self) -> np.ndarray | None:
        """Return the unknowns of the fold at which the motion falls, running down, or None."""
        fold = self._branch_down[0]
        for _ in range(_MAX_JUMPS_TO_HIGHER_BRANCHES):
            if fold is None:
                break
            tuning = (1.0 - _STEP_BEHIND_FOLD) * fold.value
            periods = _SETTLING_REPEATS * self.model.repeats
            propagator = self.problem.propagator(self.model, tuning)
            ends, codes = propagator.many(fold.solution.state[None], periods, MAX_EVENTS)
            if codes[0] != status.OK:
                raise ContinuationFailed(status.MESSAGES[int(codes[0])])
            settled = self.problem.unknowns(ends[0], [tuning])
            if not self._extremum(settled, columns.X_MAX) > fold.displacement_max:
                return self._stable_fold(fold)
            fold, _ = self._follow_branch(settled, False)
        return None

    def _follow_branch(self, start: np.ndarray, up: bool) -> tuple:
        """Return (first fold ahead of an orbit or None, points of the branch before it).

        The orbit has the scaled unknowns `start`; the tuning rises with `up`, else it falls. The
        branch ends beyond the resonance, where it has contact without loss.
        """
        problem = self.problem
        sign, end = (1.0, self.above) if up else (-1.0, self.below)
        low, high = _MIN_TUNING_SHARE * self.tuning(start), _SCAN_TUNINGS[-1]
        solution, _ = tracing.correct(problem, start, self.tuning_axis)
        tangent = tracing.tangent(solution.jacobian, sign * self.tuning_axis)
        points = [branch_point(solution, tangent)]

        def has_passed(point: BranchPoint) -> bool:
            """Return whether a point lies beyond the resonance or outside the tunings."""
            if not low < point.value < high:
                return True
            is_beyond = end is not None and sign * (point.unknowns[-1] - end[-1]) > 0.0
            in_contact = point.displacement_min >= np.max(self.model.flank_lines[0])
            return is_beyond and (up or in_contact)

        def step(length: float) -> tuple[float, str]:
            """Take a step and add its point; return (next length, reason for the end or "")."""
            last = points[-1]
            # Close behind a grazing a fold is so sharp that a short step may turn.
            solution, tangent, corrections = tracing.take_step(
                problem,
                last.unknowns,
                last.tangent,
                length,
                allow_corner=length < _MAX_TURNING_STEP,
            )
            new = branch_point(solution, tangent)
            if sign * tangent[-1] < 0.0:
                _, fold = locate(problem, last, new, FOLD) or (0.0, None)
                if fold is None:
                    raise ContinuationFailed("the branch turns at no fold")
                points.append(fold)
                return length, _FOLD_REACHED
            # The slope of the cubic in the middle shows two folds within a step.
            difference = new.unknowns - last.unknowns
            middle_slope = 6.0 * difference[-1] / length - (last.tangent + tangent)[-1]
            if sign * middle_slope < 0.0:
                raise ContinuationFailed("two folds lie within the step")
            points.append(new)
            longest = _MAX_STEP * max(1.0, np.abs(new.unknowns[:-1]).max() / _LARGE_STATE)
            length = tracing.next_step_length(length, corrections, _MAX_EASY_CORRECTIONS, longest)
            return length, _RESONANCE_PASSED if has_passed(new) else ""

        end_reason = tracing.follow_curve(step, points, _FIRST_STEP, _MIN_STEP, _MAX_POINTS)
        if end_reason not in (_FOLD_REACHED, _RESONANCE_PASSED):
            raise ContinuationFailed(end_reason)
        fold = points.pop() if end_reason == _FOLD_REACHED else None
        return fold, points

    def _stable_fold(self, fold: BranchPoint | None) -> np.ndarray | None:
        """Return the scaled unknowns of a fold, or None; raise an error if the motion is unstable.

        With one degree of freedom and damping the second multiplier is below 1.
        """
        if fold is None:
            return None
        multipliers = fold.solution.multipliers
        others = np.delete(multipliers, np.argmin(np.abs(multipliers - 1.0)))
        if self.model.size > 2 and (np.abs(others) >= _MAX_STABLE_MODULUS).any():
            raise ContinuationFailed("the motion has left its branch before the fold")
        return fold.unknowns

    def peak(self, column: int) -> tuple:
        """Return (scaled unknowns, value) where an extremum is largest before the first fold.

        `column` is that of the extremum in `gearlib.engines.orbit`, for instance X_MAX.
        """
        fold, branch = self._branch_down
        points = [point.unknowns for point in (branch if fold is None else [*branch, fold])]
        values = [self._extremum(unknowns, column) for unknowns in points]
        i, last = int(np.argmax(values)), len(points) - 1

        def point_at(position: float) -> Any:
            """Return the unknowns of the branch at a fractional index of its points."""
            first = min(int(position), last - 1)
            chord = points[first + 1] - points[first]
            start = points[first] + (position - first) * chord
            normal = chord / np.linalg.norm(chord)
            return tracing.correct(self.problem, start, normal)[0].unknowns

        def negative_extremum(position: float) -> float:
            """Return the extremum at a fractional index of the points, with the opposite sign."""
            return -self._extremum(point_at(position), column)

        before_fold = last - _SHARE_BEFORE_FOLD
        if fold is not None and i == last and -negative_extremum(before_fold) <= values[i]:
            return points[i], values[i]
        bounds, options = (max(i - 1, 0), min(i + 1, last)), {"xatol": _PEAK_TOLERANCE}
        top = minimize_scalar(negative_extremum, bounds=bounds, method="bounded", options=options)
        return point_at(top.x), -float(top.fun)
