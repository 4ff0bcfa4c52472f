"""What many points cost, in one job and in many: the numbers of docs/scaling.md.

``python -m benchmarks.scaling [points]`` sweeps, writes, reads and gathers that many tunings
(10^6 by default). Times are processor seconds of one thread, which other load on the machine
disturbs least; memory is the largest resident set of a process of its own.
"""

import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from itertools import chain
from pathlib import Path

import numpy as np

from benchmarks.run import machine, models
from gearlib import sweep
from gearlib.data import storage
from gearlib.data.gathering import gather_resonance

PERIODS = {"periods": 120, "record_periods": 24, "threads": 1}
ROOT = Path(__file__).resolve().parents[1]


def _in_child(results, function, arguments):
    start = time.process_time()
    value = function(*arguments)
    spent = time.process_time() - start
    results.put((value, spent, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024))


def alone(function, *arguments):
    """Return (value, processor seconds, largest MiB) of a call in a fresh process."""
    context = multiprocessing.get_context("spawn")
    results = context.Queue()
    child = context.Process(target=_in_child, args=(results, function, arguments))
    child.start()
    found = results.get()
    child.join()
    return found


def window(path, first, last, count, damping):
    """Sweep one window and write its file."""
    pair = models()[0].replace(material_damping=damping, backlash_damping=damping)
    dataset = sweep(pair, np.linspace(first, last, count, endpoint=False), **PERIODS)
    storage.write(dataset.assign_coords(damping="k", direction="cold"), path)


def shift(folder, shards, count):
    """Write as many shards of one curve: the numbers of one, its tunings moved along."""
    window(folder / "0.nc", 0.5, 0.6, count, 3953.7)
    first = storage.read(folder / "0.nc")
    for i in range(1, shards):
        storage.write(first.assign_coords(tuning=first.tuning + 0.1 * i), folder / f"{i}.nc")


def gather(paths, target):
    """Gather files as the workflow does."""
    storage.write(gather_resonance([storage.read(path) for path in paths]), target)


def nothing():
    """Do nothing, after the imports of this file."""


def grow_per_point(small, large, points):
    """Return what a measured pair (seconds, MiB) grows by, per point."""
    seconds = (large[1] - small[1]) / points
    return seconds, (large[2] - small[2]) * 2**20 / points


def sweeping(points, folder):
    """Yield rows (name, value, unit) on the windows of cold sweeps."""
    few, many = points // 40, points // 5
    for name, damping in (("damped", 3953.7), ("conservative, chaotic", 0.0)):
        small = alone(window, folder / "small.nc", 0.5, 1.4, few, damping)
        large = alone(window, folder / "large.nc", 0.5, 1.4, few + many, damping)
        seconds, memory = grow_per_point(small, large, many)
        size = (folder / "large.nc").stat().st_size / (few + many)
        yield f"a point of a cold sweep, {name}", seconds * 1e6, "us, written"
        yield "  in its shard", size, "bytes"
        yield "  in the memory of its job", memory, "bytes"


def gathering(points, folder):
    """Yield rows on gathering 5, 10 and 20 shards, `points` in all."""
    shards, each = 20, points // 20
    alone(shift, folder, shards, each)
    idle = alone(nothing)
    target = folder / "gathered.nc"
    for count in (5, 10, 20):
        paths = [folder / f"{i}.nc" for i in range(count)]
        _, seconds, memory = alone(gather, paths, target)
        n = count * each
        yield f"gathering {n:,} points from {count} shards", seconds / n * 1e6, "us a point"
        yield "  largest memory", memory, "MiB"
        yield "  above a job without points", (memory - idle[2]) * 2**20 / n, "bytes a point"
        yield "  the file", target.stat().st_size / n, "bytes a point"


def starts():
    """Yield rows: what it costs to start a job, and a Snakemake around it."""
    snakemake = str(Path(sys.executable).with_name("snakemake"))
    for name, command in (
        ("start of a script: numerical stack and kernels", [sys.executable, "-c", _SCRIPT]),
        ("start of a Snakemake", [snakemake, "-n", "results/kernels.sha256"]),
    ):
        seconds = []
        for _ in range(3):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        yield name, sorted(seconds)[1], "s"
    yield "memory of a job without points", alone(nothing)[2], "MiB"


_SCRIPT = "from gearlib import engines, sweep; engines.warm_up()"


def main(points=1_000_000):
    """Print a table of figures, one per line."""
    print(machine(), f"load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for name, value, unit in chain(
            gathering(points, folder), sweeping(points, folder), starts()
        ):
            print(f"{name:60s} {value:10.3g} {unit}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
