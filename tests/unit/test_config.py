"""The configuration: accepted as documented, refused in one sentence for each problem."""

import copy
import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import gearlib
from gearlib import GearPair
from gearlib.config import ConfigError, load, schema
from gearlib.config.trials import PEERS
from gearlib.integrators import METHODS

ROOT = Path(__file__).resolve().parents[2]
# Aliases of one drawing become drawings of their own.
PAPER = json.loads(json.dumps(yaml.safe_load((ROOT / "config.yaml").read_text(encoding="utf-8"))))
MISSING = object()


def changed(path, value):
    settings = copy.deepcopy(PAPER)
    *sections, key = path.split("/")
    section = settings
    for name in sections:
        section = section[name]
    if value is MISSING:
        del section[key]
    else:
        section[key] = value
    return settings


# path, value, what the sentence must hold: the key and value, the allowed range
REFUSED = [
    ("gear_pair/contact_ratio", 2.5, "gear_pair.contact_ratio = 2.5", "from 1 to 2"),
    ("gear_pair/contact_ratio", 0.9, "gear_pair.contact_ratio = 0.9", "from 1 to 2"),
    ("gear_pair/stiffness_ratio", 0, "gear_pair.stiffness_ratio = 0", "> 0 and <= 1"),
    ("gear_pair/max_stiffness", -4e8, "gear_pair.max_stiffness = -4", "finite number > 0"),
    ("gear_pair/reduced_mass", "3 m", "gear_pair.reduced_mass = '3 m'", "unit such as '3123 g'"),
    ("gear_pair/reduced_mass", "3,123", "gear_pair.reduced_mass = '3,123'", "finite number"),
    ("gear_pair/load", math.nan, "gear_pair.load = nan", "finite number > 0"),
    ("gear_pair/load", math.inf, "gear_pair.load = inf", "finite number > 0"),
    ("gear_pair/load", True, "gear_pair.load = true", "finite number > 0"),
    ("gear_pair/load", None, "gear_pair.load = null", "finite number > 0"),
    ("gear_pair/load", [1.0], "gear_pair.load = [1.0]", "finite number > 0"),
    ("gear_pair/load", "1e400", "gear_pair.load = inf", "finite number > 0"),
    ("gear_pair/load", MISSING, "gear_pair.load is missing", "finite number > 0"),
    ("gear_pair/backlash", -1e-6, "gear_pair.backlash = -1e-06", ">= 0 or .inf"),
    ("gear_pair/backlash", math.nan, "gear_pair.backlash = nan", ">= 0 or .inf"),
    ("gear_pair/teeth", 24.5, "gear_pair.teeth = 24.5", "integer from 1 to 10000"),
    ("gear_pair/teeth", 0, "gear_pair.teeth = 0", "integer from 1 to 10000"),
    ("gear_pair/tooth", 24, "gear_pair.tooth = 24 is not a known key", "teeth"),
    ("gear_pair", MISSING, "gear_pair is missing", "max_stiffness"),
    ("gear_pair", 3, "gear_pair = 3", "mapping with the keys max_stiffness"),
    ("geer_pair", {}, "geer_pair = {} is not a known key", "gear_pair"),
    ("dampings", {}, "dampings = {}", "at least one name"),
    ("dampings/k1", 3953.7, "dampings.k1 = 3953.7", "keys material_damping, backlash_damping"),
    (
        "dampings/k1/material",
        0.0,
        "dampings.k1.material = 0.0 is not a known key",
        "called material_damping",
    ),
    (
        "dampings/k1/backlash",
        "40 um",
        "dampings.k1.backlash = '40 um' is not a known key",
        "called backlash_damping",
    ),
    ("dampings/k1/material_damping", -1, "dampings.k1.material_damping = -1", "finite number >= 0"),
    (
        "dampings/k 1",
        {"material_damping": 0, "backlash_damping": 0},
        "dampings.k 1",
        "A-Za-z0-9+_-",
    ),
    ("run/revolutions", 0, "run.revolutions = 0", "integer from 1 to 1000000"),
    ("run/recorded_revolutions", 6, "run.recorded_revolutions = 6", "1 to run.revolutions = 5"),
    ("run/samples_per_period", 10**9, "run.samples_per_period = 1000000000", "from 8 to 65536"),
    ("run/initial_state/velocity", "fast", "run.initial_state.velocity = 'fast'", "finite number"),
    ("resonance/start", 0, "resonance.start = 0", "> 0 and <= 100"),
    ("resonance/stop", 0.4, "resonance.stop = 0.4", "greater than resonance.start = 0.5"),
    ("resonance/stop", 1.4001, "resonance.stop = 1.4001", "multiple of resonance.step = 0.0005"),
    ("resonance/step", 1e-9, "resonance.step = 1e-09", ">= 1.1e-06"),
    ("resonance/step", 0, "resonance.step = 0", "> 0 and <= 10"),
    ("resonance/window", 0.00075, "resonance.window = 0.00075", "multiple of resonance.step"),
    ("resonance/directions", [], "resonance.directions = []", "at least one entry"),
    ("resonance/directions", ["left"], "resonance.directions[0] = 'left'", "cold, up, down"),
    ("resonance/directions", "cold", "resonance.directions = 'cold'", "a list"),
    ("phase_planes/tunings", [], "phase_planes.tunings = []", "at least one entry"),
    ("phase_planes/tunings", [0.66, 0.660], "phase_planes.tunings lists 0.66 twice", "different"),
    ("phase_planes/tunings", [0.6, -0.66], "phase_planes.tunings[1] = -0.66", "> 0 and <= 100"),
    ("phase_planes/tunings", [False], "phase_planes.tunings[0] = false", "> 0 and <= 100"),
    ("targets", [], "targets = []", "at least one entry"),
    ("targets", ["resonances"], "targets[0] = 'resonances'", "one of phase_lag, resonance"),
    ("report_page/step", 0.4, "report_page.stop = 1.4", "a whole multiple"),
    ("report_page/periods_shown", 25, "report_page.periods_shown = 25", "from 1 to the 24"),
    ("report_page/samples_per_period", 4096, "report_page.samples_per_period", "<= 2,000,000"),
    ("jump/damping", "k2", "jump.damping = 'k2'", "one of k1, k1m"),
    ("jump/stop", 0.7, "jump.stop = 0.7", "jump.start = 0.78 plus a whole multiple"),
    ("jump/step", 1e-9, "jump.step = 1e-09", ">= 8e-06"),
    ("jump/harmonics", [0], "jump.harmonics[0] = 0", "integer from 1 to 1000"),
    ("jump/factors", [1.1, 0.0], "jump.factors[1] = 0.0", "finite number > 0"),
    ("jump/tolerances", [1.0], "jump.tolerances[0] = 1.0", "> 0 and <= 0.1"),
    (
        "dynamic_factor/pair/pinion/quality",
        12,
        "dynamic_factor.pair.pinion.quality = 12",
        "from 1 to 11",
    ),
    (
        "dynamic_factor/pair/wheel/quality",
        MISSING,
        "dynamic_factor.pair.wheel.quality is missing",
        "from 1 to 11",
    ),
    ("dynamic_factor/pair/torque", "302 N", "dynamic_factor.pair.torque = '302 N'", "N m"),
    ("dynamic_factor/record_periods", 301, "dynamic_factor.record_periods = 301", "1 to"),
    (
        "dynamic_factor/pair/wheel/tip_diameter",
        "105 mm",
        "contact_ratio of dynamic_factor.pair = 0.",
        ">= 1",
    ),
    ("campbell/orders", 0, "campbell.orders = 0", "from 1 to 20"),
    ("reducer/damping", "k2", "reducer.damping = 'k2'", "one of k1, k1m"),
    ("reducer/teeth", [24, 36, 24], "reducer.teeth", "4"),
    ("reducer/teeth", [24, 36, 24, 2], "reducer.teeth[3] = 2", "integer from 3 to 1000"),
    ("reducer/teeth", [24, 36, 24, 40], "reducer.teeth = [24, 36, 24, 40]", "one centre distance"),
    ("reducer/modules", [0.004, 0.005], "reducer.teeth = [24, 36, 24, 36]", "0.15 m in the second"),
    ("reducer/damping_ratio", -0.1, "reducer.damping_ratio = -0.1", "from 0 to 1"),
    ("reducer/pin_error", [".inf", 0], "reducer.pin_error[0] = '.inf'", "'10 um'"),
    ("reducer/backlashes", [1e-5, -1e-5, 1e-5], "reducer.backlashes[1] = -1e-05", ">= 0"),
    ("reducer/record_periods", 211, "reducer.record_periods = 211", "1 to reducer.periods = 210"),
    ("reducer/stop", 0.7, "reducer.stop = 0.7", "reducer.start = 0.74 plus a whole multiple"),
    ("one_mesh/other_teeth", [25, 35, 25, 36], "one_mesh.other_teeth", "one centre distance"),
    ("one_mesh/soft_support", 0, "one_mesh.soft_support = 0", "> 0"),
    ("one_mesh/spread", 0, "one_mesh.spread = 0", "> 0"),
    (
        "mesh_stiffness/pairs/FZG-C/wheel/teeth",
        2,
        "mesh_stiffness.pairs.FZG-C.wheel.teeth = 2",
        "integer from 3 to 10000",
    ),
    (
        "mesh_stiffness/pairs/FZG-C/pinion/tip_diameter",
        "90 mm",
        "mesh_stiffness.pairs.FZG-C.pinion.tip_diameter = 0.09",
        "pointed",
    ),
    (
        "mesh_stiffness/pairs/z20-20/wheel/bore",
        "150 mm",
        "mesh_stiffness.pairs.z20-20.wheel.bore = 0.15",
        "energy method",
    ),
    (
        "mesh_stiffness/pairs/z20-20/torque",
        "500 N",
        "mesh_stiffness.pairs.z20-20.torque = '500 N'",
        "'302 N m'",
    ),
    (
        "mesh_stiffness/pairs/z20-20/backlash",
        -1e-6,
        "mesh_stiffness.pairs.z20-20.backlash = -1e-06",
        ">= 0",
    ),
    ("mesh_stiffness/samples", 7, "mesh_stiffness.samples = 7", "integer from 8 to 4096"),
    ("rectangle/tolerance", 0, "rectangle.tolerance = 0", "> 0"),
    ("rectangle/stop", 1.299, "rectangle.stop = 1.299", "a whole multiple"),
    ("rectangle/record_periods", 161, "rectangle.record_periods = 161", "1 to rectangle.periods"),
    ("harris_map/gears/pinion/teeth", 10, "harris_map.gears.pinion.shift = 0.1817", "undercuts"),
    ("harris_map/gears/centre_distance", 0.08, "harris_map.gears.centre_distance", "base circles"),
    ("harris_map/gears/torque", "302 N", "harris_map.gears.torque = '302 N'", "N m"),
    ("harris_map/gears/pinion/helix_angle", 0.1, "harris_map.gears.pinion.helix_angle", "spur"),
    (
        "harris_map/gears/wheel/tip_relief",
        {"amount": "20 um", "length": "1 mm"},
        "harris_map.gears.wheel.tip_relief is not allowed",
        "left out",
    ),
    ("harris_map/stiffness", "fem", "harris_map.stiffness = 'fem'", "energy, iso"),
    ("harris_map/loads", [1.0, 1.0], "harris_map.loads", "different"),
    ("harris_map/phases", 4, "harris_map.phases = 4", "8"),
    ("relief_dynamics/loads", [0.0], "relief_dynamics.loads[0] = 0.0", "> 0"),
    ("relief_dynamics/damping_ratio", 2, "relief_dynamics.damping_ratio = 2", "from 0 to 1"),
    ("relief_dynamics/stop", 0.21, "relief_dynamics.stop = 0.21", "whole multiple"),
    (
        "relief_dynamics/record_periods",
        121,
        "relief_dynamics.record_periods = 121",
        "1 to relief_dynamics.periods = 120",
    ),
    ("nonlinear_damping/amplitude", 0, "nonlinear_damping.amplitude = 0", "finite number > 0"),
    ("six_degrees/moving_backlash", 1, "six_degrees.moving_backlash = 1", "true or false"),
    ("models/harmonics", 0, "models.harmonics = 0", "integer from 1 to 1000"),
    ("scenes/fig7_damping/tolerance", 0, "scenes.fig7_damping.tolerance = 0", "> 0 and <= 10"),
    (
        "scenes/fig7_damping/observables",
        ["y"],
        "scenes.fig7_damping.observables[0] = 'y'",
        "displacement_max",
    ),
    (
        "scenes/fig7_damping/model",
        "two_degrees",
        "scenes.fig7_damping.model = 'two_degrees'",
        "smallest, one_degree",
    ),
    (
        "scenes/fig8_six_degrees/model",
        "one_degree",
        "scenes.fig8_six_degrees.courses = 'bearing_y3'",
        "six_degrees",
    ),
    (
        "scenes/fig8_six_degrees/model",
        "six_degrees_plain",
        "scenes.fig8_six_degrees.courses = 'bearing_z3'",
        "no friction",
    ),
    ("figures/formats", ["jpeg"], "figures.formats[0] = 'jpeg'", "one of png, pdf, svg"),
    ("figures/dpi", "high", "figures.dpi = 'high'", "integer from 50 to 1200"),
    ("figures/colours/k1", "blue", "figures.colours.k1 = 'blue'", "'#rrggbb'"),
    ("figures/colours/k2", "#000000", "figures.colours.k2 = '#000000'", "one of the dampings k1"),
]


@pytest.mark.parametrize(("path", "value", "fault", "allowed"), REFUSED)
def test_a_wrong_value_is_refused_in_one_sentence(path, value, fault, allowed):
    with pytest.raises(ConfigError) as refusal:
        load(changed(path, value))
    (sentence,) = str(refusal.value).splitlines()
    assert sentence.startswith(fault)
    assert allowed in sentence


SCENE_REFUSED = [
    ("model", "five_degrees", "scenes.fig7_damping.model = 'five_degrees'", "six_degrees"),
    ("periods_shown", 25, "scenes.fig7_damping.periods_shown = 25", "from 1 to the 24"),
    ("courses", [], "scenes.fig7_damping.courses = []", "at least one"),
    ("cases", [], "scenes.fig7_damping.cases = []", "at least one"),
]


@pytest.mark.parametrize(("key", "value", "fault", "allowed"), SCENE_REFUSED)
def test_a_wrong_scene_is_refused_in_one_sentence(key, value, fault, allowed):
    test_a_wrong_value_is_refused_in_one_sentence(
        f"scenes/fig7_damping/{key}", value, fault, allowed
    )


@pytest.mark.parametrize(
    ("key", "value", "fault", "allowed"),
    [
        ("title", "oil", "scenes.fig7_damping.cases[0].title = 'oil'", "different"),
        ("title", "", "scenes.fig7_damping.cases[0].title = ''", "1 to 60"),
        ("damping", "k9", "scenes.fig7_damping.cases[0].damping = 'k9'", "one of k1, k1m"),
        ("tuning", -0.5, "scenes.fig7_damping.cases[0].tuning = -0.5", "> 0"),
        (
            "change",
            {"contact_ratio": 2.5},
            "scenes.fig7_damping.cases[0].change.contact_ratio = 2.5",
            "from 1 to 2",
        ),
        ("change", {"mass": 2.5}, "scenes.fig7_damping.cases[0].change.mass", "reduced_mass"),
    ],
)
def test_a_wrong_case_is_refused_in_one_sentence(key, value, fault, allowed):
    settings = changed("run/revolutions", 5)
    settings["scenes"]["fig7_damping"]["cases"][0][key] = value
    with pytest.raises(ConfigError) as refusal:
        load(settings)
    (sentence,) = str(refusal.value).splitlines()
    assert sentence.startswith(fault)
    assert allowed in sentence


@pytest.mark.parametrize(
    ("key", "value", "fault", "allowed"),
    [
        ("name", "rk4-200", "failures.trials[0].name = 'rk4-200'", "different"),
        ("name", "rk 4", "failures.trials[0].name = 'rk 4'", "A-Za-z0-9+_-"),
        ("method", "ode45", "failures.trials[0].method = 'ode45'", "one of exact, taylor"),
        ("options", {"rtol": [1]}, "failures.trials[0].options.rtol = [1]", "finite number"),
        ("options", {"rtol": math.nan}, "failures.trials[0].options.rtol = nan", "finite number"),
        ("options", None, "failures.trials[0].options = null", "a mapping"),
    ],
)
def test_a_wrong_trial_is_refused_in_one_sentence(key, value, fault, allowed):
    settings = changed("run/revolutions", 5)
    settings["failures"]["trials"][0][key] = value
    with pytest.raises(ConfigError) as refusal:
        load(settings)
    (sentence,) = str(refusal.value).splitlines()
    assert sentence.startswith(fault)
    assert allowed in sentence


def test_options_of_a_trial_keep_their_types():
    settings = changed("run/revolutions", 5)
    options = {"steps": 200, "rtol": "1e-8", "events": True, "solver": "LSODA", "sharpness": 2.0}
    settings["failures"]["trials"][0]["options"] = options
    found = load(settings).failures.trials[0].options
    assert found == options | {"rtol": 1e-8}
    assert [type(v) for v in found.values()] == [int, float, bool, str, float]


def test_the_methods_of_trials_are_those_of_the_library():
    methods = schema()["$defs"]["Trial"]["properties"]["method"]["enum"]
    assert methods == [method.name for method in gearlib.methods()]


def test_the_packages_of_peers_are_those_of_the_library():
    packages = {
        name: module.PACKAGE.module
        for name, module in METHODS.items()
        if hasattr(module, "PACKAGE")
    }
    assert packages == PEERS


def test_too_many_samples_are_refused():
    settings = changed("run/samples_per_period", 60_000)
    settings["run"] |= {"revolutions": 100, "recorded_revolutions": 100}
    with pytest.raises(ConfigError, match="must be <= 100,000,000"):
        load(settings)


def test_too_many_jobs_are_refused():
    settings = changed("resonance/window", 1e-4)
    settings["resonance"]["step"] = 1e-4
    with pytest.raises(ConfigError, match=r"resonance.window = 0.0001 .* >= 0.00036"):
        load(settings)
    with pytest.raises(ConfigError, match=r"phase_planes.tunings has 2,501 entries"):
        load(changed("phase_planes/tunings", [0.5 + 1e-4 * i for i in range(2501)]))


def test_every_problem_gets_its_sentence():
    settings = changed("gear_pair/load", -1)
    settings["figures"]["dpi"] = 0
    with pytest.raises(ConfigError) as refusal:
        load(settings)
    assert len(str(refusal.value).splitlines()) == 2


@pytest.mark.parametrize("text", ["4e8", "4.0e8", "+4E+8", ".4e9", "4.e8", "400000000"])
def test_a_text_that_is_plainly_a_number_is_one(text):
    assert load(changed("gear_pair/max_stiffness", text)).gear_pair.max_stiffness == 4e8


@pytest.mark.parametrize("value", [math.inf, ".inf"])
def test_an_infinite_backlash_is_accepted(value):
    assert load(changed("gear_pair/backlash", value)).gear_pair.backlash == math.inf


def test_texts_inside_of_config_on_the_command_line_are_read():
    texts = {"run": {"revolutions": "6"}, "six_degrees": {"moving_backlash": "false"}}
    config = load({**PAPER, **{key: PAPER[key] | value for key, value in texts.items()}})
    assert config.run.revolutions == 6
    assert config.six_degrees.moving_backlash is False


def test_integers_stand_for_numbers():
    value = load(changed("gear_pair/load", 3000)).gear_pair.load
    assert isinstance(value, float)


def test_the_paper_is_configured():
    config = load(PAPER)
    assert (config.periods, config.record_periods) == (120, 24)
    assert config.resonance.count() == 1801
    pair = GearPair(**config.pair_parameters("k1+k1m"))
    assert pair.static_deflection == pytest.approx(10e-6, rel=1e-6)
    assert pair.backlash_ratio == pytest.approx(4.0, rel=1e-6)


@pytest.mark.parametrize("name", ["contact_ratio", "stiffness_ratio", "max_stiffness", "backlash"])
@pytest.mark.parametrize("value", [-1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, math.inf, math.nan])
def test_configuration_and_gear_pair_allow_the_same(name, value):
    settings = changed(f"gear_pair/{name}", value)
    try:
        GearPair(**settings["gear_pair"])
    except ValueError:
        with pytest.raises(ConfigError):
            load(settings)
    else:
        load(settings)


def test_every_key_is_described():
    for section in [schema(), *schema()["$defs"].values()]:
        assert section["description"]
        for key, node in section["properties"].items():
            assert node.get("description") or "$ref" in node, key
        assert section["additionalProperties"] is False


def test_reading_the_configuration_needs_no_numerical_stack():
    code = "import sys, yaml, gearlib.config, gearlib.integrators; "
    code += "gearlib.config.load(yaml.safe_load(open('config.yaml'))); "
    code += "print({'numpy', 'numba', 'xarray', 'gearlib.kernels'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "set()"
