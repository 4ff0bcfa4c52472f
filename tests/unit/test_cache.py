"""The cache of machine code: many processes, signatures and processors in one folder."""

import os
import subprocess
import sys
import tempfile

import pytest

from gearlib.kernels.cache import KeyedFiles, _temporary_folder, remove_unused

#: A kernel for two types of argument, which the processes meet in different order.
PROGRAM = """
import sys
import kernels
for value in [2, 0.5][:: int(sys.argv[1])]:
    assert kernels.twice(value) == 2 * value and type(kernels.twice(value)) is type(value)
print(sum(kernels.twice.stats.cache_misses.values()))
"""
#: What is looked for in the cache after a warm-up, as when workers and jobs have had theirs.
ASKED = """
from gearlib.kernels.cache import KeyedFiles
asked, load = [], KeyedFiles.load
def noted(files, key):
    asked.append(files._index_name)
    return load(files, key)
KeyedFiles.load = noted
{warm}
before = len(asked)
{then}
print(before > 0, asked[before:])
"""
#: Of a gear pair, and of the job that compiles kernels of larger models: imports, warm-up, runs.
WARM = {
    "pair": (
        "from gearlib import kernels, simulate, sweep\nfrom tests.paper import PAPER\n",
        "kernels.warm_up()",
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
#: A kernel that another one calls with a constant, and with what is none.
CONSTANTS = """
from gearlib.kernels.jit import kernel

@kernel
def plus(x, n):
    return x + n

@kernel
def both(x, n):
    return plus(x, 3) + plus(x, n)

@kernel
def thrice(x, n):
    return 3 * plus(x, n)
"""
KERNELS = """
from gearlib.kernels.jit import kernel

@kernel
def half_of_it(x):
    return x

@kernel
def twice(x):
    return half_of_it(x) + half_of_it(x)
"""


def start(folder, program, *arguments):
    """Start a process that runs a program, its machine code under `folder`."""
    # By the folder of this checkout: an installed one may be another.
    path = os.pathsep.join([str(folder), os.getcwd()])
    return subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_processes_that_compile_at_once_into_an_empty_folder(tmp_path):
    (tmp_path / "kernels.py").write_text(KERNELS, encoding="utf-8")
    for orders in (["1", "-1", "1"], ["1"]):
        for process in [start(tmp_path, PROGRAM, order) for order in orders]:
            out, err = process.communicate(timeout=600)
            assert process.returncode == 0, err
    assert int(out) == 0, "the last process had to compile what the others had compiled"
    names = [path.name for path in (tmp_path / "cache").rglob("*.*")]
    assert len(names) == 4 and all(name.endswith(".nbc") for name in names)


@pytest.mark.parametrize("name", WARM)
def test_after_the_warm_up_nothing_is_compiled(name):
    # Of this process's folder: from nothing it would take half a minute of processor time.
    imports, warm, then = WARM[name]
    program = imports + ASKED.format(warm=warm, then=then)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == "True []\n", done.stdout + done.stderr


def test_a_constant_in_a_call_compiles_nothing_anew(tmp_path):
    (tmp_path / "kernels.py").write_text(CONSTANTS, encoding="utf-8")
    saved = []
    # The second caller takes `plus` from its file.
    for program, printed in (("both(0.5, 4)", "8.0\n"), ("thrice(0.5, 4)", "13.5\n")):
        run = start(tmp_path, f"import kernels; print(kernels.{program})")
        out, err = run.communicate(timeout=600)
        assert out == printed, err
        (file,) = (tmp_path / "cache").rglob("kernels.plus*.part*")
        saved.append(file.stat().st_mtime_ns)
    assert saved[0] == saved[1]


def test_an_edited_kernel_outside_of_core_is_compiled_anew(tmp_path):
    # Where it stands and what calls it stay as they are: to numba `twice` is the same as before.
    for text, printed in (
        (KERNELS, "2.5"),
        (KERNELS.replace("return x\n", "return 2 * x\n"), "5.0"),
    ):
        (tmp_path / "kernels.py").write_text(text, encoding="utf-8")
        process = start(tmp_path, "import kernels; print(kernels.twice(1.25))")
        assert process.communicate(timeout=600)[0].strip() == printed


def test_unused_folders_are_removed(tmp_path):
    now, day = 2e9, 24 * 3600.0
    ages = {"kernels-" + "0" * 16: 29, "kernels-" + "1" * 16: 31, "kernels-mine": 31, "other": 31}
    for name, age in ages.items():
        (tmp_path / name / "core").mkdir(parents=True)
        (tmp_path / name / "core/code.nbc").touch()
        os.utime(tmp_path / name, times=(now - age * day,) * 2)
    remove_unused(tmp_path, now)
    assert sorted(ages.keys() - {path.name for path in tmp_path.iterdir()}) == [
        "kernels-" + "1" * 16
    ]


def test_a_start_marks_its_folder_as_used_and_a_first_one_clears_up(tmp_path):
    left = tmp_path / "cache" / ("kernels-" + "0" * 16)
    left.mkdir(parents=True)
    os.utime(left, times=(0, 0))
    start(tmp_path, "import gearlib.kernels.cache").communicate(timeout=600)
    (folder,) = (tmp_path / "cache").iterdir()
    assert folder != left
    os.utime(folder, times=(0, 0))
    start(tmp_path, "import gearlib.kernels.cache").communicate(timeout=600)
    assert folder.stat().st_mtime > 0


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


def test_a_temporary_folder_of_somebody_else_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    own = _temporary_folder()
    assert os.path.dirname(own) == str(tmp_path) and own == _temporary_folder()
    owner = os.getuid()
    (tmp_path / f"gearlib-{owner + 1}").mkdir()
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    other = _temporary_folder()
    assert not os.listdir(other) and other not in (own, str(tmp_path / f"gearlib-{owner + 1}"))


def test_who_waits_for_machine_code_at_a_terminal_is_told_once(tmp_path):
    (tmp_path / "kernels.py").write_text(
        "from gearlib.kernels.jit import kernel\n\n\n@kernel\ndef twice(value):\n"
        "    return 2 * value\n",
        encoding="utf-8",
    )

    def said(terminal, cache="cache"):
        reader, writer = os.openpty() if terminal else os.pipe()
        program = "import kernels; kernels.twice(2); kernels.twice(0.5)"
        subprocess.run(
            [sys.executable, "-c", program],
            stderr=writer,
            check=True,
            cwd=tmp_path,
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / cache)},
        )
        os.write(writer, b".\n")
        text = ""
        # A terminal may hand on its lines one by one.
        while not text.endswith((".\n", ".\r\n")):
            text += os.read(reader, 10_000).decode()
        os.close(reader), os.close(writer)
        return text.splitlines()[:-1]

    assert said(terminal=False, cache="another") == []
    assert len(said(terminal=True)) == 1
    assert said(terminal=True) == []
