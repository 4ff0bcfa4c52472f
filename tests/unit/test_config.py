"""The configuration: numbers, units, speeds and cases as documented; see `tests/refusals` too."""

import math
import re
from decimal import Decimal

import numpy as np
import pint
import pytest
from click.testing import CliRunner

import gearlib
from gearlib import GearPair, tunings
from gearlib.cli import main
from gearlib.config import ConfigError, cases, load, overlay, schema, units
from gearlib.config.experiments import METHOD_PACKAGES
from gearlib.integrators import METHODS
from gearlib.removed import REMOVED
from tests.paper import CONFIG


def changed(**sections):
    """Return the checked configuration of the project with other keys."""
    return load(overlay(CONFIG, sections))


def test_numbers_texts_and_truths():
    for text in ("4e8", "4.0e8", "+4E+8", ".4e9", "4.e8", "400000000", 400000000):
        value = changed(gear_pair={"max_stiffness": text}).gear_pair.max_stiffness
        assert value == 4e8 and isinstance(value, float)
    for value in (math.inf, ".inf"):
        assert changed(gear_pair={"backlash": value}).gear_pair.backlash == math.inf
    # As `--config section={key: value}` on the command line hands them on.
    config = changed(run={"revolutions": "6"}, six_degrees={"moving_backlash": "false"})
    assert config.run.revolutions == 6 and config.six_degrees.moving_backlash is False
    options = {"steps": 200, "rtol": "1e-8", "events": True, "solver": "LSODA", "sharpness": 2.0}
    trial = {"name": "mine", "method": "rk4", "options": options}
    found = changed(failures={"trials": [trial]}).failures.trials[0].options
    assert found == options | {"rtol": 1e-8}
    assert [type(v) for v in found.values()] == [int, float, bool, str, float]


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
        *((text, "rpm", 2000.0) for text in ("2000 rpm", "2000 min^-1", "2e3rpm")),
        *(("50 Hz", "rpm", 3000.0), ("2 turn/s", "rpm", 120.0)),
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


@pytest.mark.parametrize(
    "text",
    ["10", "10 kg", "um", "10 foo", "1 m - 2 m", "nan m", "inf m", "10 20 m", "1 m^9^9^9", "", "m*"]
    + ["__import__('os')", "1 m; 2 m", "1e400000 m"],
)
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match="is not"):
        units.read(text, "m")


def test_a_configuration_in_other_units_is_the_same():
    pair = {"max_stiffness": "4e5 N/mm", "reduced_mass": "3123 g", "backlash": "40 um"}
    dampings = load(CONFIG).model_dump()["dampings"]["k1"]
    in_mm = {key: f"{value / 1e3!r} N s/mm" for key, value in dampings.items()}
    read = changed(
        gear_pair=pair | {"load": "3.2895396 kN"},
        dampings={"k1": in_mm},
        train={"reference_frequency": "2 kHz", "planetary": {"pressure_angle": "24 deg"}},
    )
    assert read.gear_pair == load(CONFIG).gear_pair and read.dampings == load(CONFIG).dampings
    assert read.train.reference_frequency == 2000.0
    assert read.train.planetary.pressure_angle == pytest.approx(np.radians(24.0))
    light = CONFIG["scenes"]["fig7_damping"]["cases"][0] | {"change": {"load": "1 kN"}}
    read = changed(scenes={"fig7_damping": {"cases": [light]}})
    assert read.case_parameters(read.scenes["fig7_damping"].cases[0])["load"] == 1000.0


def test_a_grid_in_rpm_is_one_of_tunings():
    grid = {"start": "2000 rpm", "stop": "5000rpm", "step": "20 rpm", "window": "1500 rpm"}
    found = changed(resonance=grid)
    pair, section = GearPair(**found.pair_parameters("k1")), found.resonance
    values = tunings.grid(section.start, section.stop, section.step)
    # Rounded to 12 decimals of the tuning; step by step that adds up.
    np.testing.assert_allclose(pair.speed(np.array(values)), np.arange(2000, 5001, 20), rtol=1e-9)
    assert values[-1] == section.stop and len(section.windows("cold")) == 2


def test_single_tunings_in_rpm():
    # Branches take no grid.
    found = changed(phase_planes={"tunings": ["3000 rpm", 0.8]}, branches={"start": "1500 rpm"})
    pair = GearPair(**found.pair_parameters("k1"))
    assert pair.speed(found.phase_planes.tunings[0]) == pytest.approx(3000.0, rel=1e-12)
    assert found.phase_planes.tunings[1] == 0.8
    assert pair.speed(found.branches.start) == pytest.approx(1500.0, rel=1e-12)
    assert found.branches.stop == 1.4
    # A case counts with its own gears.
    own = [*CONFIG["basins"]["cases"]]
    own[2] = own[2] | {"tuning": "2000 rpm"}
    found = changed(basins={"cases": own})
    case = found.basins.cases[2]
    gears = found.case_parameters(case)
    assert gears["stiffness_ratio"] == 0.35
    assert GearPair(**gears).speed(case.tuning) == pytest.approx(2000.0, rel=1e-12)


def refusals(settings, read=load):
    with pytest.raises(ConfigError) as refusal:
        read(settings)
    return str(refusal.value).splitlines()


def test_each_case_lays_its_keys_over_the_others():
    found = cases(CONFIG | {"cases": {"plain": {}, "heavy": {"gear_pair": {"load": "6 kN"}}}})
    assert load(found["plain"]) == load(CONFIG)
    heavy = load(found["heavy"])
    assert heavy.gear_pair.load == 6000.0
    assert heavy.gear_pair.backlash == load(CONFIG).gear_pair.backlash
    assert heavy.figures == load(CONFIG).figures


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({}, "cases = {} is not allowed: it must be"),
        ("one", "cases = 'one' is not allowed: it must be"),
        ({"a b": {}}, "cases.a b is not allowed as a name: it must be"),
        ({"a": 3}, "cases.a = 3 is not allowed: it must be"),
        ({"a": {"gear_pair": {"load": -1}}}, "cases.a: gear_pair.load = -1 is not allowed"),
        ({"a": {"geers": {}}}, "cases.a: geers = {} is not a known key"),
    ],
)
def test_a_wrong_case_is_refused(given, fault):
    (sentence,) = refusals(CONFIG | {"cases": given}, read=cases)
    assert sentence.startswith(fault)


def test_methods_and_packages_are_those_of_the_library():
    methods = schema()["$defs"]["Trial"]["properties"]["method"]["enum"]
    assert methods == [method.name for method in gearlib.methods()]
    packages = {
        name: method.PACKAGE.module
        for name, method in METHODS.items()
        if method.PACKAGE is not None
    }
    assert packages == METHOD_PACKAGES


def test_every_key_is_described():
    for section in [schema(), *schema()["$defs"].values()]:
        assert section["description"]
        for key, node in section["properties"].items():
            assert node.get("description") or "$ref" in node, key
        assert section["additionalProperties"] is False


@pytest.mark.parametrize("name", sorted(REMOVED))
def test_removed_names_are_answered_by_one_sentence(name):
    words = f"{name} was removed in gearlib 0.3: {REMOVED[name]}"
    if " " in name:
        command, option = name.split()
        done = CliRunner().invoke(main, [command, option, "1"])
        assert done.exit_code == 2 and words in " ".join(done.output.split())
        return
    if name not in gearlib.__all__:
        with pytest.raises(AttributeError, match=re.escape(words)):
            getattr(gearlib, name)
    section, _, key = name.partition(".")
    if section not in ("fit", "channels"):
        with pytest.raises(ConfigError, match=re.escape(words)):
            changed(**{section: {key: 1} if key else {}})
    if not key:
        with pytest.raises(ConfigError, match=re.escape(words)):
            changed(targets=["phase_lag", name])
