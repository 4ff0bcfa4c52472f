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
    """Values given as strings must become the type of their key, and options keep theirs."""
    for text in ("4e8", "+4E+8", ".4e9", "4.e8", "400000000", 400000000):
        value = changed_config(gear_pair={"max_stiffness": text}).gear_pair.max_stiffness
        assert value == 4e8 and isinstance(value, float)
    assert changed_config(gear_pair={"backlash": ".inf"}).gear_pair.backlash == math.inf
    # The command line passes values of `--config section={key: value}` as strings.
    settings = changed_config(run={"revolutions": "6"}, six_degrees={"moving_backlash": "false"})
    assert settings.run.revolutions == 6 and settings.six_degrees.moving_backlash is False
    options = {"steps": 200, "rtol": "1e-8", "events": True, "solver": "LSODA", "sharpness": 2.0}
    trial = {"name": "mine", "method": "rk4", "options": options}
    values = changed_config(failures={"trials": [trial]}).failures.trials[0].options
    assert values == options | {"rtol": 1e-8}
    assert [type(value) for value in values.values()] == [int, float, bool, str, float]


def test_a_configuration_in_other_units_gives_the_same_settings():
    """Stiffness, mass, backlash, damping and load with units must be converted to SI units."""
    project_settings = load(CONFIG)
    pair = {"max_stiffness": "4e5 N/mm", "reduced_mass": "3123 g", "backlash": "40 um"}
    damping = project_settings.model_dump()["dampings"]["k1"]
    damping_in_mm = {key: f"{value / 1e3!r} N s/mm" for key, value in damping.items()}
    first_case = CONFIG["scenes"]["fig7_damping"]["cases"][0]
    settings = changed_config(
        gear_pair=pair | {"load": "3.2895396 kN"},
        dampings={"k1": damping_in_mm},
        scenes={"fig7_damping": {"cases": [first_case | {"change": {"load": "1 kN"}}]}},
    )
    assert settings.gear_pair == project_settings.gear_pair
    assert settings.dampings == project_settings.dampings
    (case,) = settings.scenes["fig7_damping"].cases
    assert settings.pair_description(case.damping, case.change)["load"] == 1000.0


def test_speeds_in_rpm_become_tunings():
    """A speed must become the tuning (mesh over natural frequency) of the gears of its section."""
    basin_cases = [*CONFIG["basins"]["cases"]]
    basin_cases[2] = basin_cases[2] | {"tuning": "2000 rpm"}
    settings = changed_config(
        resonance={"start": "2000 rpm", "stop": "5000rpm", "step": "20 rpm", "window": "1500 rpm"},
        phase_planes={"tunings": ["3000 rpm", 0.8]},
        branches={"start": "1500 rpm"},
        basins={"cases": basin_cases},
    )
    pair, section = build_model(settings.pair_description("k1")), settings.resonance
    # A sweep from rest ("cold") over 3000 rpm is divided into two windows of 1500 rpm.
    assert len(section.windows("cold")) == 2
    values = tunings.grid(section.start, section.stop, section.step)
    # Start and step are rounded to 12 decimals, and the rounding errors of the steps add up.
    np.testing.assert_allclose(pair.speed(np.array(values)), np.arange(2000, 5001, 20), rtol=1e-9)
    assert values[-1] == section.stop
    # The start of a branch is not rounded. Its stop has the default value 1.4.
    (first, second), branches = settings.phase_planes.tunings, settings.branches
    speeds = pair.speed(np.array([first, branches.start]))
    assert speeds == pytest.approx([3000.0, 1500.0], rel=1e-12)
    assert (second, branches.stop) == (0.8, 1.4)
    # The third case of `basins` changes the gears, so that its tuning refers to the changed gears.
    case = settings.basins.cases[2]
    gears = build_model(settings.pair_description(case.damping, case.change))
    assert gears.stiffness_ratio == 0.35
    assert gears.speed(case.tuning) == pytest.approx(2000.0, rel=1e-12)


def test_a_mistyped_target_is_refused_with_its_likely_name():
    with pytest.raises(ConfigError, match="targets.0. = 'resonace' .* did you mean resonance?"):
        changed_config(targets=["resonace"])


OTHER_GEARS = {"max_stiffness": 3.1e8, "stiffness_ratio": 0.62, "contact_ratio": 1.47}
OTHER_GEARS |= {"reduced_mass": 0.85, "load": 2400.0, "backlash": 60e-6, "teeth": 31}
#: Keys and sections of config.yaml whose values suit the paper's gears only, unlike defaults.
PAPER_SPECIFIC = set(
    """
    phase_lag.material_dampings jump.marked six_degrees.inertias six_degrees.masses
    six_degrees.bearing_damping six_degrees.eccentricities work_precision.methods
    work_precision.cubic_damping basins.cases basins.periods bifurcation.damping poincare.cases
    scenes
    """.split()
)


def test_config_yaml_shows_the_defaults():
    """Values in config.yaml may differ from the defaults in keys for the paper's gears only."""
    defaults = load({key: CONFIG[key] for key in ("gear_pair", "dampings")}).model_dump()
    differing_keys = set()
    for name, section in load(CONFIG).model_dump().items():
        if isinstance(section, dict) and name != "scenes":
            default = defaults[name]
            differing_keys |= {f"{name}.{key}" for key in section if section[key] != default[key]}
        elif section != defaults[name]:
            differing_keys.add(name)
    assert differing_keys == PAPER_SPECIFIC
    # The list of methods differs from the default in its order only.
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
    """Check defaults that depend on other sections, for a single zero, two and many dampings.

    `dampings` has the damping coefficients (in contact, in free flight), N s/m, by name.
    """
    keys = "material_damping", "backlash_damping"
    dampings = {name: dict(zip(keys, values, strict=True)) for name, values in dampings.items()}
    settings = load({"gear_pair": OTHER_GEARS | {"backlash": backlash}, "dampings": dampings})
    assert load(settings.model_dump()) == settings
    # The jump is studied for the first damping with a coefficient other than 0.
    damped_names = [name for name, values in dampings.items() if any(values.values())]
    assert settings.jump.damping == (damped_names or ["none"])[0]
    # Other studies use the largest coefficient, or a positive one if all are 0.
    default_damping = settings.nonlinear_damping.damping
    largest_damping = max(max(values.values()) for values in dampings.values())
    if largest_damping > 0.0:
        assert default_damping == largest_damping
    assert default_damping > 0.0
    assert settings.phase_lag.material_dampings == [default_damping, default_damping / 100.0]
    # The bifurcation diagram needs damping in contact, without which motions do not settle.
    material_dampings = [values["material_damping"] for values in dampings.values()]
    positive_dampings = [value for value in material_dampings if value > 0.0]
    bifurcation_damping = settings.bifurcation.damping.material_damping
    if positive_dampings:
        assert bifurcation_damping == positive_dampings[0]
    assert bifurcation_damping > 0.0
    assert set(settings.figures.colours) == set(dampings)
    assert len(set(settings.figures.colours.values())) == len(dampings)
    # The default masses and inertias for six degrees of freedom give the reduced mass of the pair.
    pair = build_model(settings.pair_description(next(iter(dampings))))
    six_degree_pair = SixDegreePair(pair=pair, **settings.six_degrees.model_dump())
    assert six_degree_pair.reduced_mass_free == pytest.approx(
        OTHER_GEARS["reduced_mass"], rel=1e-12
    )


@pytest.fixture(scope="module")
def schema_validator():
    """Return a validator with the JSON schema that `gearlib schema` prints."""
    schema = json.loads(CliRunner().invoke(main, ["schema"]).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


@pytest.mark.parametrize("path", [ROOT / "config.yaml", *ROOT.glob("gallery/*/config.yaml")])
def test_editors_find_the_schema_which_accepts_the_configurations_of_the_project(
    schema_validator, path
):
    """Each configuration must name the schema in its first comment and conform to it."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    schema_path = re.search(r"^SCHEMA := (.*)$", makefile, re.M)[1]
    text = path.read_text(encoding="utf-8")
    (path_in_comment,) = re.findall(r"^# yaml-language-server: \$schema=(.*)\n", text)
    assert (path.parent / path_in_comment).resolve() == ROOT / schema_path
    schema_validator.validate(yaml.safe_load(text))
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
def test_the_schema_refuses_missing_unknown_and_out_of_range_values(schema_validator, change):
    settings = copy.deepcopy(CONFIG)
    change(settings)
    assert not schema_validator.is_valid(settings)


# Values must be equal, not only close, because a rounding error would cause a rerun.
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
def test_a_string_with_a_unit_is_converted_to_si(text, unit, value):
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
def test_strings_without_a_valid_length_are_refused(text):
    with pytest.raises(ValueError, match="is not"):
        units.parse_quantity(text, "m")


@pytest.mark.parametrize(
    "key, suggestion",
    [("module", "2.5 mm"), ("width", "18 mm"), ("bore", "30 mm"), ("pressure_angle", "20 deg")],
)
def test_a_bare_number_that_is_too_large_is_refused_with_a_hint(key, suggestion):
    """A number in mm or degrees, given without unit, must be refused with the unit suggested."""
    number = float(suggestion.split()[0])
    gear = {"teeth": 23, "module": 2.5e-3, "width": 0.018} | {key: number}
    with pytest.raises(ValueError, match=f"did you mean {suggestion}"):
        SpurGear(**gear)
    with pytest.raises(ConfigError, match=f"did you mean {suggestion}"):
        load({"gears": {"pinion": gear, "wheel": {"teeth": 61}, "torque": 85.0}})


@pytest.mark.parametrize(
    ("tuning", "text"), [(0.66, "0.6600"), (1, "1.0000"), (0.81505, "0.81505"), (1e-6, "0.000001")]
)
def test_a_file_name_holds_the_tuning_exactly(tuning, text):
    assert format_name(tuning) == text
    assert parse_name(format_name(tuning, 2.5)) == [tuning, 2.5]


def test_windows_cover_each_tuning_of_the_grid_once_in_short_decimals():
    """Windows of a tuning grid must together have the same numbers as the whole grid."""
    assert grid(0.5, 0.6, 0.01) == [float(f"0.{i}") for i in range(50, 60)] + [0.6]
    start, stop, step, width = 0.5, 1.4, 0.0005, 0.1
    window_ends = windows(start, stop, step, width)
    tunings_of_windows = [tuning for ends in window_ends for tuning in grid(*ends, step)]
    assert tunings_of_windows == grid(start, stop, step) and len(window_ends) == 9
    # With a larger stop, the existing windows remain the same. The last window may be shorter.
    assert windows(0.5, 1.4, 0.05, 0.45) == windows(0.5, 1.85, 0.05, 0.45)[:2]
    assert windows(0.5, 0.8, 0.1, 0.2) == [(0.5, 0.7), (0.8, 0.8)]
