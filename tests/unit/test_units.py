"""Values with units in the configuration."""

import copy
import math
from decimal import Decimal
from pathlib import Path

import pint
import pytest
import yaml

from gearlib.config import ConfigError, load, units

PAPER = yaml.safe_load(Path("config.yaml").read_text(encoding="utf-8"))


# Equal, not close: a value spelled with a unit must rerun nothing.
@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("10 um", "m", 1e-5),
        ("10um", "m", 1e-5),
        ("40 µm", "m", 4e-5),
        ("4e5 N/mm", "N/m", 4e8),
        ("4e+5 N / mm", "N/m", 4e8),
        ("400 N/um", "N/m", 4e8),
        ("3.9537 N s/mm", "N s/m", 3953.7),
        ("3.9537 N*s/mm", "N s/m", 3953.7),
        ("3.2895396 kN", "N", 3289.5396),
        ("0.003123 N s^2/mm", "kg", 3.123),
        ("978.52 kg·cm^2", "kg m^2", 0.097852),
        ("-1 inch", "m", -0.0254),
    ],
)
def test_a_text_is_the_number_that_it_says(text, unit, value):
    assert units.read(text, unit) == value


def test_units_of_drawings_are_those_of_pint():
    registry = pint.UnitRegistry(non_int_type=Decimal)
    for (name, unit), factor in units.PLAIN.items():
        expected = registry.Quantity(Decimal(1), name).to(unit).magnitude
        # The last of 28 digits of pi is rounded.
        assert abs(Decimal(factor) / expected - 1) < Decimal("1e-24"), name


@pytest.mark.parametrize("text", ["2000 rpm", "2000 min^-1", "2e3rpm"])
def test_a_speed_counts_turns(text):
    assert units.read(text, "rpm") == 2000.0


@pytest.mark.parametrize(
    ("text", "speed"),
    [("50 Hz", 3000.0), ("100 rad/s", 3000.0 / math.pi), ("6 deg/s", 1.0), ("2 turn/s", 120.0)],
)
def test_a_speed_in_other_units(text, speed):
    assert units.read(text, "rpm") == pytest.approx(speed, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["10", "10 kg", "um", "10 foo", "1 m - 2 m", "nan m", "inf m", "10 20 m", "1 m^9^9^9", "", "m*"]
    + ["__import__('os')", "1 m; 2 m", "1e400000 m"],
)
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match="is not"):
        units.read(text, "m")


def test_a_configuration_in_other_units_is_the_same():
    settings = copy.deepcopy(PAPER)
    settings["gear_pair"] |= {
        "max_stiffness": "4e5 N/mm",
        "reduced_mass": "3123 g",
        "backlash": "40 um",
        "load": "3.2895396 kN",
    }
    settings["dampings"]["k1"]["material_damping"] = "3.9537 N s/mm"
    settings["scenes"]["fig7_damping"]["cases"][0]["change"] = {"load": "1 kN"}
    read = load(settings)
    assert read.gear_pair == load(PAPER).gear_pair
    assert read.dampings == load(PAPER).dampings
    assert read.case_parameters(read.scenes["fig7_damping"].cases[0])["load"] == 1000.0


def test_a_wrong_unit_is_refused_with_the_right_one():
    settings = copy.deepcopy(PAPER)
    settings["gear_pair"]["backlash"] = "40 kg"
    with pytest.raises(ConfigError) as refusal:
        load(settings)
    assert str(refusal.value) == (
        "gear_pair.backlash = '40 kg' is not allowed: it must be a number >= 0 or .inf, in m or a "
        "text with its unit such as '40 um'"
    )
