"""Check on which processors a common instruction set is prescribed."""

import os

from gearlib import processor

V3_FLAGS = processor.V3_FEATURES | {"fpu", "sse2"}


def test_only_processors_of_x86_64_v3_or_above_get_common_variables():
    """Processors with all flags of x86-64-v3 must get the same variables, all others none."""
    variables = processor.environment_variables({}, V3_FLAGS)
    assert variables == processor.environment_variables({}, V3_FLAGS | {"avx512f", "avx512vl"})
    assert variables["OPENBLAS_CORETYPE"] == "Haswell"
    # Values must not need quotes in a shell.
    assert not any(set(value) & set(" \t'\"$&;") for value in variables.values())
    for flag in processor.V3_FEATURES:
        assert not processor.environment_variables({}, V3_FLAGS - {flag})
    # The tests themselves run with these variables.
    assert processor.environment_variables().items() <= os.environ.items()
