"""The main resonance of a mesh: where contact is lost, both jumps, the largest motion.

The orbit that never loses contact is linear: it is known at every tuning, and shows between which
two contact is lost about the resonance. From both the branch is walked along into the resonance,
up to its first fold, where the motion jumps: down or, where it comes to strike the far flank, up to
a higher branch, from whose fold it falls.
"""

import numpy as np

from gearlib.analysis.orbits.following import (
    Failed,
    Fold,
    Onset,
    bent,
    extrema_slopes,
    solve,
)
from gearlib.analysis.orbits.following import moved as differing
from gearlib.analysis.orbits.linear_orbits import linear_orbits
from gearlib.analysis.orbits.tracing import Lost, advance, correct, tangent
from gearlib.data import status
from gearlib.kernels import orbit as columns
from gearlib.runs.run_arguments import MAX_EVENTS
from gearlib.runs.simulation import run

#: Tunings at which the linear orbit is looked at; of these the resonance is where it is highest.
_TUNINGS = np.geomspace(0.5, 1.8, 160)
_RESONANCE = (_TUNINGS > 0.65) & (_TUNINGS < 1.5)
#: Steps along a branch: first, largest, how they grow, the shortest, most of them.
_FIRST, _LARGEST, _GROWTH, _LEAST, _MOST = 0.02, 0.25, 1.6, 1e-5, 600
#: How often a step that passes a fold is halved.
_HALVINGS = 30
#: Behind a fold, a share of its tuning, and mesh periods until a motion that jumps has settled.
_BEHIND, _SETTLING = 0.998, 200
#: How often a motion may jump up before it falls.
_CLIMBS = 4
#: A multiplier by which small deviations grow, over 1.
_BEYOND = 1e-6
#: Step of differences.
_DIFFERENCE = 1e-6
_ROUNDING = 1e-12


class Branch:
    """The shooting equation of a model over state and tuning, as a problem of `tracing`."""

    def __init__(self, model):
        self.model = model

    def evaluate(self, y):
        """Return the `_Orbit` at y."""
        if not y[-1] > 0.0:
            raise Lost("no tuning is left")
        return _Orbit(self.model, y)


class _Orbit:
    def __init__(self, model, y):
        self.y, self.period, self.propagator = y, model.repeats, model.propagator(y[-1])
        z, propagator = y[:-1], self.propagator
        self._tuning = propagator.directions(model, ("tuning",))
        matrix, moved, code = propagator.map_slopes(z, self._tuning, self.period, MAX_EVENTS)
        end, _, done = propagator.maps(z, self.period, MAX_EVENTS)
        if code != status.OK or done != status.OK or not np.isfinite(moved).all():
            raise Lost("the motion could not go on")
        self.bent = bent(model)
        self.miss = self.bent @ (end - z)
        own = self.bent @ matrix @ self.bent - np.eye(len(z))
        self.jacobian = np.hstack([own, self.bent @ moved])
        self.small = np.abs(self.miss).max() <= _ROUNDING * max(1.0, 1e-2 * np.abs(z).max())

    @property
    def turning(self):
        """The function that is zero at folds."""
        return np.linalg.det(self.jacobian[:, :-1])

    def slopes(self):
        """Return derivatives of the extrema by the unknowns, (4, n + 1), of `extrema_slopes`."""
        z = self.y[:-1]
        along = [self.propagator.nowhere] * len(z) + [*self._tuning]
        tangents = np.hstack([self.bent, np.zeros((len(z), 1))])
        return extrema_slopes(self.propagator, z, along, tangents, self.period)[0]

    def extrema(self):
        """Return largest and least displacement and force, of several meshes (m, 4)."""
        return self.propagator.record(self.y[:-1], self.period, MAX_EVENTS)[1][..., :4]


class Resonance:
    """The special points of the main resonance of a model.

    Each is y = (state, tuning), None where there is none: ``onset`` where contact
    is lost going up, ``upper`` coming down, ``jump_up`` and ``jump_down``. ``start`` is the orbit
    at which the resonance is entered from above.
    """

    def __init__(self, model):
        self.model = model
        states, extrema = linear_orbits(model, _TUNINGS)
        height = np.where(_RESONANCE, extrema[:, 0] - extrema[:, 1], -np.inf)
        peak = int(height.argmax())
        lost = extrema[:, 1] < 0.0
        low = high = peak
        self.onset = self.upper = self.jump_up = self.jump_down = None
        if lost[peak]:
            low = (
                peak - int(np.argmin(lost[: peak + 1][::-1])) if not lost[: peak + 1].all() else -1
            )
            high = peak + int(np.argmin(lost[peak:])) if not lost[peak:].all() else -1
        found = np.column_stack([states, _TUNINGS])
        if low != high:
            self.onset = _onset(model, found, extrema[:, 1], low, low + 1) if low >= 0 else None
            self.upper = _onset(model, found, extrema[:, 1], high, high - 1) if high >= 0 else None
        self.start = found[peak] if low == high else self.upper
        if self.onset is not None:
            self.jump_up = self._fold(self.onset, 1.0, self.upper)
        if self.upper is not None:
            self.jump_down = self._fold(self.upper, -1.0, self.onset)

    def _fold(self, y, way, other):
        """Return the first fold from the end of the linear orbit on one side."""
        return _first_fold(self.model, y, way, other)


def lasts(model, y):
    """Return whether a motion is stable up to a fold: no other multiplier is beyond 1.

    Of several coordinates periods may double on the way, or a torus begin: the motion has left the
    branch before.
    """
    if model.size == 2:  # of damped motions the other one is below 1
        return True
    multipliers = np.linalg.eigvals(Branch(model).evaluate(y).jacobian[:, :-1]) + 1.0
    others = np.delete(multipliers, np.argmin(np.abs(multipliers - 1.0)))
    return bool((np.abs(others) < 1.0 + _BEYOND).all())


def higher(model, y):
    """Return (state, tuning) to which a motion jumps up at a fold, or None.

    The speed falls, and the motion falls with it at most folds; where it begins to strike the far
    flank it jumps up to a higher branch instead.
    """
    n = model.repeats
    asked = {"record_periods": n, "initial_state": tuple(y[:-1])}
    before, behind = (
        run(model, share * y[-1], 1, periods=periods * n, **asked)
        for share, periods in ((1.0, 1), (_BEHIND, _SETTLING))
    )
    if behind.table[..., columns.X_MAX].max() <= before.table[..., columns.X_MAX].max():
        return None
    return np.append(behind.end, _BEHIND * y[-1])


def fall(model, y):
    """Return the fold at which a motion falls while the speed does, from its first fold y on.

    None where it is lost on the way up, as on motions that repeat after more mesh periods.
    """
    for _ in range(_CLIMBS):
        above = None if y is None else higher(model, y)
        if above is None:
            return y
        try:
            y = _first_fold(model, above, -1.0)
        except (Lost, np.linalg.LinAlgError):
            return None
    return None


def _first_fold(model, y, way, other=None):
    """Return the first fold of a branch towards one side, None where it comes out at `other`."""
    before = None
    branch = Branch(model)
    orbit = branch.evaluate(y)
    along = last = tangent(orbit.jacobian, np.append(np.zeros(len(y) - 1), way))
    for here, ahead in walk(branch, orbit, along):
        # Where branches cross the tuning goes on.
        turned = last[-1] * ahead[-1] < 0.0
        if before is not None and turned and before.turning * here.turning < 0.0:
            return _turning_point(model, before, here)
        if other is not None and (here.y[-1] - other[-1]) * way > 0.0 and not _lost(here):
            # It has come out on the other side.
            return None
        before, last = here, ahead
    return None


def _turning_point(model, a, b):
    """Return the fold between two orbits of a branch; the step is halved until it is found."""
    for _ in range(_HALVINGS):
        share = a.turning / (a.turning - b.turning)
        way = b.y - a.y
        found = solve(Fold(), model, a.y + share * way, np.abs(way).max())
        if found is not None:
            return found[0]
        try:
            _, middle, _ = correct(Branch(model), a.y + 0.5 * way, way / np.linalg.norm(way))
        except Lost:
            return None
        a, b = (middle, b) if a.turning * middle.turning > 0.0 else (a, middle)
    return None


def _lost(orbit):
    return (orbit.extrema()[..., columns.X_MIN] < orbit.propagator.model.flank_lines[0]).any()


def _onset(model, found, least, outer, inner):
    share = least[outer] / (least[outer] - least[inner])
    guess = found[outer] + share * (found[inner] - found[outer])
    solved = solve(Onset(), model, guess)
    return None if solved is None else solved[0]


def walk(branch, orbit, along):
    """Yield (orbit, direction) along a branch, from an orbit on in a direction, shape (3,)."""
    y, h = orbit.y, _FIRST
    yield orbit, along
    for _ in range(_MOST):
        try:
            y, orbit, along, corrections = advance(branch, y, along, h)
        except Lost:
            h *= 0.5
            if h < _LEAST:
                return
            continue
        yield orbit, along
        if corrections <= 3:
            h = min(_GROWTH * h, _LARGEST * max(1.0, 0.25 * np.abs(y[:-1]).max()))


class Top:
    """Unknowns and equations as in `following`: where an extremum is largest along the branch.

    `which` is its number, as of `extrema_slopes`. What it grows by along the branch is exact, the
    derivatives of that are differences: they decide how fast Newton's method converges, not where
    to.
    """

    def __init__(self, which):
        self.which = which

    def tuning(self, model, y):
        """As of `following.Fold`."""
        return y[-1]

    def growth(self, model, y):
        """Return (residuals of the orbit, their derivatives, growth along the branch).

        The direction along the branch is one that changes nowhere.
        """
        if not y[2] > 0.0:
            raise Failed("no tuning is left")
        propagator = model.propagator(y[2])
        along = [propagator.nowhere] * 2 + list(propagator.directions(model, ("tuning",)))
        slopes, ends = extrema_slopes(propagator, y[:2], np.array(along), np.eye(2, 3))
        end, _, _ = propagator.maps(y[:2], 1, MAX_EVENTS)
        (a, b, c), (d, e, f) = rows = ends - np.eye(2, 3)
        ahead = np.array([b * f - c * e, c * d - a * f, a * e - b * d])
        return end - y[:2], rows, slopes[self.which] @ ahead / np.sqrt(ahead @ ahead)

    def evaluate(self, model, y, names=(), last=None):
        """As of `following.Fold`."""
        miss, rows, value = self.growth(model, y)
        if last is None:
            steps = _DIFFERENCE * np.eye(3)
            row = [(self.growth(model, y + one)[2] - value) / _DIFFERENCE for one in steps]
        else:
            # That of the point before, made to fit both.
            row = last[2][2]
            if last[0] is not None:
                way = y - last[0]
                row = row + (value - last[1][2] - row @ way) / (way @ way) * way
        moved = np.zeros((3, len(names)))
        if names:
            propagator = model.propagator(y[2])
            along = propagator.directions(model, names)
            _, moved[:2], _ = propagator.map_slopes(y[:2], along, 1, MAX_EVENTS)
            for i, name in enumerate(names):
                field, step = differing(model, name, _DIFFERENCE)
                moved[2, i] = (self.growth(field, y)[2] - value) / step
        return np.append(miss, value), np.vstack([rows, row]), moved


def top(model, which, start, fold=None):
    """Return y where an extremum is largest along the stable branch, `which` as of `Top`.

    That is its fold, if there is one at which it still grows; else from `start` on towards smaller
    tunings. None where it is not found.
    """
    branch = Branch(model)
    try:
        if fold is None:
            orbit = branch.evaluate(start)
            along = tangent(orbit.jacobian, np.array([0.0, 0.0, -1.0]))
            if orbit.slopes()[which] @ along < 0.0:
                along = -along
        else:
            _, matrix, _ = Fold().evaluate(model, fold)
            # Into the stable side, where no multiplier is beyond 1.
            along = tangent(matrix[:2], matrix[2])
            orbit = branch.evaluate(fold)
            if orbit.slopes()[which] @ along <= 0.0:
                return fold
        return _climb(branch, orbit, along, which)
    except (Lost, Failed):
        return None


def _climb(branch, orbit, along, which):
    """Return y where an extremum stops to grow along a branch."""
    y = rise = None
    for here, ahead in walk(branch, orbit, along):
        new_rise = here.slopes()[which] @ ahead
        if y is not None and new_rise <= 0.0:
            share, way = rise / (rise - new_rise), here.y - y
            found = solve(Top(which), branch.model, y + share * way, np.abs(way).max())
            if found is None:
                raise Lost("the top was not found")
            return found[0]
        y, rise = here.y, new_rise
    raise Lost("the branch has no top")
