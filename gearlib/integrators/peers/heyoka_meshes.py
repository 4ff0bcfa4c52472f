"""heyoka on piecewise-linear models: one integrator, terminal events on all flank lines.

Supports, shafts and lines of action are numbers of the expressions; what changes with stiffness
and contact, three factors of each flank, and with the tuning is a runtime parameter.
"""

import math
import threading

import numpy as np

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


def _integrator(problem, flanks, waves, tol):
    """Return (integrator, views of its state and parameters); time is theta.

    par[0] is the phase at which it begins, par[1] the tuning; three factors of each flank follow,
    then what is not zero of `waves`, shape (n + flanks, 2 h): the harmonics in the accelerations
    and in the rates of distances, which depend on the tuning.
    """
    import heyoka as hy

    system, grid, n = problem.system, problem.propagator.grid, problem.size // 2
    size = 2 * n + 1
    tables = system.free[n : 2 * n, :size], system.near, system.far, system.push, system.harmonics
    key = *(table.tobytes() for table in (*tables, waves != 0.0)), tuple(flanks), tol
    made = _COMPILED.integrators
    if key not in made:
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
        if len(made) == _MOST:
            made.clear()
        one = hy.taylor_adaptive(equations, [0.0] * (2 * n), t_events=events, tol=tol)
        made[key] = one, one.state, one.pars
    return made[key]


class Meshes:
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

    def branch(self, n, start, z, segment, codes, exits):
        """Return (integrator, views of its state and parameters, their values, lines met)."""
        values = self._parameters(segment, codes)
        values[0] = 2.0 * math.pi * n
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
