"""Whole runs from rest, what users compute, beside the yardstick in C++ where a compiler is.

Both are timed in turns, in processor seconds of one thread, of which the least counts: other work
on the machine only adds. The yardstick gives the state at the end, ours the summary as well.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.short import repeats
from gearlib import sweep
from gearlib.engines.pair.propagator import dimensionless_parameters

TUNINGS, ROUNDS = 4096, repeats(7)
#: Range of tunings, periods: the paper's characteristic, and where nothing settles.
CASES = ((0.5, 1.4, 120), (0.85, 1.0, 50))


def built(folder, name="yardstick"):
    """Return the path of a yardstick, built for this machine; None without a compiler."""
    compiler = shutil.which(os.environ.get("CXX", "g++")) or shutil.which("clang++")
    if compiler is None:
        return None
    program = Path(folder) / name
    source = Path(__file__).with_name(f"{name}.cpp")
    options = "-O3", "-march=native", "-std=c++17"
    subprocess.run([compiler, *options, "-o", program, source], check=True)
    return program


def least(call):
    """Return the fewer processor seconds of two calls."""
    times = []
    for _ in range(2):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


def by_yardstick(program, pair, first, last, periods):
    """Return (processor seconds, final states) of the yardstick."""
    words = [*dimensionless_parameters(pair)[:6], first, last, TUNINGS, periods, 2]
    done = subprocess.run(
        [program, *(repr(float(word)) for word in words)], check=True, capture_output=True
    )
    spent, *ends = map(float, done.stdout.split())
    return spent, np.reshape(ends, (-1, 2))


def fresh(command):
    """Return the processor seconds of a process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def rows(pair):
    """Return rows (name, value, unit) for a `GearPair`."""
    table = []
    with tempfile.TemporaryDirectory() as folder:
        program = built(folder)
        for first, last, periods in CASES:
            grid = np.linspace(first, last, TUNINGS)

            def ours(record, grid=grid, periods=periods):
                return sweep(pair, grid, periods=periods, record_periods=record, threads=1)

            ends = ours(1).final_state.values
            best = {}
            for _ in range(ROUNDS):
                for record in (1, 24):
                    spent = least(lambda record=record, ours=ours: ours(record))
                    best[record] = min(best.get(record, spent), spent)
                if program is not None:
                    spent, theirs = by_yardstick(program, pair, first, last, periods)
                    best["C++"] = min(best.get("C++", spent), spent)
            share = 1e9 / TUNINGS / periods
            title = f"{TUNINGS} runs from rest, {first} ... {last}, {periods} periods"
            table += [
                (f"{title}, 1 recorded", best[1] * share, "ns per mesh period"),
                ("  24 recorded", best[24] * share, "ns per mesh period"),
            ]
            if program is not None:
                table += [
                    ("  yardstick in C++, the final state", best["C++"] * share, ""),
                    ("  ours to C++, 1 recorded", best[1] / best["C++"], "times"),
                    ("  largest difference of final states", abs(ends - theirs).max(), ""),
                ]
    code = (
        "import numpy as np; from gearlib import GearPair, sweep;"
        "pair = GearPair.from_ratios(contact_ratio=1.569, stiffness_ratio=0.5879,"
        " damping=0.0617, backlash_damping=0.0617, backlash_ratio=4);"
        f"sweep(pair, np.linspace(0.5, 1.4, {TUNINGS}), periods=120, record_periods=24, threads=1)"
    )
    spent = min(fresh([sys.executable, "-c", code]) for _ in range(repeats(3)))
    table.append((f"fresh process: import, {TUNINGS} runs of 120 periods", spent, "s"))
    spent = least(lambda: sweep(pair, [0.9, 0.95], periods=10**7, record_periods=24, threads=1))
    table.append(("two tunings, 10^7 periods each", spent * 1e3, "ms"))
    return table
