"""Numbers with and without units, as drawings have them; tunings as exact decimals."""

from decimal import Decimal

import pint
import pytest

from gearlib.config import ConfigError, load, units
from gearlib.geometry import SpurGear
from gearlib.tunings import grid, name_of, values_of, windows


# Equal, not close: a value spelled with a unit must rerun nothing.
@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        *((text, "N m", 85.0) for text in ("85Nm", "85 N·m", "85 N⋅m", "85 N*m", "85 N m")),
        *((text, "m", 0.0025) for text in ("2500um", "2500 µm", "2500 μm", "2.5mm", "0.25 cm")),
        *((text, "N/m", 4e8) for text in ("4e+5 N / mm", "400 N/um")),
        ("3.9537 N s/mm", "N s/m", 3953.7),
        ("0.003123 N s^2/mm", "kg", 3.123),
        ("978.52 kg·cm^2", "kg m^2", 0.097852),
        ("-1 inch", "m", -0.0254),
        *((text, "rpm", 3000.0) for text in ("3000 min^-1", "3e3rpm", "50 Hz", "50 turn/s")),
    ],
)
def test_a_text_is_the_number_that_it_says(text, unit, value):
    assert units.read(text, unit) == value


def test_units_of_drawings_are_those_of_pint():
    registry = pint.UnitRegistry(non_int_type=Decimal)
    for (name, unit), factor in units.FACTORS.items():
        expected = registry.Quantity(Decimal(1), name).to(unit).magnitude
        # The last of 28 digits of pi is rounded.
        assert abs(Decimal(factor) / expected - 1) < Decimal("1e-24"), name


@pytest.mark.parametrize(
    "text",
    ["10", "10 kg", "um", "10 foo", "1 m - 2 m", "nan m", "inf m", "10 20 m", "1 m^9^9^9", "m*"]
    + ["__import__('os')", "1e400000 m"],
)
def test_texts_of_another_kind_are_refused(text):
    with pytest.raises(ValueError, match="is not"):
        units.read(text, "m")


@pytest.mark.parametrize(
    "key, likely",
    [("module", "2.5 mm"), ("width", "18 mm"), ("bore", "30 mm"), ("pressure_angle", "20 deg")],
)
def test_a_bare_number_too_large_is_asked_about(key, likely):
    gear = {"teeth": 23, "module": 2.5e-3, "width": 0.018} | {key: float(likely.split()[0])}
    with pytest.raises(ValueError, match=f"did you mean {likely}"):
        SpurGear(**gear)
    with pytest.raises(ConfigError, match=f"did you mean {likely}"):
        load({"gears": {"pinion": gear, "wheel": {"teeth": 61}, "torque": 85.0}})


@pytest.mark.parametrize(
    ("tuning", "text"), [(0.66, "0.6600"), (1, "1.0000"), (0.81505, "0.81505"), (1e-6, "0.000001")]
)
def test_a_name_holds_the_tuning_exactly(tuning, text):
    assert name_of(tuning) == text
    assert values_of(name_of(tuning, 2.5)) == [tuning, 2.5]


def test_windows_hold_the_grid_once_in_the_floats_that_a_reader_would_type():
    assert grid(0.5, 0.6, 0.01) == [float(f"0.{i}") for i in range(50, 60)] + [0.6]
    parts = windows(0.5, 1.4, 0.0005, 0.1)
    joined = [tuning for ends in parts for tuning in grid(*ends, 0.0005)]
    assert joined == grid(0.5, 1.4, 0.0005) and len(parts) == 9
    # A raised stop keeps the windows before it; the last one may be shorter.
    assert windows(0.5, 1.4, 0.05, 0.45) == windows(0.5, 1.85, 0.05, 0.45)[:2]
    assert windows(0.5, 0.8, 0.1, 0.2) == [(0.5, 0.7), (0.8, 0.8)]
