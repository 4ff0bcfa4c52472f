"""The folder of machine code: which one is taken; what is compiled into it."""

import os
import subprocess
import sys
import tempfile

from gearlib.engines.cache import cache_folder

KERNELS = """
from gearlib.engines.jit import kernel

@kernel
def half(x):
    return x

@kernel
def twice(x):
    return half(x) + half(x)
"""
PROGRAM = """
import kernels
assert kernels.twice(1.25) == 2.5
print(sum(kernels.twice.stats.cache_misses.values()))
"""


def test_processes_that_compile_at_once_share_a_folder(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNELS, encoding="utf-8")
    # This checkout comes first: an installed one may be another.
    path = os.pathsep.join([str(tmp_path), os.getcwd(), os.environ["PYTHONPATH"]])
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": path}
    command, pipe = [sys.executable, "-c", PROGRAM], subprocess.PIPE
    for count in (2, 1):
        starts = [subprocess.Popen(command, env=environment, stdout=pipe) for _ in range(count)]
        outputs = [process.communicate(timeout=600)[0] for process in starts]
        assert not any(process.returncode for process in starts)
    assert int(outputs[-1]) == 0, "the last process had to compile what was compiled before"


def test_where_nothing_can_be_written_a_temporary_folder_is_taken(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = cache_folder()
    assert os.path.dirname(folder) == str(tmp_path / f"gearlib-{os.getuid()}")
    assert os.path.isdir(folder)
