"""heyoka: Taylor steps of order 20 with terminal events, one integrator per contact code.

The expressions of a model structure (which terms there are) are compiled once per thread; all
numbers are runtime parameters, so that other pairs and tunings of the structure cost nothing. With
quadratic damping, x' = 0 ends a step as well: behind it |x'| is another polynomial.
"""

import math
import threading
from functools import partial

import numpy as np

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.integrators.peers import heyoka_trains
from gearlib.integrators.peers.package import Package
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.scipy_ivp import MODELS, takes
from gearlib.integrators.split import Phase, Split, Stall, exits_of
from gearlib.integrators.trains_in_python import Problem
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "PACKAGE", "run", "run_many", "takes"]

PACKAGE = Package("heyoka", "heyoka")
#: At the default tolerance; it follows from the tolerance.
ORDER = 20
EVENTS = "switches end a run, contact is a terminal event of the Taylor polynomial"
OPTIONS = {
    "tol": Option(
        2.2e-16, checks.finite_positive, "error of a step, relative; by default that of rounding"
    )
}


def run(pair, tuning, state, *arguments, tol):
    """Run one tuning; see `gearlib.integrators`."""
    if pair.mesh_names:
        return heyoka_trains.Run(Problem(pair, tuning), tol).run(state, *arguments)
    kind = _SixDegrees if pair.equation is None else _OneDegree
    problem = problem_of(pair, tuning)
    return _Run(problem, kind(pair, tuning, problem), tol).run(tuning, state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


#: Which parameter of one degree of freedom is that of |x'| x'.
QUADRATIC = 3


class _Compiled(threading.local):
    """The integrators of this thread: they hold state, so threads cannot share them."""

    def __init__(self):
        self.integrators = {}


_COMPILED = _Compiled()


class _OneDegree:
    """One degree of freedom: its structure, its expressions, its parameters."""

    #: Whether the equations differ from mesh period to mesh period, by par[0].
    aperiodic = False

    def __init__(self, pair, tuning, problem):
        self.law = pair.law(tuning)
        law = self.law
        self.gap, self.closing = law.gap, problem.closing
        #: Per contact code, whether |x'| comes in.
        self.turns = {c: self._damping(c)[1] != 0.0 for c in (NORMAL, BACKLASH, INVERSE)}
        self._orders = [row[0] for row in law.force if row[0] > 0.0]
        self._waves = [row[0] for row in law.stiffness]
        self._sloped = bool(law.pieces[:, 1].any())
        self._curved = bool(law.powers.any())

    def _damping(self, contact):
        return self.law.oil if contact == BACKLASH else self.law.material

    def structure(self, contact):
        """Return what decides the expressions of a contact code."""
        orders = tuple(self._orders)
        cubic = bool(self._damping(contact)[2] != 0.0)
        if contact == BACKLASH:
            return contact, self.turns[contact], cubic, orders
        shape = tuple(self._waves), self._sloped, self._curved
        return contact, self.turns[contact], cubic, orders, shape

    def parameters(self, piece, contact):
        """Return the values of par[0], par[1], ..., x' taken to be positive."""
        law = self.law
        (d1, d2, d3), rows = self._damping(contact), law.force
        mean = rows[rows[:, 0] == 0.0, 1].sum()
        waves = rows[rows[:, 0] > 0.0, 1:].ravel()
        gap = law.gap if np.isfinite(law.gap) else 0.0
        head = [gap, mean, d1, d2, d3]
        if contact == BACKLASH:
            return np.array([*head, *waves])
        c, slope = law.pieces[piece]
        side = 1.0 if contact == NORMAL else -1.0
        powers = side * law.powers[0], law.powers[1]
        table = law.stiffness[:, 1:].ravel()
        return np.array([*head, *waves, c, slope, law.breaks[piece], *powers, *table])

    def expressions(self, contact):
        """Return (equations, displacements over the flanks, velocity that may turn)."""
        import heyoka as hy

        x, v = hy.make_vars("x", "v")
        par, t = hy.par, hy.time
        far = x + par[0]

        def waves(first, orders):
            terms = []
            for j, order in enumerate(orders):
                terms.append(par[first + 2 * j] * hy.cos(order * t))
                terms.append(par[first + 2 * j + 1] * hy.sin(order * t))
            return terms

        drag = par[2]
        if self.turns[contact]:
            drag = drag + par[3] * v
        if self._damping(contact)[2] != 0.0:
            drag = drag + par[4] * v * v
        force = hy.sum([par[1], *waves(5, self._orders)]) - drag * v
        if contact != BACKLASH:
            k = 5 + 2 * len(self._orders)
            c = par[k] + par[k + 1] * (t - par[k + 2]) if self._sloped else par[k]
            c = hy.sum([c, *waves(k + 5, self._waves)])
            u = x if contact == NORMAL else far
            force = force - c * (u + (par[k + 3] + par[k + 4] * u) * u * u if self._curved else u)
        return [(x, v), (v, force)], (x, far), v

    def departs(self, leave, z):
        """Return whether a state on a line leaves it: at rest it does not."""
        return leave.direction * z[1] > 0.0


class _SixDegrees:
    """A piecewise-linear system: z' = A z, of which the entries are parameters."""

    # The run-out has the period of a revolution.
    aperiodic = True

    def __init__(self, pair, tuning, problem):
        self._problem = problem
        self.gap, self.closing = problem.gap, problem.closing
        self._m = problem.start((0.0, 0.0))[0].size
        self.turns = dict.fromkeys((NORMAL, BACKLASH, INVERSE), False)
        self._where = {
            contact: tuple(
                map(tuple, np.argwhere((self._problem.a[contact + 1, :, : self._m] != 0).any(0)))
            )
            for contact in self.turns
        }
        self._lines = tuple(tuple(np.flatnonzero(row)) for row in (problem.near, problem.far))

    def structure(self, contact):
        """Return what decides the expressions of a contact code."""
        count = self._problem.system.harmonics.size
        return contact, self._m, self._where[contact], self._lines, count

    def parameters(self, piece, contact):
        """Return the values of par[0], par[1], ..., the first that of mesh period 0."""
        s, harmonics = self._problem, self._problem.system.harmonics
        rows, columns = zip(*self._where[contact], strict=True)
        lines = [row[list(at)] for row, at in zip((s.near, s.far), self._lines, strict=True)]
        return np.array(
            [
                0.0,
                *harmonics,
                *np.concatenate(lines),
                *s.a[contact + 1, piece][rows, columns],
            ]
        )

    def expressions(self, contact):
        """Return (equations, displacements over the flanks, None)."""
        import heyoka as hy

        par, count = hy.par, self._problem.system.harmonics.size
        z = hy.make_vars(*(f"z{i}" for i in range(self._m)))
        phases = [par[1 + j] * (hy.time + par[0]) for j in range(count)]
        full = [*z, hy.expression(1.0)]
        for phase in phases:
            full += [hy.cos(phase), hy.sin(phase)]
        k, lines = 1 + count, []
        for at in self._lines:
            lines.append(hy.sum([par[k + i] * full[c] for i, c in enumerate(at)]))
            k += len(at)
        sums = [[] for _ in z]
        for i, (row, column) in enumerate(self._where[contact]):
            sums[row].append(par[k + i] * full[column])
        return [(a, hy.sum(terms)) for a, terms in zip(z, sums, strict=True)], lines, None

    def departs(self, leave, z):
        """Return whether a state on a line leaves it: away from rest by the event's direction."""
        return True


def _integrator(model, contact, sign, tol):
    """Return (integrator, views of its state and parameters) of a contact code.

    `sign` is that of x' where it matters, else 0.
    """
    flanks = bool(np.isfinite(model.gap)), model.gap > 0.0, model.closing
    key = type(model), model.structure(contact), sign, flanks, tol
    made = _COMPILED.integrators
    if key not in made:
        import heyoka as hy

        equations, lines, speed = model.expressions(contact)
        towards = {1: hy.event_direction.positive, -1: hy.event_direction.negative}
        # Without a cooldown of its own: the automatic one is infinite from rest on a line.
        events = [
            hy.t_event(lines[leave.line], direction=towards[leave.direction], cooldown=0.0)
            for leave in exits_of(contact, model.gap, model.closing)
        ]
        if sign:
            events.append(hy.t_event(speed, direction=towards[-sign], cooldown=0.0))
        start = [0.0] * len(equations)
        made[key] = hy.taylor_adaptive(equations, start, t_events=events, tol=tol)
        made[key] = made[key], made[key].state, made[key].pars
    return made[key]


class _Run(Split):
    """One integrator, restarted for each phase."""

    # Just above the rounding of a state on the far flank line.
    OFF = 1e-15

    def __init__(self, problem, model, tol):
        super().__init__(problem)
        from heyoka import taylor_outcome

        self.model, self.tol = model, tol
        self._branches, self._end = {}, taylor_outcome.time_limit

    def _branch(self, piece, contact, sign):
        """Return (integrator, views of state and parameters, parameters, exits) of a branch."""
        key = piece, contact, sign
        if key not in self._branches:
            values = self.model.parameters(piece, contact)
            if sign < 0:
                # |x'| x' = -x'^2
                values[QUADRATIC] = -values[QUADRATIC]
            made = _integrator(self.model, contact, sign, self.tol)
            # Parameters that no expression uses have no place.
            values = values[: made[2].size]
            self._branches[key] = *made, values, self.exits[contact]
        return self._branches[key]

    def solve(self, n, start, end, z, piece, contact, keep):
        """Take one phase; see `Split`."""
        sign = 0
        if self.model.turns[contact]:
            v = z[1] if z[1] != 0.0 else self.problem.rate(start, z, piece, contact)[1]
            sign = 1 if v >= 0.0 else -1
        integrator, state, pars, values, exits = self._branch(piece, contact, sign)
        pars[:] = values
        if self.model.aperiodic:
            pars[0] = 2.0 * math.pi * n
        state[:] = z
        integrator.time = start
        code, _, _, steps, dense, _ = integrator.propagate_until(end, c_output=keep)
        self.evaluations += steps * integrator.order
        z, hit = state.copy(), None
        t = end
        if code != self._end:
            t, hit = integrator.time, -1 - int(code)
            if not 0 <= hit < len(exits) + abs(sign):
                raise Stall
            if hit == len(exits):
                z[1], hit = 0.0, None
            elif not self.model.departs(exits[hit], z):
                # A line that is only touched; just off it, lest it is found again.
                z[0] -= exits[hit].direction * self.off(z)
                hit = None
        if not keep:
            return Phase(t, z, hit)
        if dense is None:
            return Phase(t, z, hit, [(t, z)], lambda times: np.repeat([z], len(times), 0))
        points = [(at, dense(at).copy()) for at in dense.times]
        return Phase(t, z, hit, points, lambda times: dense(times).copy())
