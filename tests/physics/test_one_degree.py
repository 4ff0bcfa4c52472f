"""Nonlinear damping, stiffness and excitation: limits, other laws in closed form, tables."""

import math

import numpy as np
import pytest

from gearlib import Harmonics, OneDegreePair, Tabulated, simulate
from tests.properties.known_models import CUBIC, LINEAR, TABLE


def test_a_rectangle_as_a_table():
    # A table cannot jump; a step of 1e-7 rad is as good to a few parts in 1e7.
    half, d = math.pi * 0.569, 1e-7
    phase = (0.0, half, half + d, 2 * math.pi - half - d, 2 * math.pi - half)
    table = Tabulated(phase, (4e8, 4e8, 0.5879 * 4e8, 0.5879 * 4e8, 4e8))
    c_max, kappa, epsilon = table.ratios()
    assert (c_max, kappa) == (4e8, pytest.approx(0.5879)) and epsilon == pytest.approx(1.569)
    run = simulate(OneDegreePair(pair=LINEAR, profile=table), 0.9, periods=20)
    exact = simulate(LINEAR, 0.9, periods=20)
    np.testing.assert_allclose(run.displacement, exact.displacement, atol=1e-5)
    assert float(run.fraction_min_stiffness) == pytest.approx(
        float(exact.fraction_min_stiffness), abs=1e-6
    )


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
