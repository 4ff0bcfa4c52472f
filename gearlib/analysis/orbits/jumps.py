"""`main_resonance`: the special speeds of the main resonance of a mesh, by exact runs.

Near its main resonance a gear mesh loses contact, and its motion jumps. The orbit that keeps
contact is known in closed form: it shows between which tunings contact is lost. From both ends of
this range the motion is swept into it. A jump shows as the largest change between two neighbouring
tunings; runs at tunings between these two close in on it. The motion jumps at a fold of its branch
of orbits, which Newton's method then finds to rounding: the period map P has a fixed point z = P(z)
with a multiplier 1, det(dP/dz - I) = 0.
"""

import functools
import math
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from gearlib.analysis.orbits.linear_orbits import linear_orbit_of
from gearlib.analysis.orbits.peaks import highest_point
from gearlib.analysis.orbits.period_map import NotFound, PeriodMap, sweep_states
from gearlib.kernels import orbit as columns

#: Quantities that `main_resonance` can find.
QUANTITIES = ("onset", "jump_up", "jump_down", "peak", "peak_dynamic_factor")
_EXTREMA = {"peak": columns.X_MAX, "peak_dynamic_factor": columns.FORCE_MAX}

#: Tunings of the first look at the orbit that keeps contact, and bounds of the main resonance.
_SCAN_TUNINGS = np.geomspace(0.5, 1.8, 23)
_RESONANCE_BOUNDS = (0.65, 1.5)
#: Ratio of neighbouring tunings of a sweep, and lowest tuning of a sweep down as a share of its
#: first one.
_SWEEP_RATIO, _SWEEP_END = 1.006, 0.25
#: Mesh periods at each tuning of a sweep, and where a motion settles slowly or jumps.
_SWEEP_PERIODS, _LONG_PERIODS = 50, 160
#: Steps that are swept before jumps are looked for.
_SWEEP_STEPS = 24
#: Pieces into which an interval with a jump is cut, and how often it is cut.
_PIECES, _MAX_CUTS = 16, 4
#: Share of the change in an interval below which the largest piece of it is no jump.
_SMOOTH_SHARE = 0.2
#: Change of the largest displacement that can be a jump, static deflections.
_LEAST_JUMP = 1e-3
#: Ratio by which a jump is larger than the change in the step before it or behind it.
_JUMP_RATIO = 1.3
#: Distance of states of the same motion, static deflections.
_SAME_MOTION = 0.05
#: Change of a state in a period below which it is one of an orbit, static deflections.
_SETTLED = 1e-3
#: Relative tuning step behind a fold, where it shows to which motion the model jumps.
_BEHIND_FOLD = 0.002
#: Relative tuning step at which an orbit that is followed is next to a fold.
_LEAST_STEP = 1e-5
#: Largest number of jumps to higher branches before the motion falls.
_MAX_CLIMBS = 4
#: Secant steps to the onset, and their relative tolerance.
_MAX_SECANT_STEPS, _ONSET_TOLERANCE = 20, 1e-13


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
    #: Names of those which Newton's method does not find: the motion is lost on the way.
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
    try:
        search = _Search(model)
    except (NotFound, np.linalg.LinAlgError):
        return MainResonance(lost=frozenset(quantities))
    points, values, lost = {}, {}, set()
    for name in quantities:
        try:
            if name in _EXTREMA:
                found = search.peak(_EXTREMA[name])
            else:
                found = getattr(search, name)(), math.nan
        except (NotFound, np.linalg.LinAlgError):
            lost.add(name)
            continue
        if found[0] is not None:
            points[name], values[name] = found
    return MainResonance(
        **{name: float(point[-1]) for name, point in points.items()},
        states={name: point[:-1] for name, point in points.items()},
        peak_displacement=values.get("peak", math.nan),
        peak_force=values.get("peak_dynamic_factor", math.nan),
        lost=frozenset(lost),
    )


class _Search:
    """Search for special points of one model; each is an array (state, tuning), or None."""

    def __init__(self, model):
        self.model, self.map = model, PeriodMap(model)
        self.linear_orbit = linear_orbit_of(model)
        found = [self.linear_orbit(tuning) for tuning in _SCAN_TUNINGS]
        self.scan = np.column_stack([[state for state, _ in found], _SCAN_TUNINGS])
        highest, least = np.transpose([extrema for _, extrema in found])
        within = (_RESONANCE_BOUNDS[0] < _SCAN_TUNINGS) & (_SCAN_TUNINGS < _RESONANCE_BOUNDS[1])
        self.summit = int(np.where(within, highest - least, -np.inf).argmax())
        #: A tuning at which contact is lost.
        self.inside: float | None = float(_SCAN_TUNINGS[self.summit])
        #: Orbits of the scan beside it that keep contact.
        self.below: np.ndarray | None = None
        self.above: np.ndarray | None = None
        if least[self.summit] >= 0.0:
            self.inside = self._lowest(self.inside)
        if self.inside is not None:
            kept = least >= 0.0
            below = np.flatnonzero(kept & (_SCAN_TUNINGS < self.inside))
            above = np.flatnonzero(kept & (_SCAN_TUNINGS > self.inside))
            self.below = self.scan[below[-1]] if below.size else None
            self.above = self.scan[above[0]] if above.size else None

    def _least(self, tuning):
        """Return the least distance from the flank line of the orbit that keeps contact."""
        return self.linear_orbit(tuning)[1][1]

    def _lowest(self, tuning):
        """Return a tuning about that of the summit at which contact is lost, None without one."""
        step = _SCAN_TUNINGS[1] / _SCAN_TUNINGS[0]
        ends = tuning / step, tuning * step
        lowest = minimize_scalar(self._least, bounds=ends, method="bounded")
        return float(lowest.x) if lowest.fun < 0.0 else None

    def onset(self):
        """Return the orbit that just touches the flank line, running up."""
        if self.below is None:
            return None
        tuning = brentq(self._least, self.below[-1], self.inside, xtol=1e-12)
        state = self.linear_orbit(tuning)[0]
        line = self.model.flank_lines[0]

        def distance(tuning):
            nonlocal state
            state = self.map.orbit(tuning, state)
            return (self.map.summary(tuning, state)[:, columns.X_MIN] - line).min()

        other = (1.0 - 1e-4) * tuning
        values = distance(other), distance(tuning)
        for _ in range(_MAX_SECANT_STEPS):
            if values[0] == values[1]:
                break
            step = values[1] * (tuning - other) / (values[0] - values[1])
            other, tuning = tuning, tuning + step
            if abs(step) <= _ONSET_TOLERANCE * tuning:
                break
            values = values[1], distance(tuning)
        return np.append(state, tuning)

    def jump_up(self):
        """Return the first fold running up, None without one."""
        if self.below is None:
            return None
        return self._lasting(self._first_fold(self.below, self.above)[0])

    @functools.cached_property
    def _down(self):
        """The first fold running down, and the rows of the way to it."""
        if self.above is None:
            return None, self._rows_about_summit()
        try:
            return self._first_fold(self.above, self.below)
        except NotFound:
            if self.model.size > 2:
                raise
            return self._followed_down(self.above)

    def _followed_down(self, start):
        """Return the same by Newton's method, where a motion leaves its branch before the fold."""
        points, ratio = [start], 1.0 / _SWEEP_RATIO
        while points[-1][-1] > _SWEEP_END * start[-1] and ratio < 1.0 - _LEAST_STEP:
            last = points[-1]
            tuning, guess = ratio * last[-1], last[:-1]
            if len(points) > 1:
                share = (tuning - last[-1]) / (last[-1] - points[-2][-1])
                guess = guess + share * (guess - points[-2][:-1])
            try:
                state = self.map.orbit(tuning, guess)
            except NotFound:
                state = np.full(guess.shape, np.inf)
            if np.abs(state - guess).max() < _SAME_MOTION:
                points.append(np.append(state, tuning))
                continue
            ratio = math.sqrt(ratio)
        fold = self.map.fold(np.array(points[-2:]))
        if abs(fold[-1] - points[-1][-1]) > _BEHIND_FOLD * fold[-1]:
            raise NotFound("the branch has no fold")
        rows = np.array(points)
        summaries = [self.map.summary(point[-1], point[:-1]) for point in rows]
        return fold, (rows[:, -1], rows[:, :-1], np.array(summaries))

    def jump_down(self):
        """Return the fold at which the motion falls, running down, None without one."""
        fold = self._down[0]
        for _ in range(_MAX_CLIMBS):
            if fold is None:
                break
            behind = (1.0 - _BEHIND_FOLD) * fold[-1]
            before = self.map.summary(fold[-1], fold[:-1])
            states, after = sweep_states(self.model, fold[:-1], [behind], _LONG_PERIODS)
            if not after[0, :, columns.X_MAX].max() > before[:, columns.X_MAX].max():
                return self._lasting(fold)
            fold, _ = self._first_fold(np.append(states[0], behind), None)
        return None

    def peak(self, column):
        """Return (point, value) of the largest extremum, of a column of summaries."""
        fold, rows = self._down
        return highest_point(self.map, column, rows, fold, self.above is None)

    def _first_fold(self, start, end):
        """Return (fold, rows), the first fold of a motion from the point `start` on towards `end`.

        The fold is None where the motion comes out behind `end` without contact loss; without an
        `end` it is swept down. Rows are tunings, states and summaries of the way to the fold.
        """
        up = end is not None and end[-1] > start[-1]
        ratio = _SWEEP_RATIO if up else 1.0 / _SWEEP_RATIO
        stop = end[-1] * _SWEEP_RATIO if up else _SWEEP_END * start[-1]
        fold, kept = None, []
        while fold is None and start is not None:
            tunings = start[-1] * ratio ** np.arange(_SWEEP_STEPS + 1)
            states, summaries = self._swept(start[:-1], tunings, _SWEEP_PERIODS)
            out = (tunings > stop) if up else (tunings < stop)
            if end is not None:
                least = (summaries[:, :, columns.X_MIN] - self.model.flank_lines[0]).min(axis=1)
                passed = (tunings > end[-1]) if up else (tunings < end[-1])
                out |= passed & (least >= 0.0)
            size = int(out.argmax()) + 1 if out.any() else _SWEEP_STEPS
            start = None if out.any() else np.append(states[-1], tunings[-1])
            for i in _largest(_changes(summaries[: size + 1])):
                k = self._settled(states, tunings, i)
                start_of_step = np.append(states[k], tunings[k])
                fold, state = self._fold_between(start_of_step, tunings[i + 1], states[i + 1])
                if fold is not None:
                    size = k + 1
                    break
                if np.abs(state - states[i + 1]).max() > _SAME_MOTION:
                    # So large a step has led to another motion than the branch does.
                    size, start = i + 1, np.append(state, tunings[i + 1])
                    break
            kept.append([part[:size] for part in (tunings, states, summaries)])
        return fold, tuple(map(np.concatenate, zip(*kept, strict=True)))

    def _swept(self, state, tunings, periods):
        """Return states and summaries at tunings, the first of which is that of the state."""
        later, summaries = sweep_states(self.model, state, tunings[1:], periods)
        first = self.map.summary(tunings[0], state)
        return np.vstack([state, later]), np.concatenate([first[None], summaries])

    def _fold_between(self, start, end, expected):
        """Return (fold, None) on the way from a point to a tuning by ever shorter sweeps.

        (None, state at `end`) where there is none; `expected` is the state after one step.
        """
        state, tuning = start[:-1], start[-1]
        way, width = np.sign(end - tuning), abs(end - tuning)
        low, high = min(tuning, end) - width, max(tuning, end) + width
        last = None
        for _ in range(_MAX_CUTS):
            tunings = np.linspace(tuning, end, _PIECES + 1)
            states, summaries = self._swept(state, tunings, _LONG_PERIODS)
            changes = _changes(summaries)
            i = int(changes.argmax())
            smooth = not changes[i] > _SMOOTH_SHARE * changes.sum()
            arrived = np.abs(states[-1] - expected).max() < _SAME_MOTION
            first, last = last is None, states[-1] if last is None else last
            if smooth and arrived:
                return None, last
            # Where so short steps do not make it jump yet, the fold may be just behind them.
            settled = self._settled(states, tunings, _PIECES if smooth else i)
            before = np.column_stack([states, tunings])[max(settled - 1, 0) : settled + 1]
            try:
                fold = self.map.fold(before)
                if low <= fold[-1] <= high and self.map.turns(fold) * way < 0.0:
                    return fold, None
            except (NotFound, np.linalg.LinAlgError):
                pass
            if smooth and first:
                return None, last
            if smooth:
                break
            state, tuning = states[settled], tunings[settled]
            expected, end = states[i + 1], tunings[i + 1]
        if changes.max() > _SAME_MOTION or not arrived:
            raise NotFound("the motion jumps, and not at a fold")
        return None, last

    def _settled(self, states, tunings, i):
        """Return the last row up to row i that is an orbit; behind a fold motions leave slowly."""
        for k in range(i, 0, -1):
            residual, matrix = self.map.residual(tunings[k], states[k])
            if np.abs(residual).max() < _SETTLED and np.linalg.det(matrix) > 0.0:
                return k
        return 0

    def _rows_about_summit(self):
        """Return tunings, states and summaries of orbits about the highest one of the scan."""
        around = self.scan[max(self.summit - 3, 0) : self.summit + 4]
        states = np.array([self.map.orbit(point[-1], point[:-1]) for point in around])
        tunings = around[:, -1]
        summaries = [self.map.summary(*one) for one in zip(tunings, states, strict=True)]
        return tunings, states, np.array(summaries)

    def _lasting(self, fold):
        """Return a fold; NotFound where the motion has lost its stability before."""
        if fold is not None and not self.map.lasts(fold):
            raise NotFound("the motion has left its branch before the fold")
        return fold


def _changes(summaries):
    """Return the changes of the largest displacement from row to row, shape (k - 1,)."""
    return np.abs(np.diff(np.nan_to_num(summaries[:, :, columns.X_MAX].max(axis=1))))


def _largest(changes):
    """Return the steps that can be jumps: they change the motion more than those beside them."""
    inner = np.concatenate([[0.0], changes, [0.0]])
    outer = np.concatenate([[np.inf], changes, [np.inf]])
    largest = (changes >= inner[:-2]) & (changes >= inner[2:]) & (changes > _LEAST_JUMP)
    stands_out = changes > _JUMP_RATIO * np.minimum(outer[:-2], outer[2:])
    return np.flatnonzero(largest & stands_out)
