"""Installed peers beside the library's own solvers: one bouncing problem, one and six degrees.

A peer counts at its own default tolerances; its error is that of the state after 100 mesh periods
against the library's solver at rounding.
"""

import time

import numpy as np

from benchmarks.short import repeats
from gearlib import integrators, sweep
from gearlib.engines.orbit import Span

_TUNING, _REPEATS = 0.9, repeats(5)


def _runner(model, method):
    """Return periods -> (x, dx/dtau) of a method on a model, from rest."""
    _, module, options = integrators.choose_method(model, method, {})

    def run(periods):
        arguments = _TUNING, (0.0, 0.0), Span(periods, 1, 10**6)
        return module.run(model, *arguments, keep_events=False, **options).final

    return run


def _slope(run, short, long):
    """Return seconds per mesh period: the slope between the least times, as noise only adds."""
    least = []
    for periods in (short, long):
        times = []
        for _ in range(_REPEATS):
            start = time.perf_counter()
            run(periods)
            times.append(time.perf_counter() - start)
        least.append(min(times))
    return (least[1] - least[0]) / (long - short)


def _from_rest(pair):
    """Return seconds per mesh period of 50 from rest: a settled run is not gone through."""
    grid, periods = np.linspace(0.85, 1.0, 1024), 50
    times = []
    for _ in range(_REPEATS):
        start = time.perf_counter()
        sweep(pair, grid, periods=periods, record_periods=1, threads=1)
        times.append(time.perf_counter() - start)
    return min(times) / grid.size / periods


def rows(one, six):
    """Return rows (name, value, unit) of every installed peer on two models."""
    table = []
    for title, model in (("one degree", one), ("six degrees", six)):
        exact = _runner(model, "exact")
        own = _from_rest(model) if model is one else _slope(exact, 1_000, 21_000)
        table.append((f"{title}, a bounce in every period: exact", own * 1e6, "us per mesh period"))
        reference = exact(100)
        for method in integrators.methods():
            module = integrators.METHODS[method.name]
            if not (method.note and method.available and module.supports(model)):
                continue
            run = _runner(model, method.name)
            theirs = _slope(run, 20, 220)
            error = np.abs(run(100) - reference).max()
            table += [
                (f"  {method.name}", theirs * 1e6, f"us per mesh period, error {error:.1g}"),
                (f"  exact is faster than {method.name}", theirs / own, "times"),
            ]
    return table
