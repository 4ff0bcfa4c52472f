"""The cache of machine code: many processes, signatures and processors in one folder."""

import os
import subprocess
import sys

import pytest

from gearlib.core.cache import KeyedFiles

#: A kernel for two types of argument, which the processes meet in different order.
PROGRAM = """
import sys
import kernels
for value in [2, 0.5][:: int(sys.argv[1])]:
    assert kernels.twice(value) == 2 * value and type(kernels.twice(value)) is type(value)
print(sum(kernels.twice.stats.cache_misses.values()))
"""
KERNELS = """
from gearlib.core.jit import kernel

@kernel
def half_of_it(x):
    return x

@kernel
def twice(x):
    return half_of_it(x) + half_of_it(x)
"""


def start(folder, order):
    """Start a process that calls the kernels, its machine code under `folder`."""
    # By the folder of this checkout: an installed one may be another.
    path = os.pathsep.join([str(folder), os.getcwd()])
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, order],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_processes_that_compile_at_once_into_an_empty_folder(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNELS, encoding="utf-8")
    for orders in (["1", "-1", "1"], ["1"]):
        for process in [start(tmp_path, order) for order in orders]:
            out, err = process.communicate(timeout=120)
            assert process.returncode == 0, err
    assert int(out) == 0, "the last process had to compile what the others had compiled"
    names = [path.name for path in (tmp_path / "cache").rglob("*.*")]
    assert len(names) == 4 and all(name.endswith(".nbc") for name in names)


def test_two_writers_keep_their_entries_apart(tmp_path):
    # The interleaving in which numba's index would give both keys one file: the second writer
    # saves while the first is between its entry and its code.
    first, second = (KeyedFiles(str(tmp_path), "kernel", None) for _ in range(2))
    save = first._save_data

    def interrupted(name, data):
        second.save("node B", "code for B")
        save(name, data)

    first._save_data = interrupted
    first.save("node A", "code for A")
    fresh = KeyedFiles(str(tmp_path), "kernel", None)
    assert (fresh.load("node A"), fresh.load("node B")) == ("code for A", "code for B")


@pytest.mark.parametrize("length", [0, 1, 20])
def test_damaged_file_counts_as_none(tmp_path, length):
    files = KeyedFiles(str(tmp_path), "kernel", None)
    files.save("key", "code" * 10)
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:length])
    assert files.load("key") is None
    files.save("key", "code")
    assert files.load("key") == "code"


def test_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    files = KeyedFiles(str(tmp_path / "file"), "kernel", None)
    files.save("key", "code")
    assert files.load("key") is None
