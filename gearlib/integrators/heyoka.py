"""heyoka: Taylor steps of order 20 with terminal events on flank lines.

All numbers of an expression are runtime parameters: it is compiled once per thread, and other
models and tunings of the same structure cost nothing.
"""

import threading
from functools import lru_cache

import numpy as np

from gearlib import checks
from gearlib.engines.codes import BACKLASH, INVERSE
from gearlib.engines.taylor.series import damping_of
from gearlib.integrators.method import Integrator, Option, Package
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.split import Phase, Split, Stall


class Heyoka(Integrator):
    """The Taylor integrator of the package heyoka."""

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
        """Return True: the method can run all models."""
        return True

    def solver(self, model, tuning, span, tol):
        """Return the `Run` of a model at one tuning over a span of mesh periods."""
        kind = _Meshes if model.equation is None else _OneDegree
        return kind(problem_of(model, tuning), tol=tol)


@lru_cache(maxsize=64)
def _compiled(thread, equations, events, tol):
    """Return (integrator, views of its state and parameters) of a thread, which alone may use it.

    Events are pairs (expression, direction of its zero: 1, -1, or 0 for both).
    """
    import heyoka as hy

    ways = hy.event_direction.any, hy.event_direction.positive, hy.event_direction.negative
    # The automatic cooldown is infinite from rest on a line.
    terminal = [hy.t_event(line, direction=ways[i], cooldown=0.0) for line, i in events]
    start = [0.0] * len(equations)
    integrator = hy.taylor_adaptive(list(equations), start, t_events=terminal, tol=tol)
    return integrator, integrator.state, integrator.pars


class _Run(Split):
    """A run by compiled integrators, restarted for each phase."""

    def branch(self, turn, start, z, segment, codes, exits):
        """Return (integrator, views of its state and parameters, their values, lines met)."""
        raise NotImplementedError

    def compiled(self, equations, events):
        """Return (integrator, views of its state and parameters) of this thread."""
        return _compiled(
            threading.get_ident(), tuple(equations), tuple(events), self.settings["tol"]
        )

    def solve(self, turn, start, end, z, segment, codes, exits):
        """Take one phase; see `Split`."""
        from heyoka import taylor_outcome

        branch = self.branch(turn, start, z, segment, codes, exits)
        integrator, state, parameters, values, lines = branch
        # Parameters that no expression uses have no place.
        parameters[:], state[:] = values[: parameters.size], z
        integrator.time = start
        code, _, _, steps, dense, _ = integrator.propagate_until(end, c_output=self.keep)
        self.evaluations += steps * integrator.order
        t, new, hit = end, state.copy(), None
        if code != taylor_outcome.time_limit:
            t, event = integrator.time, -1 - int(code)
            if event < 0:
                raise Stall
            if event < len(lines):
                hit = self._exit_of(turn + t, new, lines[event], exits)
            else:
                # The velocity turns.
                new[1] = 0.0
        if not self.keep or dense is None:
            ends = np.array([start, t]), np.array([z, new])
            return Phase(*ends, hit, lambda phases: np.repeat([new], len(phases), 0))
        times = np.array(dense.times)
        states = dense(times)
        times[-1], states[-1] = t, new
        return Phase(times, states, hit, dense)

    def _exit_of(self, t, z, flank, exits):
        """Return which exit a flank is; leave one that is only touched, and return None."""
        mesh, line = flank
        speed = self.problem.speeds(t, z)[line][mesh]
        for i, leave in enumerate(exits):
            if leave[:2] == flank:
                if leave.direction * speed > 0.0:
                    return i
                speed = -leave.direction
        self.problem.put(t, z, mesh, line, self.away(z) * (1.0 if speed > 0.0 else -1.0))
        return None


class _OneDegree(_Run):
    """One degree of freedom: an integrator for each contact code and sign of x'."""

    #: Just above the rounding of a state on the far flank line.
    OFF = 1e-15

    def __init__(self, problem, tol):
        super().__init__(problem, tol=tol)
        self._branches: dict = {}

    def branch(self, turn, start, z, segment, codes, exits):
        """Return the branch of a segment, contact code and, if it matters, sign of x'."""
        contact, sign = int(codes[0]), 0
        if damping_of(self.problem.law, contact)[1] != 0.0:
            v = z[1] if z[1] != 0.0 else self.problem.rate(start, z, segment, codes)[1]
            sign = 1 if v >= 0.0 else -1
        key = segment, contact, sign
        if key not in self._branches:
            self._branches[key] = self._built(*key, exits)
        return self._branches[key]

    def _built(self, segment, contact, sign, exits):
        """Return a branch; `sign` is that of x', 0 without quadratic damping.

        With it, x' = 0 ends a step as well: behind it |x'| is another polynomial.
        """
        import heyoka as hy

        law, values, edges = self.problem.law, [], (self.problem.law.upper, self.problem.law.lower)
        x, v = hy.make_vars("x", "v")

        def parameter(value):
            values.append(value)
            return hy.par[len(values) - 1]

        def waves(table):
            terms = [
                parameter(factor) * wave(order * hy.time)
                for order, *factors in table.tolist()
                for factor, wave in zip(factors, (hy.cos, hy.sin), strict=True)
            ]
            return hy.sum(terms)

        d1, d2, d3 = damping_of(law, contact)
        drag = parameter(d1) + parameter(-d2 if sign < 0 else d2) * v + parameter(d3) * v * v
        force = waves(law.force) - drag * v - parameter(law.ground) * x
        if contact != BACKLASH:
            inverse = contact == INVERSE
            pieces = (law.far_pieces if inverse else law.pieces)[segment]
            harmonics = law.far_stiffness if inverse else law.stiffness
            inside = hy.time - parameter(law.breaks[segment])
            c = parameter(pieces[0]) + parameter(pieces[1]) * inside + waves(harmonics)
            u, (p2, p3) = x - parameter(edges[inverse]), law.powers
            force -= c * (u + (parameter(contact * p2) + parameter(p3) * u) * u * u)
        events = [(x - parameter(edges[leave.line]), leave.direction) for leave in exits]
        if sign:
            events.append((v, -sign))
        lines = [leave[:2] for leave in exits]
        return *self.compiled([(x, v), (v, force)], events), np.array(values), lines


class _Meshes(_Run):
    """Any number of meshes: one integrator, whose parameters are the matrix of a branch."""

    def __init__(self, problem, tol):
        import heyoka as hy

        super().__init__(problem, tol=tol)
        finite = np.isfinite(problem.gaps)
        self._flanks = [(j, line) for j in self.meshes for line in range(1 + finite[j])]
        distances = np.array([problem.distances[line, j] for j, line in self._flanks])
        self._couplings, in_distance = problem.couplings(), distances != 0.0
        self._values = np.concatenate([[0.0], distances[in_distance]])
        z = hy.make_vars(*(f"z{i}" for i in range(problem.size)))
        # Parameter 0 is the phase at which the mesh period begins.
        phases = [w * (hy.par[0] + hy.time) for w in problem.system.harmonics.tolist()]
        waves = [wave(phase) for phase in phases for wave in (hy.cos, hy.sin)]
        full, sums, k = [*z, hy.expression(1.0), *waves], [], 1
        for row in np.concatenate([in_distance, self._couplings]):
            columns = np.flatnonzero(row)
            sums.append(hy.sum([hy.par[k + i] * full[c] for i, c in enumerate(columns)]))
            k += columns.size
        events = [(distance, 0) for distance in sums[: len(self._flanks)]]
        equations = zip(z, sums[len(self._flanks) :], strict=True)
        self._integrator = self.compiled(equations, events)

    def branch(self, turn, start, z, segment, codes, exits):
        """Return the integrator with the parameters of a segment and contact codes."""
        self._values[0] = turn
        matrix = self.problem.matrix(segment, codes)[self._couplings]
        return *self._integrator, np.concatenate([self._values, matrix]), self._flanks


METHODS = {"heyoka": Heyoka()}
