"""`main_resonance`: the special speeds of the main resonance of a mesh.

Near its main resonance a gear mesh loses contact, and its motion jumps. Orbits from static
equilibrium show between which tunings contact is lost. From both ends of this range the branch is
followed into it by pseudo-arclength; the motion jumps where the branch turns round, at a fold,
which is then computed to rounding.
"""

import functools
import math
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from gearlib.analysis.orbits import tracing
from gearlib.analysis.orbits.branch_points import branch_point
from gearlib.analysis.orbits.shooting import NoOrbit, Shooting, periodic_orbit
from gearlib.analysis.orbits.special_points import FOLD, located
from gearlib.analysis.orbits.tracing import Lost
from gearlib.data import status
from gearlib.engines import orbit as columns
from gearlib.runs.run_arguments import MAX_EVENTS

#: Quantities that `main_resonance` computes.
QUANTITIES = ("onset", "jump_up", "jump_down", "peak", "peak_dynamic_factor")
_EXTREMA = {"peak": columns.X_MAX, "peak_dynamic_factor": columns.FORCE_MAX}

#: Tunings at which orbits from static equilibrium are computed, bounds of the main resonance.
_SCAN_TUNINGS = np.geomspace(0.5, 1.8, 23)
_RESONANCE_BOUNDS = (0.65, 1.5)
#: Depth of contact loss beyond which it does not count.
_DEEP = 0.1
#: First and largest step along a branch, one within which it may turn, and the least; size of
#: states from which on, and corrections up to which, steps grow; most steps.
_FIRST_STEP, _LARGEST_STEP, _SHORT_STEP, _LEAST_STEP = 0.1, 0.4, 1e-3, 1e-5
_LARGE_STATE, _MAX_EASY_CORRECTIONS, _MAX_POINTS = 2.0, 3, 4000
#: Tuning that weighs as much as a static deflection, and the share of its first tuning at which a
#: branch that is followed down ends.
_TUNING_SCALE, _LOWEST_SHARE = 0.5, 0.25
#: Reasons for the end of a branch.
_FOLD, _PASSED = "fold", "passed"
#: Relative tuning step behind a fold, where it shows to which motion the model jumps, and periods
#: of the excitation until that has settled.
_BEHIND_FOLD, _SETTLING = 0.002, 160
#: Largest number of jumps to higher branches before the motion falls.
_MAX_CLIMBS = 4
#: Modulus of a multiplier above which deviations grow.
_UNSTABLE = 1.0 + 1e-6
#: Shares of a step along a branch: beside a fold it shows whether an extremum grows further, and
#: to the second a peak is located.
_BESIDE_FOLD, _PEAK_TOLERANCE = 1e-3, 1e-6


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
    #: Names of those that were not computed: the motion is lost on the way.
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
    except (Lost, NoOrbit, np.linalg.LinAlgError):
        return MainResonance(lost=frozenset(quantities))
    for name in quantities:
        try:
            if name in _EXTREMA:
                point, values[name] = search.peak(_EXTREMA[name])
            else:
                point = getattr(search, name)()
        except (Lost, NoOrbit, np.linalg.LinAlgError):
            lost.add(name)
            continue
        if point is not None:
            points[name] = point
    return MainResonance(
        **{name: search.tuning(y) for name, y in points.items()},
        states={name: search.problem.model(y)[2][0] for name, y in points.items()},
        peak_displacement=values.get("peak", math.nan),
        peak_force=values.get("peak_dynamic_factor", math.nan),
        lost=frozenset(lost),
    )


class _Search:
    """Search for special points of one model; each is an array of scaled unknowns, or None."""

    def __init__(self, model):
        self.model = model
        self.problem = Shooting(model, 1.0, model.repeats, ("tuning",), (_TUNING_SCALE,))
        #: Direction of the tuning in the unknowns.
        self.ahead = np.eye(self.problem.units.size)[-1]
        self.scan, heights, least = zip(*map(self._from_static, _SCAN_TUNINGS), strict=True)
        low, high = _RESONANCE_BOUNDS
        within = (_SCAN_TUNINGS > low) & (_SCAN_TUNINGS < high)
        self.summit = int(np.where(within, heights, -np.inf).argmax())
        #: A tuning at which contact is lost.
        self.inside = float(_SCAN_TUNINGS[self.summit])
        kept = np.array(least) >= 0.0
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

    def tuning(self, y):
        """Return the tuning of scaled unknowns."""
        return float(y[-1] * self.problem.units[-1])

    def _from_static(self, tuning):
        """Return (unknowns, height, least displacement) of the orbit next to static equilibrium.

        The displacement is at least that of `_DEEP`, also where there is no such orbit.
        """
        model = self.model
        start = model.propagator(tuning).start("static" if model.mesh_names else (1.0, 0.0))
        try:
            state = periodic_orbit(model, tuning, guess=start, period=model.repeats).state
        except NoOrbit:
            return self.problem.unknowns(start, [tuning]), 0.0, -_DEEP
        y = self.problem.unknowns(state, [tuning])
        summary = self.problem.record(y, model.repeats)[1].summary
        low, high = summary[..., columns.X_MIN], summary[..., columns.X_MAX]
        return y, (high - low).max(), max((low - model.flank_lines[0]).min(), -_DEEP)

    def _least(self, tuning):
        """Return the least distance from the flank line of the orbit from static equilibrium."""
        return self._from_static(tuning)[2]

    def onset(self):
        """Return the orbit that just touches the flank line, running up."""
        if self.below is None:
            return None
        low, precision = self.tuning(self.below), np.finfo(float).eps
        tuning = brentq(self._least, low, self.inside, xtol=precision, rtol=4.0 * precision)
        return self._from_static(tuning)[0]

    def _extremum(self, y, column):
        """Return the largest value of a column of the summaries of all meshes."""
        record = self.problem.record(y, self.model.repeats)[1]
        return float(record.summary[..., column].max())

    def jump_up(self):
        """Return the first fold running up, None without one."""
        return None if self.below is None else self._lasting(self._branch(self.below, True)[0])

    @functools.cached_property
    def _down(self):
        """The first fold running down, and the orbits on the way to it."""
        if self.above is not None:
            return self._branch(self.above, False)
        around = self.scan[max(self.summit - 3, 0) : self.summit + 4]
        orbits = [tracing.correct(self.problem, y, self.ahead)[0] for y in around]
        return None, [branch_point(orbit, self.ahead) for orbit in orbits]

    def jump_down(self):
        """Return the fold at which the motion falls, running down, None without one."""
        fold = self._down[0]
        for _ in range(_MAX_CLIMBS):
            if fold is None:
                break
            tuning, periods = (1.0 - _BEHIND_FOLD) * fold.value, _SETTLING * self.model.repeats
            propagator = self.problem.propagator(self.model, tuning)
            ends, codes = propagator.many(fold.orbit.state[None], periods, MAX_EVENTS)
            if codes[0] != status.OK:
                raise Lost(status.MESSAGES[int(codes[0])])
            behind = self.problem.unknowns(ends[0], [tuning])
            if not self._extremum(behind, columns.X_MAX) > fold.high:
                return self._lasting(fold)
            fold, _ = self._branch(behind, False)
        return None

    def _branch(self, start, up):
        """Return (fold, points): the first fold ahead of an orbit, None without one.

        The branch ends where it comes out on the other side of the resonance without contact loss.
        """
        problem = self.problem
        sign, end = (1.0, self.above) if up else (-1.0, self.below)
        low, high = _LOWEST_SHARE * self.tuning(start), _SCAN_TUNINGS[-1]
        orbit, _ = tracing.correct(problem, start, self.ahead)
        points = [branch_point(orbit, tracing.tangent(orbit.jacobian, sign * self.ahead))]

        def passed(point):
            if not low < point.value < high:
                return True
            beyond = end is not None and sign * (point.y[-1] - end[-1]) > 0.0
            return beyond and (up or point.low >= np.max(self.model.flank_lines[0]))

        def go(h):
            last = points[-1]
            # A short step may turn: close behind a grazing a fold is sharp.
            turns = h < _SHORT_STEP
            orbit, tangent, corrections = tracing.advance(
                problem, last.y, last.tangent, h, corner=turns
            )
            new = branch_point(orbit, tangent)
            if sign * tangent[-1] < 0.0:
                _, fold = located(problem, last, new, FOLD) or (0.0, None)
                if fold is None:
                    raise Lost("the branch turns at no fold")
                points.append(fold)
                return h, _FOLD
            # The slope of the cubic in the middle shows two folds within a step.
            middle = 6.0 * (new.y - last.y)[-1] / h - (last.tangent + tangent)[-1]
            if sign * middle < 0.0:
                raise Lost("two folds lie within the step")
            points.append(new)
            size = max(1.0, np.abs(new.y[:-1]).max() / _LARGE_STATE)
            h = tracing.longer(h, corrections, _MAX_EASY_CORRECTIONS, _LARGEST_STEP * size)
            return h, _PASSED if passed(new) else ""

        ended = tracing.follow(go, points, _FIRST_STEP, _LEAST_STEP, _MAX_POINTS)
        if ended not in (_FOLD, _PASSED):
            raise Lost(ended)
        fold = points.pop() if ended == _FOLD else None
        return fold, points

    def _lasting(self, fold):
        """Return the unknowns of a fold; Lost where the motion has lost its stability before.

        With one degree of freedom and damping the other multiplier is below 1.
        """
        if fold is None:
            return None
        multipliers = fold.orbit.multipliers
        others = np.delete(multipliers, np.argmin(np.abs(multipliers - 1.0)))
        if self.model.size > 2 and (np.abs(others) >= _UNSTABLE).any():
            raise Lost("the motion has left its branch before the fold")
        return fold.y

    def peak(self, column):
        """Return (unknowns, value) where a column of summaries is largest before the first fold."""
        fold, points = self._down
        points = [point.y for point in (points if fold is None else [*points, fold])]
        values = [self._extremum(y, column) for y in points]
        i, last = int(np.argmax(values)), len(points) - 1

        def point_at(place):
            first = min(int(place), last - 1)
            chord = points[first + 1] - points[first]
            start = points[first] + (place - first) * chord
            return tracing.correct(self.problem, start, chord / np.linalg.norm(chord))[0].y

        def loss_at(place):
            return -self._extremum(point_at(place), column)

        if fold is not None and i == last and -loss_at(last - _BESIDE_FOLD) <= values[i]:
            return points[i], values[i]
        ends, options = (max(i - 1, 0), min(i + 1, last)), {"xatol": _PEAK_TOLERANCE}
        top = minimize_scalar(loss_at, bounds=ends, method="bounded", options=options)
        return point_at(top.x), -float(top.fun)
