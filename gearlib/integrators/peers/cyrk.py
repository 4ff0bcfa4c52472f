"""CyRK: Runge-Kutta pairs in C++, restarted at the crossings found on their dense output.

Its compiled entry knows no events, and its Python entry, which does, takes twenty times as long. So
a branch is run to its end, and what lies behind a crossing is thrown away.
"""

from functools import cache, partial

import numpy as np

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.one_degree import MODELS, takes
from gearlib.integrators.option import Option
from gearlib.integrators.peers import contact_branches
from gearlib.integrators.peers.package import Package
from gearlib.integrators.problems import problem_of
from gearlib.integrators.split import NEAR, Phase, Split, Stall

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "PACKAGE", "run", "run_many", "takes"]

PACKAGE = Package("CyRK", "CyRK")
#: That of the solver.
ORDER = None
EVENTS = "switches end a run; signs at step ends, crossings on the dense output"
#: Evaluations of a step, which the package does not count.
STAGES = {"DOP853": 12, "RK45": 6, "Tsit5": 6, "Vern7": 10, "Vern8": 13}
OPTIONS = {
    "rtol": Option(1e-10, checks.finite_positive, "relative tolerance of a step"),
    "atol": Option(
        1e-10, checks.finite_positive, "absolute tolerance, static deflections and dx/dtau"
    ),
    "solver": Option(
        "DOP853", partial(checks.one_of, choices=tuple(STAGES)), f"one of {tuple(STAGES)}"
    ),
}
_NONE = np.empty(0)


def run(pair, tuning, state, *arguments, rtol, atol, solver):
    """Run one tuning; see `gearlib.integrators`."""
    law = pair.law(tuning)
    return _Run(problem_of(pair, tuning), law, solver, rtol, atol).run(tuning, state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


@cache
def _compiled():
    """Return (address of the right-hand side, compiled phase)."""
    from CyRK import cyjit, nbsolve2_ivp
    from numba import njit

    acceleration = contact_branches.acceleration

    @cyjit
    def rate(out, t, z, numbers):
        out[0] = z[1]
        out[1] = acceleration(t, z[0], z[1], numbers)

    @njit
    def root_of(solution, shift, a, b, t):
        """Return where x + shift vanishes on a dense output between a and b, by Newton from t."""
        up = solution.call(b)[0, 0] + shift > 0.0
        for _ in range(60):
            z = solution.call(t)
            g = z[0, 0] + shift
            if (g > 0.0) == up:
                b = t
            else:
                a = t
            new = t - g / z[1, 0]
            if not a <= new <= b:
                new = 0.5 * (a + b)
            if abs(new - t) <= 1e-15 * (1.0 + abs(t)):
                return new
            t = new
        return t

    @njit(error_model="numpy")
    def phase(address, start, end, z, numbers, exits, solver, rtol, atol, keep, times):
        solution = nbsolve2_ivp(address, (start, end), z, solver, None, True, numbers, rtol, atol)
        good, steps = solution.success, solution.steps_taken
        t, hit, last = end, -1, 0
        ends, states = _NONE, np.empty((0, 2))
        values = np.empty((times.size, 2))
        z = z.copy()
        if good:
            x, at = solution.y[0], solution.t
            last = at.size - 1
            for i in range(1, at.size):
                for j in range(exits.shape[0]):
                    shift, direction = exits[j]
                    g0, g1 = direction * (x[i - 1] + shift), direction * (x[i] + shift)
                    if g0 < 0.0 <= g1:
                        guess = at[i - 1] - g0 / (g1 - g0) * (at[i] - at[i - 1])
                        root = root_of(solution, shift, at[i - 1], at[i], guess)
                        if hit < 0 or root < t:
                            t, hit = root, j
                if hit >= 0:
                    last = i - 1
                    break
            z[:] = solution.y[:, last] if hit < 0 else solution.call(t)[:, 0]
            if keep:
                ends, states = at[: last + 1].copy(), solution.y[:, : last + 1].T.copy()
                for k in range(times.size):
                    values[k] = solution.call(times[k])[:, 0]
        solution.free()
        return good, t, z, hit, steps, ends, states, values

    return rate.address, phase


class _Run(Split):
    """A new solution for each phase."""

    def __init__(self, problem, law, *options):
        super().__init__(problem)
        self.law, self.options = law, options
        self.address, self.phase = _compiled()
        self._branches = {}

    def _branch(self, piece, contact):
        key = piece, contact
        if key not in self._branches:
            exits = [
                (0.0 if leave.line == NEAR else self.law.gap, leave.direction)
                for leave in self.exits[contact]
            ]
            numbers = contact_branches.pack(self.law, piece, contact)
            self._branches[key] = numbers, np.array(exits, dtype=float)
        return self._branches[key]

    def solve(self, n, start, end, z, piece, contact, keep):
        """Take one phase; see `Split`."""
        numbers, exits = self._branch(piece, contact)
        before = self.address, start, end, z, numbers, exits, *self.options
        good, t, after, hit, steps, ends, states, _ = self.phase(*before, keep, _NONE)
        if not good:
            raise Stall
        self.evaluations += steps * STAGES[self.options[0]]
        hit = None if hit < 0 else hit
        if not keep:
            return Phase(t, after, hit)
        points = [*zip(ends, states, strict=True), (t, after.copy())]
        # The dense output is freed with the solution; evaluations for the record do not count.
        return Phase(t, after, hit, points, lambda times: self.phase(*before, True, times)[-1])
