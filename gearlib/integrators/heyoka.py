"""heyoka: Taylor steps of order 20 with terminal events on flank lines.

The expressions of a model structure (which terms there are) are compiled once per thread; all
numbers are runtime parameters, so that other models and tunings of the structure cost nothing.
"""

import threading

import numpy as np

from gearlib import checks
from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.taylor.series import damping_of
from gearlib.integrators.method import Integrator, Option, Package
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.split import Phase, Split, Stall

#: Parameters of one degree of freedom: flank lines, mean force, stiffness towards x = 0, damping,
#: and from where on the harmonics of the force stand.
UPPER, LOWER, MEAN, GROUND, DAMPING = range(5)
WAVES = DAMPING + 3
#: Integrators that a thread keeps.
_MAX_COMPILED = 64


class Heyoka(Integrator):
    """heyoka, see there."""

    PACKAGE = Package("heyoka", "heyoka")
    #: At the default tolerance; it follows from the tolerance.
    ORDER = 20
    EVENTS = "switches end a run, contact is a terminal event of the Taylor polynomial"
    MODELS = "all: one or six degrees of freedom, gear trains"
    OPTIONS = {
        "tol": Option(
            2.2e-16,
            checks.finite_positive,
            "error of a step, relative; by default that of rounding",
        )
    }

    def takes(self, model):
        """Return whether it takes a model: it takes all."""
        return True

    def solver(self, model, tuning, span, tol):
        """Return the run of a tuning; see `Integrator.solver`."""
        problem = problem_of(model, tuning)
        kind = _Meshes if model.equation is None else _OneDegree
        return _Run(problem, kind(problem, tol))


class _Compiled(threading.local):
    """The integrators of this thread: they hold state, so threads cannot share them."""

    def __init__(self):
        self.integrators = {}


_COMPILED = _Compiled()


def _compiled(key, expressions, tol):
    """Return (integrator, views of its state and parameters) of ``expressions()``, kept by a key.

    These are (equations, events).
    """
    kept = _COMPILED.integrators
    if key not in kept:
        import heyoka as hy

        equations, events = expressions()
        if len(kept) == _MAX_COMPILED:
            kept.clear()
        start = [0.0] * len(equations)
        integrator = hy.taylor_adaptive(equations, start, t_events=events, tol=tol)
        kept[key] = integrator, integrator.state, integrator.pars
    return kept[key]


class _OneDegree:
    """One degree of freedom: an integrator for each contact code and sign of x'."""

    #: Just above the rounding of a state on the far flank line.
    OFF = 1e-15
    #: Time over phase, states over those of the problem.
    pace = unit = 1.0

    def __init__(self, problem, tol):
        self.problem, self.tol, self.law = problem, tol, problem.law
        self._branches = {}

    def branch(self, turn, start, z, segment, codes, exits):
        """Return (integrator, views of its state and parameters, their values, lines met)."""
        contact, sign = int(codes[0]), 0
        if damping_of(self.law, contact)[1] != 0.0:
            v = z[1] if z[1] != 0.0 else self.problem.rate(start, z, segment, codes)[1]
            sign = 1 if v >= 0.0 else -1
        key = segment, contact, sign
        if key not in self._branches:
            made = self._integrator(contact, sign, exits)
            values = self._parameters(segment, contact, sign)
            self._branches[key] = *made, values, [leave[:2] for leave in exits]
        return self._branches[key]

    def _stiffness(self, contact):
        """Return (pieces, harmonics) of the stiffness of a contact code."""
        far = contact == INVERSE
        law = self.law
        return (law.far_pieces, law.far_stiffness) if far else (law.pieces, law.stiffness)

    def _integrator(self, contact, sign, exits):
        """Return what `_compiled` returns for a contact code; `sign` is that of x', 0: no matter.

        With quadratic damping, x' = 0 ends a step as well: behind it |x'| is another polynomial.
        """
        orders = tuple(row[0] for row in self.law.force if row[0] > 0.0)
        elastic = contact != BACKLASH
        orders_of_stiffness = tuple(self._stiffness(contact)[1][:, 0].tolist()) if elastic else ()

        def expressions():
            import heyoka as hy

            x, v = hy.make_vars("x", "v")
            par, t = hy.par, hy.time

            def waves(first, orders):
                return [
                    hy.par[first + 2 * j + i] * wave(order * t)
                    for j, order in enumerate(orders)
                    for i, wave in enumerate((hy.cos, hy.sin))
                ]

            drag = par[DAMPING] + par[DAMPING + 1] * v + par[DAMPING + 2] * v * v
            force = hy.sum([par[MEAN], *waves(WAVES, orders)]) - drag * v - par[GROUND] * x
            if elastic:
                k = WAVES + 2 * len(orders)
                c = hy.sum(
                    [par[k] + par[k + 1] * (t - par[k + 2]), *waves(k + 5, orders_of_stiffness)]
                )
                u = x - par[UPPER if contact == NORMAL else LOWER]
                force = force - c * (u + (par[k + 3] + par[k + 4] * u) * u * u)
            towards = {1: hy.event_direction.positive, -1: hy.event_direction.negative}
            lines = [(x - par[UPPER + leave.line], towards[leave.direction]) for leave in exits]
            if sign:
                lines.append((v, towards[-sign]))
            # Without a cooldown of its own: the automatic one is infinite from rest on a line.
            events = [hy.t_event(line, direction=way, cooldown=0.0) for line, way in lines]
            return [(x, v), (v, force)], events

        key = contact, orders, orders_of_stiffness, sign, tuple(exits), self.tol
        return _compiled(key, expressions, self.tol)

    def _parameters(self, piece, contact, sign):
        """Return the values of the parameters; with sign -1 of x', |x'| x' = -x'^2."""
        law, rows = self.law, self.law.force
        lower = law.lower if np.isfinite(law.lower) else 0.0
        damping = damping_of(law, contact) * (1.0, -1.0 if sign < 0 else 1.0, 1.0)
        values = [law.upper, lower, rows[rows[:, 0] == 0.0, 1].sum(), law.ground, *damping]
        values += rows[rows[:, 0] > 0.0, 1:].ravel().tolist()
        if contact != BACKLASH:
            pieces, waves = self._stiffness(contact)
            powers = (law.powers[0] if contact == NORMAL else -law.powers[0]), law.powers[1]
            values += [*pieces[piece], law.breaks[piece], *powers, *waves[:, 1:].ravel()]
        return np.array(values)


def _weighted(row, values):
    """Return the terms of a row times expressions, without those that are zero."""
    return [float(row[i]) * values[i] for i in np.flatnonzero(row)]


def _integrator(problem, flanks, waves, tol):
    """Return (integrator, views of its state and parameters); time is theta.

    par[0] is the phase at which it begins, par[1] the tuning; three factors of each flank follow,
    then what is not zero of `waves`, shape (n + flanks, 2 h): the harmonics in the accelerations
    and in the rates of distances, which depend on the tuning.
    """
    system, grid, n = problem.system, problem.propagator.grid, problem.size // 2
    size = 2 * n + 1
    tables = system.free[n : 2 * n, :size], system.near, system.far, system.push, system.harmonics
    key = *(table.tobytes() for table in (*tables, waves != 0.0)), tuple(flanks), tol

    def expressions():
        import heyoka as hy

        z = hy.make_vars(*(f"z{i}" for i in range(2 * n)))
        full = [*z, hy.expression(1.0)]
        for frequency in system.harmonics.tolist():
            phase = frequency * (hy.par[0] + hy.par[1] * hy.time)
            full += [hy.cos(phase), hy.sin(phase)]
        moved: list = [[] for _ in waves]
        for k, (i, c) in enumerate(np.argwhere(waves)):
            moved[i].append(hy.par[2 + 3 * len(flanks) + k] * full[size + c])
        sums = [_weighted(system.free[n + i, :size], full) + moved[i] for i in range(n)]
        events = []
        for k, (j, line) in enumerate(flanks):
            functional = (system.near, system.far)[line][j]
            rate = (grid.rate, grid.far_rate)[line][j]
            distance = hy.sum(_weighted(functional, full))
            events.append(hy.t_event(distance, cooldown=0.0))
            elastic, more, across = (hy.par[2 + 3 * k + i] for i in range(3))
            speed = hy.sum(_weighted(rate[:size], full) + moved[n + k])
            along = elastic * distance + more * speed
            effect = system.effect[0 if line else 2, 0, j]
            for push, force in zip(
                system.push[j, effect, :, n : 2 * n], (along, across * distance), strict=True
            ):
                # A mesh without friction does not push across.
                if force is along or system.grip[j, effect, 1].any():
                    for i in np.flatnonzero(push):
                        sums[i].append(float(push[i]) * force)
        equations = [(z[i], z[n + i]) for i in range(n)]
        equations += [(z[n + i], hy.sum(terms)) for i, terms in enumerate(sums)]
        return equations, events

    return _compiled(key, expressions, tol)


class _Meshes:
    """Any number of meshes: one integrator, whose parameters tell which of them touch."""

    OFF = 1e-14

    def __init__(self, problem, tol):
        self.problem, self.pace = problem, 1.0 / problem.tuning
        self.unit = problem.unit[: problem.size]
        finite = np.isfinite(problem.gaps)
        self.flanks = [(j, line) for j in range(finite.size) for line in range(1 + finite[j])]
        system, grid, n = problem.system, problem.propagator.grid, problem.size // 2
        rates = [(grid.rate, grid.far_rate)[line][j] for j, line in self.flanks]
        self._waves = np.concatenate([system.free[n : 2 * n], rates])[:, 2 * n + 1 :]
        self._made = _integrator(problem, self.flanks, self._waves, tol)
        self._values: dict = {}

    def branch(self, turn, start, z, segment, codes, exits):
        """Return (integrator, views of its state and parameters, their values, lines met)."""
        values = self._parameters(segment, codes)
        values[0] = turn
        return *self._made, values, self.flanks

    def _parameters(self, segment, codes):
        """Return all parameters; the factors of a flank are 0 where it is not in contact."""
        key = segment, codes.tobytes()
        if key not in self._values:
            system, n = self.problem.system, self.problem.size // 2
            rows = np.zeros((len(self.flanks), 3))
            for row, (j, line) in zip(rows, self.flanks, strict=True):
                if codes[j] != BACKLASH and (codes[j] == NORMAL) == (line == 0):
                    own = (system.near, system.far)[line][j]
                    k = int(np.abs(own[:n]).argmax())
                    grip = system.grip[j, system.effect[codes[j] + 1, segment, j]]
                    row[:] = np.array([grip[0, k], grip[0, n + k], grip[1, k]]) / own[k]
            waves = self._waves[self._waves != 0.0]
            head = [0.0, self.problem.tuning]
            values = np.concatenate([head, rows.ravel(), waves])
            # Parameters that no expression uses have no place.
            self._values[key] = values[: self._made[2].size]
        return self._values[key]


class _Run(Split):
    """One integrator, restarted for each phase."""

    def __init__(self, problem, model):
        super().__init__(problem)
        from heyoka import taylor_outcome

        self.model, self.OFF, self._end = model, model.OFF, taylor_outcome.time_limit

    def solve(self, turn, start, end, z, segment, codes, exits):
        """Take one phase; see `Split`."""
        pace, unit = self.model.pace, self.model.unit
        made = self.model.branch(turn, start, z, segment, codes, exits)
        integrator, state, pars, values, lines = made
        pars[:], state[:] = values, z * unit
        integrator.time = start * pace
        code, _, _, steps, dense, _ = integrator.propagate_until(end * pace, c_output=self.keep)
        self.evaluations += steps * integrator.order
        t, new, hit = end, state / unit, None
        if code != self._end:
            t, which = integrator.time / pace, -1 - int(code)
            if which < 0:
                raise Stall
            if which < len(lines):
                hit = self._met(turn + t, new, lines[which], exits)
            else:
                # x' turns.
                new[1] = 0.0
        if not self.keep or dense is None:
            ends = np.array([start, t]), np.array([z, new])
            return Phase(*ends, hit, lambda phases: np.repeat([new], len(phases), 0))
        times, states = np.array(dense.times) / pace, dense(np.array(dense.times)) / unit
        times[-1], states[-1] = t, new
        return Phase(times, states, hit, lambda phases: dense(phases * pace) / unit)

    def _met(self, t, z, flank, exits):
        """Return which exit a flank is; one that is only touched is left."""
        mesh, line = flank
        speed = self.problem.speeds(t, z)[line][mesh]
        for i, leave in enumerate(exits):
            if leave[:2] == flank:
                if leave.direction * speed > 0.0:
                    return i
                speed = -leave.direction
        self.problem.put(t, z, mesh, line, self.away(z) * (1.0 if speed > 0.0 else -1.0))
        return None


METHODS = {"heyoka": Heyoka()}
