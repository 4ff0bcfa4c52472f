"""The folder of machine code: which one is taken; what is compiled into it."""

import os
import subprocess
import sys
import tempfile

import pytest

from gearlib.engines.cache import cache_folder

#: Says whether the warm-up met kernels, and how many were compiled after it.
COUNTED = """
def compiled():
    modules = [m for name, m in sys.modules.items() if name.startswith("gearlib.engines")]
    kernels = {{id(k): k for m in modules for k in vars(m).values() if hasattr(k, "py_func")}}
    stats = [kernel.stats for kernel in kernels.values()]
    return len(stats), sum(sum(one.cache_misses.values()) for one in stats)
{warm}
kernels, before = compiled()
{then}
print(kernels > 0, compiled()[1] - before)
"""
#: Of a gear pair, and of the job that compiles kernels of larger models: imports, warm-up, runs.
WARM = {
    "pair": (
        "import sys\nfrom gearlib import engines, simulate, sweep\nfrom tests.paper import PAPER\n",
        "engines.warm_up()",
        """
simulate(PAPER, 0.9, periods=3)
for direction in ("cold", "up", "down"):
    sweep(PAPER, [0.8, 0.9], direction=direction, periods=3, record_periods=1)
""",
    ),
    "larger": (
        """
import sys
sys.path.insert(0, "workflow/scripts")
import compile_larger_kernels as job
from gearlib import simulate
models = list(job.models())
""",
        "for model in models: job.run(model)",
        "for model in models: simulate(model, 0.9, periods=3)",
    ),
}
KERNELS = """
from gearlib.engines.jit import kernel

@kernel
def half_of_it(x):
    return x

@kernel
def twice(x):
    return half_of_it(x) + half_of_it(x)
"""
PROGRAM = """
import kernels
assert kernels.twice(1.25) == 2.5
print(sum(kernels.twice.stats.cache_misses.values()))
"""


def start(folder, program):
    """Start a process that runs a program, its machine code under `folder`."""
    # This checkout comes first: an installed one may be another.
    path = os.pathsep.join([str(folder), os.getcwd(), os.environ["PYTHONPATH"]])
    return subprocess.Popen(
        [sys.executable, "-c", program],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_processes_that_compile_at_once_into_an_empty_folder(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNELS, encoding="utf-8")
    for count in (3, 1):
        for process in [start(tmp_path, PROGRAM) for _ in range(count)]:
            out, err = process.communicate(timeout=600)
            assert process.returncode == 0, err
    assert int(out) == 0, "the last process had to compile what the others had compiled"


@pytest.mark.parametrize("name", WARM)
def test_after_the_warm_up_nothing_is_compiled(name):
    # Of this process's folder: from nothing it would take a minute of processor time.
    imports, warm, then = WARM[name]
    program = imports + COUNTED.format(warm=warm, then=then)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == "True 0\n", done.stdout + done.stderr


def test_where_nothing_can_be_written_a_temporary_folder_is_taken(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = cache_folder()
    assert os.path.dirname(folder) == str(tmp_path / f"gearlib-{os.getuid()}")
    assert os.path.isdir(folder)
