"""heyoka on gear trains: one integrator of a train, terminal events on all flank lines.

Supports, shafts and lines of action are numbers of the expressions; what changes with stiffness
and contact, three factors of each flank, is a runtime parameter.
"""

import math
import threading

import numpy as np

from gearlib.integrators.trains_in_python import Phase, Split, Stall
from gearlib.kernels.codes import BACKLASH, NORMAL


class _Compiled(threading.local):
    """The integrators of this thread: they hold state, so threads cannot share them."""

    def __init__(self):
        self.integrators = {}


_COMPILED = _Compiled()
#: So many trains are kept.
_MOST = 32


def _weighted(row, values):
    """Return the terms of a row times expressions, without those that are zero."""
    return [float(row[i]) * values[i] for i in np.flatnonzero(row)]


def _integrator(problem, flanks, tol):
    """Return (integrator, views of its state and parameters); time is theta, par[0] the phase."""
    import heyoka as hy

    system, grid, n = problem.system, problem.grid, problem.size // 2
    tables = system.free, system.near, system.far, system.push, system.harmonics
    tuning = problem.tuning if system.harmonics.size else None
    key = *(table.tobytes() for table in tables), tuple(flanks), tuning, tol
    made = _COMPILED.integrators
    if key not in made:
        z = hy.make_vars(*(f"z{i}" for i in range(2 * n)))
        full = [*z, hy.expression(1.0)]
        for frequency in system.harmonics.tolist():
            phase = frequency * (hy.par[0] + problem.tuning * hy.time)
            full += [hy.cos(phase), hy.sin(phase)]
        sums = [_weighted(system.free[n + i], full) for i in range(n)]
        events = []
        for k, (j, line) in enumerate(flanks):
            functional = (system.near, system.far)[line][j]
            rate = (grid.rate, grid.far_rate)[line][j]
            distance = hy.sum(_weighted(functional, full))
            events.append(hy.t_event(distance, cooldown=0.0))
            elastic, more, across = (hy.par[1 + 3 * k + i] for i in range(3))
            along = elastic * distance + more * hy.sum(_weighted(rate, full))
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
        if len(made) == _MOST:
            made.clear()
        one = hy.taylor_adaptive(equations, [0.0] * (2 * n), t_events=events, tol=tol)
        made[key] = one, one.state, one.pars
    return made[key]


class Run(Split):
    """One integrator, restarted for each phase."""

    def __init__(self, problem, tol):
        super().__init__(problem)
        from heyoka import taylor_outcome

        self._end = taylor_outcome.time_limit
        finite = np.isfinite(problem.gaps)
        self.flanks = [(j, line) for j in problem.meshes for line in range(1 + finite[j])]
        self._integrator, self._state, self._pars = _integrator(problem, self.flanks, tol)
        self._factors: dict = {}

    def _parameters(self, segment, codes):
        """Return the factors of all flanks: 0 where they are not in contact."""
        key = segment, codes.tobytes()
        if key not in self._factors:
            system, n = self.problem.system, self.problem.size // 2
            rows = np.zeros((len(self.flanks), 3))
            for row, (j, line) in zip(rows, self.flanks, strict=True):
                if codes[j] != BACKLASH and (codes[j] == NORMAL) == (line == 0):
                    own = (system.near, system.far)[line][j]
                    k = int(np.abs(own[:n]).argmax())
                    grip = system.grip[j, system.effect[codes[j] + 1, segment, j]]
                    row[:] = np.array([grip[0, k], grip[0, n + k], grip[1, k]]) / own[k]
            self._factors[key] = np.concatenate([[0.0], rows.ravel()])
        return self._factors[key]

    def solve(self, start, end, z, segment, codes, exits):
        """Take one phase; see `gearlib.integrators.trains_in_python.Split`."""
        integrator, nu = self._integrator, self.problem.tuning
        self._pars[:] = self._parameters(segment, codes)[: self._pars.size]
        # Phases count from the start of the mesh period, so that rounding does not grow.
        base = 2.0 * math.pi * math.floor((start + 1e-9) / (2.0 * math.pi))
        if self.problem.system.harmonics.size:
            self._pars[0] = base
        self._state[:] = z
        integrator.time = (start - base) / nu
        limit = (end - base) / nu
        code, _, _, steps, dense, _ = integrator.propagate_until(limit, c_output=self.keep)
        self.evaluations += steps * integrator.order
        t, hit, new = end, None, self._state.copy()
        if code != self._end:
            t, which = base + nu * integrator.time, -1 - int(code)
            if not 0 <= which < len(self.flanks):
                raise Stall
            hit = self._met(t, new, self.flanks[which], exits)
        if not self.keep:
            return Phase(t, new, hit)
        if dense is None:
            return Phase(t, new, hit, [(start, z), (t, new)], lambda at: z)
        points = [(base + nu * at, dense(at).copy()) for at in dense.times]
        return Phase(t, new, hit, points, lambda at: dense((at - base) / nu).copy())

    def _met(self, t, z, flank, exits):
        """Return a flank that ends the contact of its mesh; one that is only touched is left."""
        problem, (j, line) = self.problem, flank
        speed = (problem.grid.rate, problem.grid.far_rate)[line][j] @ problem.full(t, z)
        side = 1 if speed > 0.0 else -1
        if any(leave[:3] == (j, line, side) for leave in exits):
            return flank
        problem.off(t, z, j, line, side)
        return None
