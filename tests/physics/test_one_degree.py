"""Nonlinear damping, stiffness and excitation: limits, other laws in closed form, tables."""

import math

import numpy as np
import pytest

from gearlib import Harmonics, OneDegreePair, Tabulated, simulate
from tests.properties.known_models import CUBIC, LINEAR, TABLE


def test_tables_are_read(tmp_path):
    path = tmp_path / "table.csv"
    rows = zip(TABLE.phase, TABLE.stiffness, strict=True)
    path.write_text("phase,stiffness\n" + "".join(f"{p},{c}\n" for p, c in rows), encoding="utf-8")
    assert Tabulated.read(path) == TABLE
    with pytest.raises(ValueError, match="no column 'C'"):
        Tabulated.read(path, stiffness="C")


def test_harmonics_of_a_table():
    given = Harmonics((1.0, -0.5), (0.25, 0.0))
    phase = 0.3 + 2 * math.pi * np.arange(16) / 16
    n, a, b = given.table().T[:, :, None]
    values = (a * np.cos(n * phase) + b * np.sin(n * phase)).sum(0)
    found = Harmonics.from_table(phase, values, 2)
    np.testing.assert_allclose(found.table(), given.table(), atol=1e-15)


@pytest.mark.parametrize(
    ("call", "part"),
    [
        (lambda: Tabulated((0.0, 7.0), (1.0, 2.0)), "rise strictly"),
        (
            lambda: simulate(OneDegreePair(pair=LINEAR, **CUBIC), 0.8, periods=1, method="exact"),
            "method = 'exact'",
        ),
    ],
)
def test_wrong_input(call, part):
    with pytest.raises(ValueError) as error:
        call()
    assert part in str(error.value) and "must" in str(error.value)
