"""SUNDIALS CVODE with its root functions, restarted behind each (scikit-sundae)."""

from functools import partial

import numpy as np

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.option import Option
from gearlib.integrators.peers import contact_branches
from gearlib.integrators.peers.package import Package
from gearlib.integrators.right_hand_sides import problem_of
from gearlib.integrators.split import Phase, Split, Stall

PACKAGE = Package("sksundae", "scikit-sundae")
#: Variable: 1 to 12 with Adams, 1 to 5 with BDF.
ORDER = None
EVENTS = "switches end a run, contact is a root function"
MODELS = "all: one or six degrees of freedom, gear trains"
FORMULAS = ("Adams", "BDF")
OPTIONS = {
    "rtol": Option(1e-10, checks.finite_positive, "relative tolerance of a step"),
    "atol": Option(
        1e-10, checks.finite_positive, "absolute tolerance, static deflections and dx/dtau"
    ),
    "formula": Option("Adams", partial(checks.one_of, choices=FORMULAS), f"one of {FORMULAS}"),
}
#: Steps in one phase before the solver gives up; a phase takes hundreds.
_MOST_STEPS = 1_000_000
#: Status of a run that a root function ended.
_ROOT = 2


def takes(pair):
    """Return whether it takes a model: it takes all."""
    return True


def run(pair, tuning, state, *arguments, rtol, atol, formula):
    """Run one tuning; see `gearlib.integrators`."""
    problem = problem_of(pair, tuning)
    law = None if pair.equation is None else pair.law(tuning)
    options = {"rtol": rtol, "atol": atol, "method": formula, "max_num_steps": _MOST_STEPS}
    return _Run(problem, law, options).run(state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


class _Run(Split):
    """One CVODE memory for each branch, initialised anew for each phase."""

    def __init__(self, problem, law, options):
        super().__init__(problem)
        self.law, self.options = law, options
        self._solvers = {}
        #: Phase at which the mesh period starts, for what has not its period.
        self._turn = 0.0

    def _solver(self, segment, codes, exits):
        """Return (solver with root functions, solver without) of a branch."""
        key = segment, codes.tobytes()
        if key not in self._solvers:
            from sksundae.cvode import CVODE

            rate, lines = self._rate(segment, codes), self.problem.lines

            def roots(t, z, values):
                both = lines(self._turn + t, z)
                for i, leave in enumerate(exits):
                    values[i] = both[leave.line][leave.mesh]

            roots.terminal = [True] * len(exits)  # type: ignore[attr-defined]
            directions = [leave.direction for leave in exits]
            roots.direction = directions  # type: ignore[attr-defined]
            self._solvers[key] = (
                CVODE(rate, eventsfn=roots, num_events=len(exits), **self.options),
                CVODE(rate, **self.options),
            )
        return self._solvers[key]

    def _rate(self, segment, codes):
        if self.law is None:

            def rate(t, z, out):
                out[:] = self.problem.rate(self._turn + t, z, segment, codes)

        else:
            numbers = contact_branches.pack(self.law, segment, int(codes[0]))

            def rate(t, z, out):
                contact_branches.fill_rate(t, z, out, numbers)

        return rate

    def solve(self, n, start, end, z, segment, codes, exits):
        """Take one phase; see `Split`."""
        self._turn = 2.0 * np.pi * n
        solver, plain = self._solver(segment, codes, exits)
        if self.keep:
            done = solver.solve([start, end], z)
        else:
            solver.init_step(start, z)
            done = solver.step(end, tstop=end)
        if not done.success:
            raise Stall
        self.evaluations += done.nfev
        hit = None
        # The table of roots is that of an earlier phase where none was found in this one.
        if done.status == _ROOT:
            hit = int(np.flatnonzero(np.atleast_2d(done.i_events)[-1])[0])
        if not self.keep:
            return Phase(float(done.t), done.y.copy(), hit)
        t, z0 = float(done.t[-1]), z

        def dense(times):
            # The solver shows its interpolant only at times it is given; evaluations for the
            # record are not counted.
            inside = (times > start) & (times < t)
            if not inside.any():
                return np.repeat([z0], len(times), 0)
            states = plain.solve(np.concatenate([[start], times[inside], [end]]), z0).y
            out = np.empty((len(times), len(z0)))
            out[times <= start], out[times >= t] = z0, done.y[-1]
            out[inside] = states[1:-1]
            return out

        points = list(zip(done.t, done.y, strict=True))
        return Phase(t, done.y[-1].copy(), hit, points, dense)
