"""Settings of one instruction set: where they apply."""

import os

from gearlib import processor

V3 = processor.V3_FEATURES | {"fpu", "sse2"}


def test_only_processors_of_x86_64_v3_or_above_get_common_settings():
    settings = processor.environment_variables({}, V3)
    assert settings == processor.environment_variables({}, V3 | {"avx512f", "avx512vl"})
    assert settings["OPENBLAS_CORETYPE"] == "Haswell"
    # Values must not need quotes in a shell.
    assert not any(set(value) & set(" \t'\"$&;") for value in settings.values())
    assert not any(
        processor.environment_variables({}, V3 - {flag}) for flag in processor.V3_FEATURES
    )
    # The tests themselves run with these settings.
    assert processor.environment_variables().items() <= os.environ.items()
