"""The explorer: configurations made by its sliders, its figures, and a real browser."""

import math
import re
import socket
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from bokeh.events import Tap
from click.testing import CliRunner
from selenium.webdriver.common.keys import Keys

import gearlib
from gearlib import cli, config, geometry
from gearlib.explorer import page
from gearlib.explorer.figures import derived_quantities
from gearlib.explorer.view import SAMPLES, SHOWN_PERIODS, compute_view
from gearlib.models.from_values import build_model
from tests.browser.chromium import browser, errors, everywhere, texts, wait_for
from tests.paper import CONFIG

assert browser  # a fixture

GEOMETRY = {
    "gears": {
        "pinion": {"teeth": 23, "module": "2.5 mm", "width": "18 mm", "tip_diameter": "62 mm"},
        "wheel": {"teeth": 61},
        "backlash": "80 um",
        "power": "30 kW",
        "speed": "9000 rpm",
    },
    "dampings": {"d": {"damping_ratio": 0.03, "backlash_damping_ratio": 0.01}},
}
RELIEF = {"amount": "15 um", "length": "2 mm", "shape": "parabolic"}
#: Number of samples of the time history that the page draws.
SHOWN_SAMPLES = SHOWN_PERIODS * SAMPLES
TRAIN = {"train": {"kind": "planetary"}}
RELIEVED = config.overlay(GEOMETRY, {"gears": {"pinion": {"tip_relief": RELIEF}}})


def moved_configuration(settings, damping, **values):
    """Return a configuration after some of its sliders moved to values in SI units."""
    gears = page.Sliders(settings, damping)
    initial = {name: slider.initial for name, slider in gears.sliders.items()}
    assert values.keys() <= initial.keys()
    return gears.configuration(initial | values)


def pair_of(settings, damping):
    """Return the gear pair of a configuration with a named damping."""
    return build_model(config.load(settings).pair_description(damping))


@pytest.mark.parametrize(("settings", "damping"), [(CONFIG, "k1"), (RELIEVED, "d")])
def test_each_slider_starts_within_its_limits(settings, damping):
    for name, slider in page.Sliders(settings, damping).sliders.items():
        initial = slider.initial / slider.unit
        assert slider.low <= initial <= slider.high - slider.step, name


def test_untouched_sliders_keep_the_configuration_and_the_first_tuning():
    first_tuning = CONFIG["phase_planes"]["tunings"][0]
    unchanged = CONFIG | {"phase_planes": CONFIG["phase_planes"] | {"tunings": [first_tuning]}}
    assert moved_configuration(CONFIG, "k1") == unchanged
    unchanged = moved_configuration(GEOMETRY, "d")
    (tuning,) = unchanged.pop("phase_planes")["tunings"]
    assert unchanged == GEOMETRY and pair_of(GEOMETRY, "d").speed(tuning) == pytest.approx(9000.0)


def test_sliders_of_a_pair_change_its_numbers():
    """Moved values must change, and all other values and sections must stay."""
    values = {"tuning": 0.73, "backlash": 60e-6, "stiffness_ratio": 0.7, "damping_ratio": 0.1}
    configuration = moved_configuration(CONFIG, "k1", **values)
    pair, before = pair_of(configuration, "k1"), pair_of(CONFIG, "k1")
    expected = before.replace(backlash=60e-6, stiffness_ratio=0.7)
    critical = 2.0 * expected.reduced_mass * expected.mean_eigenfrequency
    assert pair.material_damping == pytest.approx(0.1 * critical, rel=1e-11)
    assert replace(pair, material_damping=before.material_damping) == expected
    assert configuration["phase_planes"]["tunings"] == [0.73]
    assert config.load(configuration).scenes == config.load(CONFIG).scenes


def test_sliders_of_gear_geometry_change_the_gears_of_the_library():
    values = {"module": 3e-3, "pinion_teeth": 25, "pinion_shift": 0.2, "helix_angle": 0.2}
    values |= {"torque": 40.0, "speed": 5000.0, "backlash": 100e-6, "width": 0.02}
    configuration = moved_configuration(GEOMETRY, "d", **values)
    mesh, old_mesh = (
        config.load(settings).gears.gear_stage() for settings in (configuration, GEOMETRY)
    )
    pinion = mesh.pinion
    assert (pinion.teeth, pinion.module, pinion.shift) == (25, 3e-3, 0.2)
    assert (mesh.wheel.module, mesh.wheel.helix_angle, mesh.width) == (3e-3, 0.2, 0.02)
    # Without the shift the addendum in modules must not change.
    addendum, old_addendum = (
        (gear.tip_diameter - gear.reference_diameter) / 2.0 / gear.module - gear.shift
        for gear in (pinion, old_mesh.pinion)
    )
    assert addendum == pytest.approx(old_addendum, rel=1e-9)
    assert configuration["gears"]["torque"] == 40.0 and "power" not in configuration["gears"]
    assert mesh.backlash == 100e-6
    (tuning,) = configuration["phase_planes"]["tunings"]
    assert pair_of(configuration, "d").speed(tuning) == pytest.approx(5000.0)


def test_sliders_scale_reliefs_or_limit_them_to_the_region_of_single_contact():
    mesh = config.load(
        moved_configuration(RELIEVED, "d", tip_relief=30e-6, module=5e-3)
    ).gears.gear_stage()
    assert mesh.pinion.tip_relief.amount == pytest.approx(30e-6)
    assert mesh.pinion.tip_relief.length == pytest.approx(4e-3)
    assert mesh.wheel.tip_relief is None
    mesh = config.load(moved_configuration(GEOMETRY, "d", tip_relief=30e-6)).gears.gear_stage()
    for gear in (mesh.pinion, mesh.wheel):
        assert gear.tip_relief.length == pytest.approx(mesh.longest_relief)


def test_a_view_of_a_pair_matches_the_library():
    """Compare motion, multipliers, sweeps and orders of a view with the library."""
    view = compute_view(moved_configuration(CONFIG, "k1", tuning=0.81), "k1")
    pair = pair_of(CONFIG, "k1")
    # These settings are the ones of `gearlib.explorer.view`.
    run = gearlib.simulate(pair, 0.81, periods=304, record_periods=SHOWN_PERIODS)
    np.testing.assert_array_equal(view.run.displacement[-SHOWN_SAMPLES:], run.displacement)
    orbit = gearlib.periodic_orbit(pair, 0.81, guess=run.final_state.values)
    np.testing.assert_allclose(np.abs(view.multipliers), np.abs(orbit.multipliers), rtol=1e-9)
    tunings = np.linspace(0.5, 1.4, 500)
    for direction, curve in (("up", view.sweep_up), ("down", view.sweep_down)):
        sweep = gearlib.sweep(pair, tunings, periods=70, record_periods=10, direction=direction)
        np.testing.assert_array_equal(curve.displacement_max, sweep.displacement_max)
    np.testing.assert_array_equal(
        view.orders.force_amplitude, gearlib.orders(view.run).force_amplitude
    )


def test_a_view_of_gears_given_by_geometry_shows_the_load_sharing_model():
    """Compare transmission error, motion and derived quantities of a view with the library."""
    view, gears = compute_view(moved_configuration(RELIEVED, "d"), "d"), config.load(RELIEVED).gears
    # GEOMETRY has a power of 30 kW and a speed of 9000 rpm.
    torque = 30e3 / (9000.0 * math.tau / 60.0)
    error = gears.gear_stage().transmission_error(torque, stiffness="energy")
    np.testing.assert_allclose(view.harris_map.transmission_error[-1], error.transmission_error[0])
    model = gearlib.LoadSharingPair.from_geometry(
        gears.gear_stage(), torque=torque, damping_ratio=0.03, backlash_damping_ratio=0.01
    )
    # The record spans a revolution of the pinion of 23 teeth, after 280 mesh periods.
    periods = {"periods": 280 + 23, "record_periods": 23}
    run = gearlib.simulate(
        model, speed=9000.0, **periods, initial_state="static", until_settled=True
    )
    assert float(view.run.displacement_max) == pytest.approx(float(run.displacement_max), rel=1e-9)
    quantities = dict(derived_quantities(view))
    factor = gearlib.duty_point(model, 9000.0).dynamic_factor.item()
    assert float(view.run.dynamic_factor) == pytest.approx(factor, rel=1e-9)
    assert quantities["K_v by simulation, without gear quality"] == f"{factor:.4f}"
    assert quantities["contact ratio"] == f"{gears.gear_stage().contact_ratio:.4f}"
    assert quantities["peak-to-peak error"] == f"{1e6 * error.peak_to_peak_error.item():.2f} µm"


def test_curves_over_speed_match_sweeps_and_show_the_iso_factor():
    """Compare dynamic factors, errors and jumps over speed with sweeps and with ISO 6336."""
    quality = {"gears": {"pinion": {"quality": 6}, "wheel": {"quality": 6}}}
    settings = config.overlay(GEOMETRY, quality)
    shown, gears = page.Page(settings, "d"), config.load(settings).gears
    arguments = {"damping_ratio": 0.03, "backlash_damping_ratio": 0.01}
    torque = gears.driving_torque()
    model = gearlib.LoadSharingPair.from_geometry(gears.gear_stage(), torque=torque, **arguments)
    curves = {name: source.data for name, source in shown.figures.sources.items()}
    speeds = curves["up"]["x"]
    for direction in ("up", "down"):
        run = {"periods": 70, "record_periods": 10, "initial_state": "static"}
        sweep = gearlib.sweep(model, speeds=speeds, direction=direction, **run)
        np.testing.assert_allclose(curves[direction]["y"], sweep.dynamic_factor, rtol=1e-9)
        height = 1e6 * model.static_deflection * (sweep.displacement_max - sweep.displacement_min)
        np.testing.assert_allclose(curves[f"{direction}_error"]["y"], height, rtol=1e-9)
    iso = geometry.dynamic_factor(gears.gear_stage(), torque, speeds).factor
    np.testing.assert_allclose(curves["iso"]["y"], iso, rtol=1e-9)
    jumps = curves["jumps"]["x"]
    assert 0.0 < np.nanmin(jumps) < np.nanmax(jumps) - 1000.0


def test_sliders_of_gear_geometry_show_the_damping_ratio_of_the_load_sharing_model():
    damping = {"material_damping": 500.0, "backlash_damping": 3.0}
    settings = GEOMETRY | {"dampings": {"d": damping}}
    pairs_of_teeth = build_model(config.load(settings).model_description("d"))
    shown = page.Sliders(settings, "d")
    assert shown.sliders["damping_ratio"].initial == pytest.approx(
        pairs_of_teeth.damping_ratio, rel=1e-11
    )
    # A changed torque must not change the damping coefficient of the motion.
    changed = config.load(moved_configuration(settings, "d", torque=40.0)).model_description("d")
    assert build_model(changed).material_damping == pytest.approx(500.0, rel=0.02)


@pytest.mark.parametrize("settings", [GEOMETRY, RELIEVED])
def test_shares_of_neighbouring_tooth_pairs_add_up_to_the_load(settings):
    """Compare the drawn load share over the path with its sum rule and with the library."""
    shown, mesh = page.Page(settings, "d"), config.load(settings).gears.gear_stage()
    position, share = (shown.figures.sources["share"].data[axis] for axis in "xy")
    # There are 256 samples in a base pitch, by which the next tooth pair follows.
    assert 256 * (position[1] - position[0]) == pytest.approx(1e3 * mesh.base_pitch, rel=1e-9)
    assert position[[0, -1]] == pytest.approx(1e3 * np.array(mesh.path), abs=0.1)
    np.testing.assert_allclose(share[256:] + share[:-256], 1.0, rtol=1e-12)
    np.testing.assert_allclose(share[position.size - 256 : 256], 1.0, rtol=1e-12)
    model = gearlib.LoadSharingPair.from_geometry(
        mesh, torque=30e3 / (300.0 * math.pi), corner_contact=False
    )
    forces = model.tooth_forces([0.0], model.static_state(0.5)[:1])[0]
    # At phase 0, the middle of double contact, the last pair is near the start of the path.
    middle = 1e3 * (mesh.path[0] + (mesh.contact_ratio % 1.0 / 2.0) * mesh.base_pitch)
    assert np.interp(middle, position, share) == pytest.approx(forces[0] / model.load, rel=1e-6)


def test_moving_a_slider_redraws_the_figures_or_shows_why_it_is_refused():
    """Move the torque, then an invalid profile shift, then the helix angle."""
    shown = page.Page(GEOMETRY, "d")
    before = {name: source.data["y"] for name, source in shown.figures.sources.items()}
    shown.widgets["torque"].value = 60.0
    sources = shown.figures.sources
    for name, source in sources.items():
        # The unloaded transmission error, "0", does not depend on the torque.
        assert len(source.data["x"]) and (source.data["y"] is not before[name] or name == "0"), name
    view = compute_view(shown.configuration(), "d")
    for name, axis, values in (
        ("plane", "x", view.run.displacement[-SHOWN_SAMPLES:]),
        ("force", "y", view.run.dynamic_force[-SHOWN_SAMPLES:]),
        ("multipliers", "x", view.multipliers.real),
        ("multipliers", "y", view.multipliers.imag),
    ):
        np.testing.assert_array_equal(sources[name].data[axis], values)
    np.testing.assert_allclose(
        sources["chosen"].data["y"][:-1],
        1e6 * view.harris_map.transmission_error.values[-1],
    )
    assert yaml.safe_load(shown.config_file().read()) == shown.configuration()
    shown.widgets["pinion_shift"].value = -0.9
    assert "gears.pinion.shift = -0.9 is not allowed" in shown.note.object
    assert not shown.figure_column.visible and shown.button.disabled
    shown.widgets["pinion_shift"].value = 0.0
    shown.widgets["helix_angle"].value = 10.0
    assert shown.figure_column.visible
    # For helical gears a base pitch has 64 samples, at which the shares of all pairs add up to 1.
    share = sources["share"].data["y"]
    shares = np.append(share, np.zeros(-share.size % 64)).reshape(-1, 64)
    np.testing.assert_allclose(shares.sum(axis=0), 1.0, rtol=1e-12)


@pytest.mark.parametrize(("name", "at"), [("tuning", 0.8312), ("speed", 9000.4)])
def test_clicking_the_resonance_curve_moves_the_speed_slider(name, at):
    shown = page.Page(CONFIG, "k1") if name == "tuning" else page.Page(GEOMETRY, "d")
    widget = shown.widgets[name]
    for x in (at, 1e9):
        shown.handle_click(Tap(shown.figures.resonance, x=x, y=1.0))
        assert widget.value == pytest.approx(min(x, widget.end), abs=widget.step)
        assert shown.figures.marker.location == pytest.approx(widget.value, rel=1e-9)


@pytest.mark.parametrize(
    ("settings", "options", "words"),
    [
        (TRAIN, (), "gears is missing: the configuration describes only a train"),
        (GEOMETRY, ("--model", "train"), "No such option"),
    ],
)
def test_a_configuration_that_the_page_cannot_show_is_refused(
    tmp_path, monkeypatch, settings, options, words
):
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(settings), encoding="utf-8")
    monkeypatch.setattr(page, "serve", lambda *_: pytest.fail("it was served"))
    command = ["explore", "--config", str(tmp_path / "mine.yaml"), *options]
    result = CliRunner().invoke(cli.main, command)
    assert result.exit_code == 2 and words in result.output


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Start an explorer of the gears GEOMETRY and return its address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    folder = tmp_path_factory.mktemp("explored")
    (folder / "config.yaml").write_text(yaml.safe_dump(GEOMETRY), encoding="utf-8")
    command = [sys.executable, "-m", "gearlib", "explore", "--no-show", "--port", str(port)]
    server = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    yield f"http://127.0.0.1:{port}"
    server.kill()
    server.wait()


def _note(driver, old=""):
    """Return the note about the motion, or "" while the page still shows the old note."""
    notes = (text for text in texts(driver, "p") if "The motion from static equilibrium" in text)
    return next((text for text in notes if text != old), "")


def _reachable(driver, address):
    """Return whether the explorer can be opened."""
    try:
        driver.get(address)
    # The server may not have started yet.
    except Exception:
        return False
    return "gearlib" in driver.title


@pytest.mark.slow
def test_the_page_in_a_browser_follows_sliders_fits_the_window_and_saves(browser, address):
    """Move a slider, narrow the window and save the configuration in a real browser."""
    wait_for(lambda: _reachable(browser, address))
    first_note = wait_for(lambda: _note(browser))
    # Each figure has at least one canvas, and each slider of GEOMETRY has a handle.
    wait_for(lambda: len(texts(browser, "canvas")) >= 6)
    handles = wait_for(lambda: everywhere(browser, ".noUi-handle"))
    names = list(page.Sliders(GEOMETRY, "d").sliders)
    assert len(handles) == len(names) == 13
    handles[names.index("module")].send_keys(Keys.PAGE_UP * 2)
    second_note = wait_for(lambda: _note(browser, first_note))
    assert re.search(r"Computed in \d+ ms", second_note)
    for width in (1280, 420):
        size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        root = "document.documentElement"
        assert browser.execute_script(f"return {root}.scrollWidth - {root}.clientWidth;") == 0
    buttons = everywhere(browser, "a.bk-btn, button.bk-btn, a[download]")
    next(button for button in buttons if "Save" in button.text).click()
    saved = wait_for(lambda: list(browser.downloads.glob("config*.yaml")))[0]
    text = wait_for(lambda: saved.read_text(encoding="utf-8"))
    assert config.load(yaml.safe_load(text)).gears.pinion.module > 2.5e-3
    assert errors(browser) == []
