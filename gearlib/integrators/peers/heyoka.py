"""heyoka: Taylor steps of order 20 with terminal events, one integrator per contact code.

The expressions of a model structure (which terms there are) are compiled once per thread; all
numbers are runtime parameters, so that other pairs and tunings of the structure cost nothing. With
quadratic damping, x' = 0 ends a step as well: behind it |x'| is another polynomial.
"""

import threading
from functools import partial

import numpy as np

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.integrators.peers import heyoka_meshes
from gearlib.integrators.peers.package import Package
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.scipy_ivp import MODELS, takes
from gearlib.integrators.split import TURN, Phase, Split, Stall
from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.taylor.series import damping_of

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
    problem = problem_of(pair, tuning)
    kind = heyoka_meshes.Meshes if pair.equation is None else _OneDegree
    return _Run(problem, kind(problem, tol)).run(state, *arguments)


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
    """One degree of freedom: an integrator for each contact code and sign of x'."""

    #: Just above the rounding of a state on the far flank line.
    OFF = 1e-15
    #: Time over phase, states over those of the problem.
    pace = unit = 1.0

    def __init__(self, problem, tol):
        self.problem, self.tol = problem, tol
        self.law = law = problem.law
        #: Per contact code, whether |x'| comes in.
        self.turns = {c: damping_of(law, c)[1] != 0.0 for c in (NORMAL, BACKLASH, INVERSE)}
        self._orders = [row[0] for row in law.force if row[0] > 0.0]
        near, far = (law.stiffness, law.pieces), (law.far_stiffness, law.far_pieces)
        self._stiffness = {NORMAL: near, BACKLASH: near, INVERSE: far}
        self._curved = bool(law.powers.any())
        self._branches = {}

    def branch(self, n, start, z, segment, codes, exits):
        """Return (integrator, views of its state and parameters, their values, lines met)."""
        contact, sign = int(codes[0]), 0
        if self.turns[contact]:
            v = z[1] if z[1] != 0.0 else self.problem.rate(start, z, segment, codes)[1]
            sign = 1 if v >= 0.0 else -1
        key = segment, contact, sign
        if key not in self._branches:
            values = self._parameters(segment, contact)
            if sign < 0:
                # |x'| x' = -x'^2
                values[QUADRATIC] = -values[QUADRATIC]
            made = self._integrator(contact, sign, exits)
            # Parameters that no expression uses have no place.
            lines = [leave[:2] for leave in exits]
            self._branches[key] = *made, values[: made[2].size], lines
        return self._branches[key]

    def _integrator(self, contact, sign, exits):
        """Return (integrator, views of its state and parameters) of a contact code.

        `sign` is that of x' where it matters, else 0.
        """
        key = self._structure(contact), sign, tuple(exits), self.tol
        made = _COMPILED.integrators
        if key not in made:
            import heyoka as hy

            equations, lines, speed = self._expressions(contact)
            towards = {1: hy.event_direction.positive, -1: hy.event_direction.negative}
            # Without a cooldown of its own: the automatic one is infinite from rest on a line.
            events = [
                hy.t_event(lines[leave.line], direction=towards[leave.direction], cooldown=0.0)
                for leave in exits
            ]
            if sign:
                events.append(hy.t_event(speed, direction=towards[-sign], cooldown=0.0))
            one = hy.taylor_adaptive(equations, [0.0, 0.0], t_events=events, tol=self.tol)
            made[key] = one, one.state, one.pars
        return made[key]

    def _shape(self, contact):
        """Return which terms there are: cubic damping, harmonics and slope of the stiffness."""
        waves, pieces = self._stiffness[contact]
        cubic = bool(damping_of(self.law, contact)[2] != 0.0)
        return cubic, tuple(waves[:, 0].tolist()), bool(pieces[:, 1].any())

    def _structure(self, contact):
        """Return what decides the expressions of a contact code."""
        law, (cubic, *shape) = self.law, self._shape(contact)
        stands = law.upper != 0.0, law.ground != 0.0
        shape = () if contact == BACKLASH else (*shape, self._curved)
        return contact, self.turns[contact], cubic, tuple(self._orders), stands, shape

    def _parameters(self, piece, contact):
        """Return the values of par[0], par[1], ..., x' taken to be positive."""
        law, (stiffness, pieces) = self.law, self._stiffness[contact]
        rows = law.force
        mean = rows[rows[:, 0] == 0.0, 1].sum()
        waves = rows[rows[:, 0] > 0.0, 1:].ravel()
        lower = law.lower if np.isfinite(law.lower) else 0.0
        head = [-lower, mean, *damping_of(law, contact), law.upper, law.ground]
        if contact == BACKLASH:
            return np.array([*head, *waves])
        side = 1.0 if contact == NORMAL else -1.0
        powers = side * law.powers[0], law.powers[1]
        table = stiffness[:, 1:].ravel()
        return np.array([*head, *waves, *pieces[piece], law.breaks[piece], *powers, *table])

    def _expressions(self, contact):
        """Return (equations, distances from the flanks, velocity that may turn)."""
        import heyoka as hy

        x, v = hy.make_vars("x", "v")
        par, t, law = hy.par, hy.time, self.law
        near, far = (x - par[5] if law.upper != 0.0 else x), x + par[0]
        cubic, orders, sloped = self._shape(contact)

        def waves(first, orders):
            terms = []
            for j, order in enumerate(orders):
                terms.append(par[first + 2 * j] * hy.cos(order * t))
                terms.append(par[first + 2 * j + 1] * hy.sin(order * t))
            return terms

        drag = par[2]
        if self.turns[contact]:
            drag = drag + par[3] * v
        if cubic:
            drag = drag + par[4] * v * v
        force = hy.sum([par[1], *waves(7, self._orders)]) - drag * v
        if law.ground != 0.0:
            force = force - par[6] * x
        if contact != BACKLASH:
            k = 7 + 2 * len(self._orders)
            c = par[k] + par[k + 1] * (t - par[k + 2]) if sloped else par[k]
            c = hy.sum([c, *waves(k + 5, orders)])
            u = near if contact == NORMAL else far
            force = force - c * (u + (par[k + 3] + par[k + 4] * u) * u * u if self._curved else u)
        return [(x, v), (v, force)], (near, far), v


class _Run(Split):
    """One integrator, restarted for each phase."""

    def __init__(self, problem, model):
        super().__init__(problem)
        from heyoka import taylor_outcome

        self.model, self.OFF, self._end = model, model.OFF, taylor_outcome.time_limit

    def solve(self, n, start, end, z, segment, codes, exits):
        """Take one phase; see `Split`."""
        pace, unit = self.model.pace, self.model.unit
        made = self.model.branch(n, start, z, segment, codes, exits)
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
                hit = self._met(TURN * n + t, new, lines[which], exits)
            else:
                # x' turns.
                new[1] = 0.0
        if not self.keep:
            return Phase(t, new, hit)
        if dense is None:
            points = [(start, z), (t, new)]
            return Phase(t, new, hit, points, lambda times: np.repeat([new], len(times), 0))
        points = [(at / pace, dense(at) / unit) for at in dense.times]
        return Phase(t, new, hit, points, lambda times: dense(times * pace) / unit)

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
