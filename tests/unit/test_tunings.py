"""Tunings as exact decimals."""

import pytest

from gearlib.tunings import grid, name_of, values_of, windows


@pytest.mark.parametrize(
    ("tuning", "text"), [(0.66, "0.6600"), (1, "1.0000"), (0.81505, "0.81505"), (1e-6, "0.000001")]
)
def test_a_name_holds_the_tuning_exactly(tuning, text):
    assert name_of(tuning) == text
    assert values_of(name_of(tuning, 2.5)) == [tuning, 2.5]


def test_windows_hold_the_grid_once_in_the_floats_that_a_reader_would_type():
    assert grid(0.5, 0.6, 0.01) == [float(f"0.{i}") for i in range(50, 60)] + [0.6]
    parts = windows(0.5, 1.4, 0.0005, 0.1)
    joined = [tuning for first, last in parts for tuning in grid(first, last, 0.0005)]
    assert joined == grid(0.5, 1.4, 0.0005) and len(parts) == 9
    # A raised stop keeps the windows before it; the last one may be shorter.
    assert windows(0.5, 1.4, 0.05, 0.45) == windows(0.5, 1.85, 0.05, 0.45)[:2]
    assert windows(0.5, 0.8, 0.1, 0.2) == [(0.5, 0.7), (0.8, 0.8)]
