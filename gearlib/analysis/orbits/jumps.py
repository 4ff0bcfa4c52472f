"""`main_resonance`: the special speeds of the main resonance of a mesh, by its period map.

Near its main resonance a gear mesh loses contact, and its motion jumps. The orbit that keeps
contact is known in closed form: it shows between which tunings contact is lost. From both ends of
this range the orbit is followed into it by Newton's method, in steps of the tuning that shrink
where it changes much. The motion jumps where its branch turns round, at a fold, which Newton's
method then finds to rounding: the period map P has a fixed point z = P(z) with a multiplier 1,
det(dP/dz - I) = 0.
"""

import functools
import math
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq, minimize_scalar, newton

from gearlib.analysis.orbits.period_map import NotFound, PeriodMap, linear_orbit_of
from gearlib.engines import orbit as columns

#: Quantities that `main_resonance` can find.
QUANTITIES = ("onset", "jump_up", "jump_down", "peak", "peak_dynamic_factor")
_EXTREMA = {"peak": columns.X_MAX, "peak_dynamic_factor": columns.FORCE_MAX}

#: Tunings at which the orbit that keeps contact is computed, and bounds of the main resonance.
_SCAN_TUNINGS = np.geomspace(0.5, 1.8, 23)
_RESONANCE_BOUNDS = (0.65, 1.5)
#: Largest and smallest relative step of the tuning along a branch, and the lowest tuning of one
#: that is followed down, as a share of its first tuning.
_LARGEST_STEP, _LEAST_STEP, _LOWEST_SHARE = 0.012, 1e-5, 0.25
#: Difference of an orbit from the line through the two before it, as a share of its size, above
#: which the step is halved and below which the next one is doubled.
_BENT, _STRAIGHT = 0.02, 0.005
#: Relative tuning step behind a fold, where it shows to which motion the model jumps, and mesh
#: periods until that has settled.
_BEHIND_FOLD, _SETTLING = 0.002, 160
#: Largest number of jumps to higher branches before the motion falls.
_MAX_CLIMBS = 4
#: Secant steps to the onset, and their relative tolerance.
_MAX_SECANT_STEPS, _ONSET_TOLERANCE = 20, 1e-13
#: Share of the first step beside a fold at which it shows whether an extremum grows further.
_BESIDE_FOLD = 1e-3
_PEAK_TOLERANCE = 1e-8


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
    points, values, lost = {}, {}, set()
    try:
        search = _Search(model)
    except (NotFound, np.linalg.LinAlgError):
        return MainResonance(lost=frozenset(quantities))
    for name in quantities:
        try:
            if name in _EXTREMA:
                point, values[name] = search.peak(_EXTREMA[name])
            else:
                point = getattr(search, name)()
        except (NotFound, np.linalg.LinAlgError):
            lost.add(name)
            continue
        if point is not None:
            points[name] = point
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
        orbits = [self.linear_orbit(tuning) for tuning in _SCAN_TUNINGS]
        self.scan = np.column_stack([[state for state, _ in orbits], _SCAN_TUNINGS])
        highest, least = np.transpose([extrema for _, extrema in orbits])
        low, high = _RESONANCE_BOUNDS
        within = (low < _SCAN_TUNINGS) & (_SCAN_TUNINGS < high)
        self.summit = int(np.where(within, highest - least, -np.inf).argmax())
        #: A tuning at which contact is lost.
        self.inside = float(_SCAN_TUNINGS[self.summit])
        kept = least >= 0.0
        if kept[self.summit]:
            step = _SCAN_TUNINGS[1] / _SCAN_TUNINGS[0]
            ends = self.inside / step, self.inside * step
            lowest = minimize_scalar(self._least, bounds=ends, method="bounded")
            self.inside = float(lowest.x) if lowest.fun < 0.0 else math.nan
        below = np.flatnonzero(kept & (_SCAN_TUNINGS < self.inside))
        above = np.flatnonzero(kept & (_SCAN_TUNINGS > self.inside))
        #: Orbits of the scan on both sides that keep contact.
        self.below = self.scan[below[-1]] if below.size else None
        self.above = self.scan[above[0]] if above.size else None

    def _least(self, tuning):
        """Return the least distance from the flank line of the orbit that keeps contact."""
        return self.linear_orbit(tuning)[1][1]

    def onset(self):
        """Return the orbit that just touches the flank line, running up."""
        if self.below is None:
            return None
        tuning = brentq(self._least, self.below[-1], self.inside, xtol=1e-12)
        state = self.linear_orbit(tuning)[0]

        def distance(tuning):
            nonlocal state
            state, _ = self.map.orbit(tuning, state)
            return self._clearance(np.append(state, tuning))

        other, steps = (1.0 - 1e-4) * tuning, {"maxiter": _MAX_SECANT_STEPS, "disp": False}
        tuning = newton(distance, other, x1=tuning, tol=_ONSET_TOLERANCE, **steps)
        return np.append(state, tuning)

    def _clearance(self, point):
        """Return the least distance from the flank line of an orbit."""
        return (self.map.summary(point)[:, columns.X_MIN] - self.model.flank_lines[0]).min()

    def jump_up(self):
        """Return the first fold running up, None without one."""
        return None if self.below is None else self._lasting(self._branch(self.below, True)[0])

    @functools.cached_property
    def _down(self):
        """The first fold running down, and the orbits on the way to it."""
        if self.above is not None:
            return self._branch(self.above, False)
        around = self.scan[max(self.summit - 3, 0) : self.summit + 4]
        return None, np.array([self._orbit(point[-1], point[:-1]) for point in around])

    def jump_down(self):
        """Return the fold at which the motion falls, running down, None without one."""
        fold = self._down[0]
        for _ in range(_MAX_CLIMBS):
            if fold is None:
                break
            tuning = (1.0 - _BEHIND_FOLD) * fold[-1]
            behind = self.map.settled(tuning, fold[:-1], _SETTLING)
            heights = [self.map.summary(x)[:, columns.X_MAX].max() for x in (behind, fold)]
            if not heights[0] > heights[1]:
                return self._lasting(fold)
            fold, _ = self._branch(self._orbit(tuning, behind[:-1]), False)
        return None

    def _orbit(self, tuning, guess):
        """Return the point (state, tuning) of the orbit near a guess."""
        return np.append(self.map.orbit(tuning, guess)[0], tuning)

    def _branch(self, start, up):
        """Return (fold, points): the first fold ahead of an orbit, None without one.

        The branch ends where it comes out on the other side of the resonance without contact loss.
        """
        sign, end = (1.0, self.above) if up else (-1.0, self.below)
        low, high = _LOWEST_SHARE * start[-1], _SCAN_TUNINGS[-1]
        points, step = [start], _LARGEST_STEP
        while step > _LEAST_STEP:
            last = points[-1]
            tuning = last[-1] * (1.0 + sign * step)
            guess = last[:-1]
            if len(points) > 1:
                share = (tuning - last[-1]) / (last[-1] - points[-2][-1])
                guess = guess + share * (guess - points[-2][:-1])
            try:
                state, matrix = self.map.orbit(tuning, guess)
                change = np.abs(state - guess).max() / max(1.0, np.abs(guess).max())
                fits = np.linalg.det(matrix) > 0.0 and (len(points) == 1 or change < _BENT)
            except NotFound:
                fits = False
            if fits:
                points.append(np.append(state, tuning))
                if end is not None and sign * (tuning - end[-1]) > 0.0:
                    if up or self._clearance(points[-1]) >= 0.0:
                        return None, np.array(points)
                if not low < tuning < high:
                    return None, np.array(points)
                step = min(2.0 * step, _LARGEST_STEP) if change < _STRAIGHT else step
                continue
            fold = self._fold_within(points, tuning, sign)
            if fold is not None:
                return fold, np.array(points)
            step *= 0.5
        raise NotFound("the branch is lost, and not at a fold")

    def _fold_within(self, points, tuning, sign):
        """Return the fold between the last point and a tuning, None without one."""
        try:
            fold = self.map.fold(np.array(points[-2:]))
            if 0.0 <= sign * (fold[-1] - points[-1][-1]) <= sign * (tuning - points[-1][-1]):
                return fold if self.map.turns(fold) * sign < 0.0 else None
        except (NotFound, np.linalg.LinAlgError):
            pass
        return None

    def _lasting(self, fold):
        """Return a fold; NotFound where the motion has lost its stability before."""
        if fold is not None and not self.map.lasts(fold):
            raise NotFound("the motion has left its branch before the fold")
        return fold

    def peak(self, column):
        """Return (point, value) where an extremum, a column of summaries, is largest.

        That is the fold or next to it on the branch entered from above; without a fold the largest
        of the branch, or about the summit of the orbit that keeps contact.
        """
        fold, points = self._down
        places = points[:, -1]
        if fold is not None:
            # Beside a fold states go with the root of the distance.
            points = np.vstack([points, fold])[::-1]
            places = np.sqrt(points[:, -1] - fold[-1])
        values = [self.map.summary(point)[0, column] for point in points]
        order = np.argsort(places)

        def point_at(place):
            tuning = place if fold is None else fold[-1] + place**2
            guess = [np.interp(place, places[order], states) for states in points[order, :-1].T]
            state, matrix = self.map.orbit(tuning, np.array(guess))
            if fold is not None and np.linalg.det(matrix) < 0.0:
                # It is one of the unstable branch, which mirrors the stable one at the fold.
                state, _ = self.map.orbit(tuning, 2.0 * fold[:-1] - state)
            return np.append(state, tuning)

        def value_at(place):
            return float(self.map.summary(point_at(place))[0, column])

        i, last = 0 if self.above is not None else int(np.argmax(values)), len(values) - 1
        while i < last and values[i + 1] > values[i]:
            i += 1
        if i == 0 and fold is not None and value_at(_BESIDE_FOLD * places[1]) <= values[0]:
            return fold, float(values[0])
        ends, options = (
            sorted((places[max(i - 1, 0)], places[min(i + 1, last)])),
            {"xatol": _PEAK_TOLERANCE},
        )
        top = minimize_scalar(
            lambda x: -value_at(x), bounds=ends, method="bounded", options=options
        )
        return point_at(top.x), -float(top.fun)
