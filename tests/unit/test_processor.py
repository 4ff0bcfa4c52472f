"""Settings of one instruction set: where they apply, and that libraries take them."""

import os
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


@needs_settings
def test_this_process_has_them():
    assert {name: os.environ.get(name) for name in processor.settings()} == processor.settings()
    found = code_taken.taken()
    # Of a test process nobody sets what is read at its start; jobs have it.
    del found["glibc"]
    assert code_taken.others([{"rule": "tests", "processor": found}]) == []
