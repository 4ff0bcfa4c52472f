"""Settings of one instruction set: where they apply, and that libraries take them."""

import os
import platform
import subprocess
import sys

import pytest

from gearlib import processor
from tests.workflow.recorder import code_taken

V3 = processor.LEVEL | {"fpu", "sse2"}

needs_settings = pytest.mark.skipif(
    not processor.settings(), reason="this processor has no settings"
)


def python(code, *options, environment):
    """Return what a process prints, which has to be silent otherwise."""
    done = subprocess.run(
        [sys.executable, *options, "-c", code], env=environment, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_processors_with_the_level_get_the_same_settings():
    plain = processor.settings({}, V3)
    assert plain == processor.settings({}, V3 | {"avx512f", "avx512vl"})
    assert plain["OPENBLAS_CORETYPE"] == "Haswell"
    # As words of a shell they need no quotes.
    assert not any(set(value) & set(" \t'\"$&;") for value in plain.values())


@pytest.mark.parametrize("lacking", sorted(processor.LEVEL))
def test_processors_below_the_level_are_left_alone(lacking):
    assert processor.settings({}, V3 - {lacking}) == {}


def test_other_processors_are_left_alone(monkeypatch, tmp_path):
    assert processor.settings({}, {"fp", "asimd", "sve"}) == {}
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    assert processor.features() == set()
    assert processor.settings({}) == {}
    # Where Linux does not say.
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    monkeypatch.setattr(processor, "Path", lambda path: tmp_path / "nothing")
    assert processor.settings({}) == {}


def test_they_can_be_switched_off():
    assert processor.settings({processor.SWITCH: "native"}, V3) == {}


def test_other_tunables_of_the_c_library_are_kept():
    given = {"GLIBC_TUNABLES": "glibc.malloc.arena_max=2:glibc.cpu.hwcaps=-AVX2"}
    once = processor.settings(given, V3)
    kept, masks = once["GLIBC_TUNABLES"].split(":")
    assert kept == "glibc.malloc.arena_max=2" and "-AVX2" not in masks.split(",")
    assert processor.settings(once, V3) == once


@needs_settings
def test_this_process_has_them():
    assert {name: os.environ.get(name) for name in processor.settings()} == processor.settings()
    found = code_taken.taken()
    # Of a test process nobody sets what is read at its start; jobs have it.
    del found["glibc"]
    assert code_taken.others([{"rule": "tests", "processor": found}]) == []


@needs_settings
def test_a_shell_can_take_them_over():
    printed = python(
        "import runpy; runpy.run_module('gearlib.processor', run_name='__main__')",
        environment={**os.environ},
    )
    assert dict(one.split("=", 1) for one in printed.split()) == processor.settings()


@needs_settings
def test_all_that_numpy_chooses_above_the_level_is_named():
    from numpy._core._multiarray_umath import __cpu_baseline__, __cpu_dispatch__

    above = {name for name in __cpu_dispatch__ if "512" in name or name == "X86_V4"}
    assert above <= set(processor.NUMPY.split())
    assert not set(processor.NUMPY.split()) & set(__cpu_baseline__)


@needs_settings
def test_no_warning_is_seen():
    assert python("import numpy", environment={**os.environ}) == ""


@needs_settings
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the C library is another one")
def test_the_c_library_reads_its_setting():
    code = """
import math
xs = [0.1 + 0.37 * i for i in range(2000)]
print([f(x).hex() for f in (math.sin, math.cos, math.tan, math.atan) for x in xs])
print([math.exp(x / 100).hex() for x in xs], [(x**0.3).hex() for x in xs])
"""
    ours = {**os.environ}
    native = {**os.environ, "GLIBC_TUNABLES": ""}
    # What processors without FMA have: other code, so that the comparison can fail.
    older = {**os.environ, "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-AVX2,-AVX2_Usable"}
    assert python(code, environment=ours) == python(code, environment=native)
    assert python(code, environment=ours) != python(code, environment=older)


@needs_settings
def test_eigenvalues_hang_on_the_kernels():
    # What the settings are for.
    code = """
import numpy as np
a = np.sin(np.arange(1600.0)).reshape(40, 40)
print(np.linalg.eigvals(a).tobytes().hex())
"""
    found = {
        python(code, environment=os.environ | {"OPENBLAS_CORETYPE": core})
        for core in ("Haswell", "Nehalem")
    }
    assert len(found) == 2
