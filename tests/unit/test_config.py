"""The configuration: numbers, units, speeds, defaults and schema."""

import copy
import json
import math
import re

import jsonschema
import numpy as np
import pytest
import yaml
from click.testing import CliRunner

from gearlib import SixDegreePair, tunings, units
from gearlib.cli import main
from gearlib.config import ConfigError, load, overlay
from gearlib.geometry import SpurGear
from gearlib.models.from_values import build_model
from gearlib.tunings import format_name, grid, parse_name, windows
from tests.paper import CONFIG
from tests.workflow.project import ROOT


def changed_config(**sections):
    """Return the checked configuration of the project with some keys replaced."""
    return load(overlay(CONFIG, sections))


def test_numbers_strings_and_booleans_are_converted():
    for text in ("4e8", "+4E+8", ".4e9", "4.e8", "400000000", 400000000):
        value = changed_config(gear_pair={"max_stiffness": text}).gear_pair.max_stiffness
        assert value == 4e8 and isinstance(value, float)
    assert changed_config(gear_pair={"backlash": ".inf"}).gear_pair.backlash == math.inf
    # The command line passes `--config section={key: value}` on as texts.
    settings = changed_config(run={"revolutions": "6"}, six_degrees={"moving_backlash": "false"})
    assert settings.run.revolutions == 6 and settings.six_degrees.moving_backlash is False
    options = {"steps": 200, "rtol": "1e-8", "events": True, "solver": "LSODA", "sharpness": 2.0}
    trial = {"name": "mine", "method": "rk4", "options": options}
    values = changed_config(failures={"trials": [trial]}).failures.trials[0].options
    assert values == options | {"rtol": 1e-8}
    assert [type(value) for value in values.values()] == [int, float, bool, str, float]


def test_a_configuration_in_other_units_gives_the_same_settings():
    """Write stiffness, mass, backlash, damping and load with units."""
    paper = load(CONFIG)
    pair = {"max_stiffness": "4e5 N/mm", "reduced_mass": "3123 g", "backlash": "40 um"}
    dampings = paper.model_dump()["dampings"]["k1"]
    in_mm = {key: f"{value / 1e3!r} N s/mm" for key, value in dampings.items()}
    light = CONFIG["scenes"]["fig7_damping"]["cases"][0] | {"change": {"load": "1 kN"}}
    settings = changed_config(
        gear_pair=pair | {"load": "3.2895396 kN"},
        dampings={"k1": in_mm},
        scenes={"fig7_damping": {"cases": [light]}},
    )
    assert settings.gear_pair == paper.gear_pair and settings.dampings == paper.dampings
    (case,) = settings.scenes["fig7_damping"].cases
    assert settings.pair(case.damping, case.change)["load"] == 1000.0


def test_speeds_in_rpm_become_tunings():
    """Each speed must become the tuning of the gears to which its section refers."""
    basins = [*CONFIG["basins"]["cases"]]
    basins[2] = basins[2] | {"tuning": "2000 rpm"}
    settings = changed_config(
        resonance={"start": "2000 rpm", "stop": "5000rpm", "step": "20 rpm", "window": "1500 rpm"},
        phase_planes={"tunings": ["3000 rpm", 0.8]},
        branches={"start": "1500 rpm"},
        basins={"cases": basins},
    )
    pair, section = build_model(settings.pair("k1")), settings.resonance
    # A window of 1500 rpm takes two jobs for a sweep from rest ("cold") over 3000 rpm.
    assert len(section.windows("cold")) == 2
    values = tunings.grid(section.start, section.stop, section.step)
    # Start and step are rounded to 12 decimals of the tuning, and errors of steps add up.
    np.testing.assert_allclose(pair.speed(np.array(values)), np.arange(2000, 5001, 20), rtol=1e-9)
    assert values[-1] == section.stop
    # The start of a branch is not rounded, and its stop keeps the default.
    (first, second), branches = settings.phase_planes.tunings, settings.branches
    speeds = pair.speed(np.array([first, branches.start]))
    assert speeds == pytest.approx([3000.0, 1500.0], rel=1e-12)
    assert (second, branches.stop) == (0.8, 1.4)
    # The third case of `basins` changes the gears, and its tuning refers to the changed gears.
    case = settings.basins.cases[2]
    gears = build_model(settings.pair(case.damping, case.change))
    assert gears.stiffness_ratio == 0.35
    assert gears.speed(case.tuning) == pytest.approx(2000.0, rel=1e-12)


def test_a_mistyped_target_is_refused_with_its_likely_name():
    with pytest.raises(ConfigError, match="targets.0. = 'resonace' .* did you mean resonance?"):
        changed_config(targets=["resonace"])


GEARS = {"max_stiffness": 3.1e8, "stiffness_ratio": 0.62, "contact_ratio": 1.47}
GEARS |= {"reduced_mass": 0.85, "load": 2400.0, "backlash": 60e-6, "teeth": 31}
#: Keys and sections whose values in config.yaml suit only the paper's gears and are no defaults.
PAPER_SPECIFIC = set(
    """
    phase_lag.material_dampings jump.marked six_degrees.inertias six_degrees.masses
    six_degrees.bearing_damping six_degrees.eccentricities work_precision.methods
    work_precision.cubic_damping basins.cases basins.periods bifurcation.damping poincare.cases
    scenes
    """.split()
)


def test_config_yaml_shows_the_defaults():
    defaults = load({key: CONFIG[key] for key in ("gear_pair", "dampings")}).model_dump()
    different = set()
    for name, section in load(CONFIG).model_dump().items():
        if isinstance(section, dict) and name != "scenes":
            other = defaults[name]
            different |= {f"{name}.{key}" for key in section if section[key] != other[key]}
        elif section != defaults[name]:
            different.add(name)
    assert different == PAPER_SPECIFIC
    # The list of methods differs from the default only in its order.
    methods = CONFIG["work_precision"]["methods"]
    assert sorted(methods) == sorted(defaults["work_precision"]["methods"])


@pytest.mark.parametrize("backlash", [0.0, 60e-6, float("inf")])
@pytest.mark.parametrize(
    "dampings",
    [
        {"none": (0.0, 0.0)},
        {"none": (0.0, 0.0), "oil": (0.0, 20.0)},
        {f"k{i}": (100.0 * (i + 1), 1.0) for i in range(30)},
    ],
)
def test_defaults_follow_from_gears_and_dampings(backlash, dampings):
    """Check defaults that depend on other sections, for gears with none, few and many dampings."""
    keys = "material_damping", "backlash_damping"
    dampings = {name: dict(zip(keys, pair, strict=True)) for name, pair in dampings.items()}
    settings = load({"gear_pair": GEARS | {"backlash": backlash}, "dampings": dampings})
    assert load(settings.model_dump()) == settings
    damped = [name for name, k in dampings.items() if any(k.values())]
    assert settings.jump.damping == (damped or ["none"])[0]
    largest = settings.nonlinear_damping.damping
    highest = max(max(k.values()) for k in dampings.values())
    assert largest == highest or highest == 0.0 < largest
    assert settings.phase_lag.material_dampings == [largest, largest / 100.0]
    # Motions settle only if contact is damped. The diagram uses the first such damping, else its
    # own.
    settling = [k["material_damping"] for k in dampings.values() if k["material_damping"]]
    damping = settings.bifurcation.damping.material_damping
    assert damping == settling[0] if settling else damping > 0.0
    assert set(settings.figures.colours) == set(dampings)
    assert len(set(settings.figures.colours.values())) == len(dampings)
    # The default bodies of six degrees of freedom have the reduced mass of the pair.
    pair = build_model(settings.pair(next(iter(dampings))))
    six = SixDegreePair(pair=pair, **settings.six_degrees.model_dump())
    assert six.reduced_mass_free == pytest.approx(GEARS["reduced_mass"], rel=1e-12)


@pytest.fixture(scope="module")
def schema():
    """Return a validator for the JSON schema that the command prints."""
    schema = json.loads(CliRunner().invoke(main, ["schema"]).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("path", [ROOT / "config.yaml", *ROOT.glob("gallery/*/config.yaml")])
def test_editors_find_the_schema_which_accepts_the_configurations_of_the_project(schema, path):
    """Each configuration must name the schema in its first comment and be valid by it."""
    target = re.search(r"^SCHEMA := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    text = path.read_text(encoding="utf-8")
    (named,) = re.findall(r"^# yaml-language-server: \$schema=(.*)\n", text)
    assert (path.parent / named).resolve() == ROOT / target[1]
    schema.validate(yaml.safe_load(text))
    load(yaml.safe_load(text))


@pytest.mark.parametrize(
    "change",
    [
        lambda settings: settings.pop("dampings"),
        lambda settings: settings.update(damping={}),
        lambda settings: settings["gear_pair"].update(load=-1.0),
        lambda settings: settings.update(targets=["published"]),
    ],
)
def test_the_schema_refuses_missing_unknown_and_out_of_range_values(schema, change):
    settings = copy.deepcopy(CONFIG)
    change(settings)
    assert not schema.is_valid(settings)


# Values must be equal, not only close, because a value written with a unit must not cause a rerun.
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
        *((text, "rpm", 3000.0) for text in ("3000 1/min", "3000 1 / min", "3000 U/min")),
        *((text, "rpm", 3000.0) for text in ("3000 rev/min", "3000/min", "3000 min-1")),
        # A 1 counts as numerator only if it stands alone. Rates are in revolutions, as speeds are.
        ("30001/min", "rpm", 30001.0),
        *((text, "rpm/s", 60.0) for text in ("60 1/min/s", "60 min^-1/s", "1 Hz/s")),
    ],
)
def test_a_text_with_a_unit_is_converted_to_si(text, unit, value):
    assert units.parse_quantity(text, unit) == value


@pytest.mark.parametrize(
    "text",
    [
        "10",
        "10 kg",
        "10 rpm",
        "10 1/min",
        "um",
        "10 foo",
        "1 m - 2 m",
        "nan m",
        "inf m",
        "10 20 m",
        "1 m^9^9^9",
        "m*",
    ]
    + ["__import__('os')", "1e400000 m"],
)
def test_texts_of_another_kind_are_refused(text):
    with pytest.raises(ValueError, match="is not"):
        units.parse_quantity(text, "m")


@pytest.mark.parametrize(
    "key, likely",
    [("module", "2.5 mm"), ("width", "18 mm"), ("bore", "30 mm"), ("pressure_angle", "20 deg")],
)
def test_a_bare_number_that_is_too_large_is_refused_with_a_hint(key, likely):
    gear = {"teeth": 23, "module": 2.5e-3, "width": 0.018} | {key: float(likely.split()[0])}
    with pytest.raises(ValueError, match=f"did you mean {likely}"):
        SpurGear(**gear)
    with pytest.raises(ConfigError, match=f"did you mean {likely}"):
        load({"gears": {"pinion": gear, "wheel": {"teeth": 61}, "torque": 85.0}})


@pytest.mark.parametrize(
    ("tuning", "text"), [(0.66, "0.6600"), (1, "1.0000"), (0.81505, "0.81505"), (1e-6, "0.000001")]
)
def test_a_file_name_holds_the_tuning_exactly(tuning, text):
    assert format_name(tuning) == text
    assert parse_name(format_name(tuning, 2.5)) == [tuning, 2.5]


def test_windows_cover_each_tuning_of_the_grid_once_in_short_decimals():
    """Windows of a tuning grid must contain each tuning once, without rounding digits."""
    assert grid(0.5, 0.6, 0.01) == [float(f"0.{i}") for i in range(50, 60)] + [0.6]
    parts = windows(0.5, 1.4, 0.0005, 0.1)
    joined = [tuning for ends in parts for tuning in grid(*ends, 0.0005)]
    assert joined == grid(0.5, 1.4, 0.0005) and len(parts) == 9
    # A larger stop keeps the existing windows, and the last window may be shorter.
    assert windows(0.5, 1.4, 0.05, 0.45) == windows(0.5, 1.85, 0.05, 0.45)[:2]
    assert windows(0.5, 0.8, 0.1, 0.2) == [(0.5, 0.7), (0.8, 0.8)]
