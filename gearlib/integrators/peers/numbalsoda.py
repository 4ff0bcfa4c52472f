"""numbalsoda: DOP853 in Fortran with its events, restarted at switches and at contact."""

import math
from functools import cache, partial

import numpy as np

from gearlib import checks
from gearlib.integrators.each import run_each
from gearlib.integrators.one_degree import MODELS, takes
from gearlib.integrators.option import Option
from gearlib.integrators.peers import contact_branches
from gearlib.integrators.peers.package import Package
from gearlib.integrators.problems import problem_of
from gearlib.integrators.split import Phase, Split, Stall

__all__ = ["EVENTS", "MODELS", "OPTIONS", "ORDER", "PACKAGE", "run", "run_many", "takes"]

PACKAGE = Package("numbalsoda", "numbalsoda", "it is built on the spot, which takes gfortran")
ORDER = 8
EVENTS = "switches end a run, contact is a terminal event, polished by a Taylor step"
OPTIONS = {
    "rtol": Option(1e-10, checks.finite_positive, "relative tolerance of a step"),
    "atol": Option(
        1e-10, checks.finite_positive, "absolute tolerance, static deflections and dx/dtau"
    ),
}
_NONE = np.empty(0)


def run(pair, tuning, state, *arguments, rtol, atol):
    """Run one tuning; see `gearlib.integrators`."""
    law = pair.law(tuning)
    return _Run(problem_of(pair, tuning), law, rtol, atol).run(tuning, state, *arguments)


def run_many(pair, *arguments, **options):
    """Run many tunings; see `gearlib.integrators`."""
    run_each(partial(run, pair, **options), *arguments)


@cache
def _compiled():
    """Return (addresses of right-hand side and events, compiled phase)."""
    from numba import cfunc, njit, types
    from numbalsoda import solve_ivp

    acceleration = contact_branches.acceleration
    pointer = types.CPointer(types.double)
    signature = types.void(types.double, pointer, pointer, pointer)

    @cfunc(signature)
    def rate(t, z, out, numbers):
        out[0] = z[1]
        out[1] = acceleration(t, z[0], z[1], numbers)

    @cfunc(signature)
    def events(t, z, out, numbers):
        if numbers[6] == 0.0:
            out[0] = z[0]
            if numbers[7] < math.inf:
                out[1] = z[0] + numbers[7]
        else:
            out[0] = z[0] + numbers[7]

    @njit(error_model="numpy")
    def phase(rate, events, start, end, z, numbers, count, rtol, atol, times):
        span = np.array([start, end])
        if times.size > 0:
            count = 0
        done = solve_ivp(
            rate, span, z, times, "DOP853", count, events, numbers.ctypes.data, 0.0, 0.0, rtol, atol
        )
        t, y, hit = done.t, done.y, -1
        new = np.empty(2)
        if done.success:
            if done.event_found:
                hit, at = done.ind_event, done.t_event
                x, v = done.y_event
                line = -numbers[7] if (numbers[6] != 0.0 or hit == 1) else 0.0
                # The package locates an event to 1e-8; a step of second order does the rest.
                h, a = (line - x) / v, acceleration(at, x, v, numbers)
                if abs(h) < 1e-6:
                    at, x, v = at + h, x + h * (v + 0.5 * h * a), v + h * a
                new[0], new[1], end = x, v, at
            elif t.size > 0:
                new[:] = y[-1]
        return done.success, end, new, hit, done.nfev, t, y

    return (rate.address, events.address), phase


class _Run(Split):
    """A new run for each phase."""

    def __init__(self, problem, law, *options):
        super().__init__(problem)
        self.law, self.options = law, options
        self.addresses, self.phase = _compiled()
        self._branches = {}

    def _branch(self, piece, contact):
        key = piece, contact
        if key not in self._branches:
            numbers = contact_branches.pack(self.law, piece, contact)
            self._branches[key] = numbers, len(self.exits[contact]), *self.options
        return self._branches[key]

    def solve(self, n, start, end, z, piece, contact, keep):
        """Take one phase; see `Split`."""
        before = *self.addresses, start, end, z, *self._branch(piece, contact)
        good, t, after, hit, evaluations, ends, states = self.phase(*before, _NONE)
        if not good:
            raise Stall
        self.evaluations += evaluations
        hit = None if hit < 0 else hit
        if not keep:
            return Phase(t, after, hit)
        points = [*zip(ends, states, strict=True), (t, after.copy())]
        # Evaluations for the record do not count.
        return Phase(t, after, hit, points, lambda times: self.phase(*before, times)[-1])
