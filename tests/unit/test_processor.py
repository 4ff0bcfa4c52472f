"""Settings of one instruction set: where they apply."""

import os

import pytest

from gearlib import processor
from tests.workflow.recorder import code_taken

V3 = processor.LEVEL | {"fpu", "sse2"}


def test_processors_of_the_level_or_above_get_the_same_settings_and_others_none():
    settings = processor.settings({}, V3)
    assert settings == processor.settings({}, V3 | {"avx512f", "avx512vl"})
    assert settings["OPENBLAS_CORETYPE"] == "Haswell"
    # As words of a shell they need no quotes.
    assert not any(set(value) & set(" \t'\"$&;") for value in settings.values())
    assert not any(processor.settings({}, V3 - {flag}) for flag in processor.LEVEL)


@pytest.mark.skipif(not processor.settings(), reason="this processor has no settings")
def test_this_process_runs_under_the_settings():
    assert {name: os.environ.get(name) for name in processor.settings()} == processor.settings()
    taken = code_taken.taken()
    # Of a test process nobody sets what is read at its start; jobs have it.
    del taken["glibc"]
    assert code_taken.others([{"rule": "tests", "processor": taken}]) == []
