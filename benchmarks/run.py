"""Benchmarks of gearlib on this machine: ``make bench``.

Whole runs from rest come first (`from_rest`). Of the others times are medians of repeats after a
warm-up, single-threaded unless stated. They inform; no test depends on them. Where a cost per mesh
period is the slope between a short and a long run, the recorded revolution and the start of a run
do not count.
"""

import os
import platform
import statistics
import subprocess
import sys
import time

import numba
import numpy as np

import gearlib
from benchmarks import from_rest, geometry, peers, trains
from benchmarks.scipy_split import run as scipy_split
from benchmarks.short import SHORT, repeats
from gearlib import GearPair, OneDegreePair, SixDegreePair, simulate, sweep
from gearlib.engines import orbit
from gearlib.engines.orbit import Span
from gearlib.engines.polynomial import bernstein_matrix
from gearlib.engines.taylor.propagator import run_nonlinear
from gearlib.engines.taylor.series import ORDER
from gearlib.explorer.view import compute_view

REPEATS = repeats(7)
DAMPED = GearPair.from_ratios(
    contact_ratio=1.569,
    stiffness_ratio=0.5879,
    damping=0.0617,
    backlash_damping=0.0617,
    backlash_ratio=4,
)


def seconds(call):
    """Return the median time of `call` over the repeats, after one call not counted."""
    if not SHORT:
        call()
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def per_period(pair, grid, short=200, long=20_200, **options):
    """Return nanoseconds per mesh period and tuning of a sweep on one thread."""

    def run(periods):
        sweep(pair, grid, periods=periods, record_periods=1, threads=1, **options)

    extra = seconds(lambda: run(long)) - seconds(lambda: run(short))
    return extra / (long - short) / len(grid) * 1e9


def speed_up(pair, grid, periods=500):
    """Return how much faster two threads are than one on a cold sweep."""

    def run(threads):
        sweep(pair, grid, periods=periods, record_periods=1, threads=threads)

    return seconds(lambda: run(1)) / seconds(lambda: run(2))


def machine():
    """Return one line about processor, cores and versions."""
    model = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo") as file:
            model = next(line.split(":")[1].strip() for line in file if "model name" in line)
    except (OSError, StopIteration):
        pass
    return (
        f"{model}, {os.cpu_count()} cores; Python {platform.python_version()}, "
        f"numpy {np.__version__}, numba {numba.__version__}"
    )


def child(code):
    """Return the median time of a fresh Python process that runs `code`."""
    return seconds(lambda: subprocess.run([sys.executable, "-c", code], check=True))


def models():
    """Return the paper's pair, undamped, with cubic damping, and on soft bearings."""
    paper = GearPair(
        max_stiffness=4e8,
        stiffness_ratio=0.5879,
        contact_ratio=1.569,
        reduced_mass=3.123,
        load=3289.5396,
        backlash=40e-6,
    )
    cubic = OneDegreePair(pair=paper, cubic_damping=4e5, backlash_cubic_damping=4e5)
    body, bearing = 17.27, 3e7
    inertia = 2.0 * 0.01 / (1.0 / 3.123 - 2.0 / body)
    six = SixDegreePair(
        pair=paper.replace(material_damping=3953.7, backlash_damping=3953.7),
        base_radii=(0.1, 0.1),
        inertias=(inertia, inertia),
        masses=(body, body),
        bearing_stiffness=(bearing,) * 4,
        bearing_damping=(0.04 * (bearing * body) ** 0.5,) * 4,
    )
    return paper, cubic, six


def against_scipy():
    """Return rows that compare the event-driven solvers with scipy's DOP853, split at events.

    Errors are those of the final state after 20 mesh periods, against the library's solver at
    rounding; tests compare that with scipy at rtol 1e-13 and, where it exists, with 50 digits.
    """
    _, cubic, six = models()
    short, long, matrix = 20, 2000, bernstein_matrix(ORDER)
    samples, events = np.empty((0, orbit.SAMPLE_COLUMNS)), np.empty((0, orbit.EVENT_COLUMNS))
    summary = np.empty(orbit.SUMMARY_COLUMNS)

    def taylor(periods, tolerance):
        law = cubic.nonlinear_mesh(0.9, tolerance)
        start, rest = (0.0, 0.0, periods, 1), (10**6, summary, np.empty((0, 2, 2)))
        result = run_nonlinear(law, matrix, *start, samples, events, *rest)
        return np.array(result[:2])

    def exact_six(periods):
        propagator = six.propagator(0.9)
        start = propagator.initial_state((0.0, 0.0))
        return propagator.run(start, Span(periods, 1, 10**6), keep_events=False).final

    rows = []
    for name, model, rtol, run, reference in (
        ("cubic damping", cubic, 1e-11, lambda n: taylor(n, 1e-11), taylor(short, 1e-16)),
        ("six degrees", six, 1e-10, exact_six, exact_six(short)),
    ):
        start = time.perf_counter()
        theirs = np.array(scipy_split(model, 0.9, short, rtol=rtol)[:2])
        slow = (time.perf_counter() - start) / short
        fast = (seconds(lambda run=run: run(long)) - seconds(lambda run=run: run(short))) / (
            long - short
        )
        title = f"{name}, a bounce in every period"
        rows += [
            (f"{title}: gearlib", fast * 1e6, "us per mesh period"),
            ("  its error", abs(run(short) - reference).max(), "static deflections"),
            ("  scipy DOP853 split at events", slow * 1e6, "us per mesh period"),
            ("  its difference from the reference", abs(theirs - reference).max(), ""),
            ("  times faster", slow / fast, ""),
        ]
    return rows


def proofs():
    """Return rows with the time of proofs: of an orbit, of a range."""
    one = gearlib.periodic_orbit(models()[0].replace(material_damping=3953.7), 0.9)
    calls = {
        "certify an orbit of two contacts, 30 digits": lambda: gearlib.certify(one),
        "certify_range, 0.02 of tuning": lambda: gearlib.certify_range(one, to=0.88),
    }
    return [(name, seconds(call) * 1e3, "ms") for name, call in calls.items()]


def explorer():
    """Return rows with the time of one update of the explorer at 500 tunings."""
    pair = DAMPED.as_dict() | {"teeth": 24}
    damping = {name: pair.pop(name) for name in ("material_damping", "backlash_damping")}
    dampings = {"damped": damping, "conservative": dict.fromkeys(damping, 0.0)}
    mapping = {"gear_pair": pair, "dampings": dampings, "phase_planes": {"tunings": [0.9]}}
    return [
        (
            f"explorer, one update at 500 tunings, {name}",
            seconds(lambda name=name: compute_view(mapping, name)),
            "s",
        )
        for name in dampings
    ]


def main():
    """Print a table of figures, one per line."""
    print(machine())
    grid = np.linspace(0.5, 1.4, 901)
    one = {"periods": 120, "record_periods": 24}
    chaotic = DAMPED.replace(material_damping=0.0, backlash_damping=0.0)
    first_point = (
        "from gearlib import GearPair, simulate;"
        "simulate(GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=.6), .8, periods=9)"
    )
    rows = [
        (
            "cold sweep, conservative, chaotic, 901 tunings",
            per_period(chaotic, grid, 200, 700),
            "ns per mesh period",
        ),
        ("the same, 500 periods: two threads", speed_up(chaotic, grid), "times one"),
        (
            "simulate, 120 periods, 24 recorded, 256 samples each",
            seconds(lambda: simulate(DAMPED, 0.9, **one)) * 1e3,
            "ms",
        ),
        (
            "resonance characteristic, damped, 901 tunings x 120 periods, 1 thread",
            seconds(lambda: sweep(DAMPED, grid, threads=1, **one)) * 1e3,
            "ms",
        ),
        (
            "the same, all threads",
            seconds(lambda: sweep(DAMPED, grid, **one)) * 1e3,
            "ms",
        ),
        (
            "resonance characteristic, conservative, 1 thread",
            seconds(lambda: sweep(chaotic, grid, threads=1, **one)) * 1e3,
            "ms",
        ),
        ("fresh process: import gearlib", child("import gearlib"), "s"),
        ("fresh process, compiled kernels: first simulated point", child(first_point), "s"),
    ]
    paper, _, six = models()
    damped = paper.replace(material_damping=3953.7, backlash_damping=3953.7)
    rows = (
        from_rest.rows(DAMPED)
        + rows
        + proofs()
        + explorer()
        + against_scipy()
        + peers.rows(damped, six)
    )
    for name, value, unit in rows + geometry.rows() + trains.rows():
        print(f"{name:70s} {value:10.3g} {unit}")


if __name__ == "__main__":
    main()
