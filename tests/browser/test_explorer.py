"""Test the explorer: the configurations of its sliders, its figures, and its page in a browser."""

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
from tests.browser.chromium import (
    browser,
    console_errors,
    find_elements_in_shadow_roots,
    visible_texts,
    wait_for,
)
from tests.paper import CONFIG

assert browser  # a fixture

GEAR_CONFIG = {
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
TRAIN_CONFIG = {"train": {"kind": "planetary"}}
TIP_RELIEF_CONFIG = config.overlay(GEAR_CONFIG, {"gears": {"pinion": {"tip_relief": RELIEF}}})


def move_sliders(settings, damping, **values):
    """Return the configuration after some sliders were moved to values in SI units."""
    sliders = page.Sliders(settings, damping)
    initial_values = {name: slider.initial for name, slider in sliders.sliders.items()}
    assert values.keys() <= initial_values.keys()
    return sliders.configuration(initial_values | values)


def build_pair(settings, damping):
    """Return the gear pair of a configuration with a named damping."""
    return build_model(config.load(settings).pair_description(damping))


@pytest.mark.parametrize(("settings", "damping"), [(CONFIG, "k1"), (TIP_RELIEF_CONFIG, "d")])
def test_each_slider_starts_within_its_limits(settings, damping):
    for name, slider in page.Sliders(settings, damping).sliders.items():
        initial = slider.initial / slider.unit
        assert slider.low <= initial <= slider.high - slider.step, name


def test_untouched_sliders_keep_the_configuration_and_the_first_tuning():
    """Only the list of tunings may become shorter, because the page shows a single tuning."""
    first_tuning = CONFIG["phase_planes"]["tunings"][0]
    unchanged = CONFIG | {"phase_planes": CONFIG["phase_planes"] | {"tunings": [first_tuning]}}
    assert move_sliders(CONFIG, "k1") == unchanged
    unchanged = move_sliders(GEAR_CONFIG, "d")
    (tuning,) = unchanged.pop("phase_planes")["tunings"]
    assert unchanged == GEAR_CONFIG and build_pair(GEAR_CONFIG, "d").speed(tuning) == pytest.approx(
        9000.0
    )


def test_sliders_of_a_pair_change_its_numbers():
    """Moved sliders must change their parameters, and nothing else in the configuration."""
    values = {"tuning": 0.73, "backlash": 60e-6, "stiffness_ratio": 0.7, "damping_ratio": 0.1}
    configuration = move_sliders(CONFIG, "k1", **values)
    pair, initial_pair = build_pair(configuration, "k1"), build_pair(CONFIG, "k1")
    expected = initial_pair.replace(backlash=60e-6, stiffness_ratio=0.7)
    critical_damping = 2.0 * expected.reduced_mass * expected.mean_eigenfrequency
    assert pair.material_damping == pytest.approx(0.1 * critical_damping, rel=1e-11)
    assert replace(pair, material_damping=initial_pair.material_damping) == expected
    assert configuration["phase_planes"]["tunings"] == [0.73]
    assert config.load(configuration).scenes == config.load(CONFIG).scenes


def test_sliders_of_gear_geometry_change_the_gears():
    """The gears must get the values of the sliders; the tip must move with the profile shift."""
    values = {"module": 3e-3, "pinion_teeth": 25, "pinion_shift": 0.2, "helix_angle": 0.2}
    values |= {"torque": 40.0, "speed": 5000.0, "backlash": 100e-6, "width": 0.02}
    configuration = move_sliders(GEAR_CONFIG, "d", **values)
    stage, initial_stage = (
        config.load(settings).gears.gear_stage() for settings in (configuration, GEAR_CONFIG)
    )
    pinion = stage.pinion
    assert (pinion.teeth, pinion.module, pinion.shift) == (25, 3e-3, 0.2)
    assert (stage.wheel.module, stage.wheel.helix_angle, stage.width) == (3e-3, 0.2, 0.02)
    # Without the profile shift, the addendum in units of the module must not change.
    addendum, initial_addendum = (
        (gear.tip_diameter - gear.reference_diameter) / 2.0 / gear.module - gear.shift
        for gear in (pinion, initial_stage.pinion)
    )
    assert addendum == pytest.approx(initial_addendum, rel=1e-9)
    assert configuration["gears"]["torque"] == 40.0 and "power" not in configuration["gears"]
    assert stage.backlash == 100e-6
    (tuning,) = configuration["phase_planes"]["tunings"]
    assert build_pair(configuration, "d").speed(tuning) == pytest.approx(5000.0)


def test_sliders_scale_given_reliefs_and_limit_the_length_of_new_ones():
    """A given relief must scale with the module; a new one has the longest permissible length."""
    stage = config.load(
        move_sliders(TIP_RELIEF_CONFIG, "d", tip_relief=30e-6, module=5e-3)
    ).gears.gear_stage()
    assert stage.pinion.tip_relief.amount == pytest.approx(30e-6)
    assert stage.pinion.tip_relief.length == pytest.approx(4e-3)
    assert stage.wheel.tip_relief is None
    stage = config.load(move_sliders(GEAR_CONFIG, "d", tip_relief=30e-6)).gears.gear_stage()
    for gear in (stage.pinion, stage.wheel):
        assert gear.tip_relief.length == pytest.approx(stage.longest_relief)


def test_a_view_of_a_pair_matches_the_library():
    """Motion, multipliers, sweeps and orders in a view must be those that the library computes."""
    view = compute_view(move_sliders(CONFIG, "k1", tuning=0.81), "k1")
    pair = build_pair(CONFIG, "k1")
    # These numbers of periods and tunings are those that `gearlib.explorer.view` uses.
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
    """Transmission error, motion and derived quantities must be those of a `LoadSharingPair`."""
    view, gears = (
        compute_view(move_sliders(TIP_RELIEF_CONFIG, "d"), "d"),
        config.load(TIP_RELIEF_CONFIG).gears,
    )
    power, speed = 30e3, 9000.0  # W and rpm, as in the configuration
    torque = power / (speed * math.tau / 60.0)
    error = gears.gear_stage().transmission_error(torque, stiffness="energy")
    np.testing.assert_allclose(view.harris_map.transmission_error[-1], error.transmission_error[0])
    model = gearlib.LoadSharingPair.from_geometry(
        gears.gear_stage(), torque=torque, damping_ratio=0.03, backlash_damping_ratio=0.01
    )
    # The record spans one revolution of the pinion, which has 23 teeth, after 280 mesh periods.
    run_options = {"periods": 280 + 23, "record_periods": 23}
    run = gearlib.simulate(
        model, speed=speed, **run_options, initial_state="static", until_settled=True
    )
    assert float(view.run.displacement_max) == pytest.approx(float(run.displacement_max), rel=1e-9)
    quantities = dict(derived_quantities(view))
    factor = gearlib.duty_point(model, 9000.0).dynamic_factor.item()
    assert float(view.run.dynamic_factor) == pytest.approx(factor, rel=1e-9)
    assert quantities["K_v by simulation, without gear quality"] == f"{factor:.4f}"
    assert quantities["contact ratio"] == f"{gears.gear_stage().contact_ratio:.4f}"
    assert quantities["peak-to-peak error"] == f"{1e6 * error.peak_to_peak_error.item():.2f} µm"


def test_curves_over_speed_match_sweeps_and_show_the_iso_factor():
    """Curves of dynamic factors and errors must be those of sweeps, and K_v that of ISO 6336."""
    quality = {"gears": {"pinion": {"quality": 6}, "wheel": {"quality": 6}}}
    settings = config.overlay(GEAR_CONFIG, quality)
    shown, gears = page.Page(settings, "d"), config.load(settings).gears
    arguments = {"damping_ratio": 0.03, "backlash_damping_ratio": 0.01}
    torque = gears.driving_torque()
    model = gearlib.LoadSharingPair.from_geometry(gears.gear_stage(), torque=torque, **arguments)
    curves = {name: source.data for name, source in shown.figures.sources.items()}
    speeds = curves["up"]["x"]
    for direction in ("up", "down"):
        run_options = {"periods": 70, "record_periods": 10, "initial_state": "static"}
        sweep = gearlib.sweep(model, speeds=speeds, direction=direction, **run_options)
        np.testing.assert_allclose(curves[direction]["y"], sweep.dynamic_factor, rtol=1e-9)
        peak_to_peak = sweep.displacement_max - sweep.displacement_min
        micrometres = 1e6 * model.static_deflection * peak_to_peak
        np.testing.assert_allclose(curves[f"{direction}_error"]["y"], micrometres, rtol=1e-9)
    iso = geometry.dynamic_factor(gears.gear_stage(), torque, speeds).factor
    np.testing.assert_allclose(curves["iso"]["y"], iso, rtol=1e-9)
    # The jumps of the main resonance and of a lower one are more than 1000 rpm apart.
    jump_speeds = curves["jumps"]["x"]
    assert 0.0 < np.nanmin(jump_speeds) < np.nanmax(jump_speeds) - 1000.0


def test_the_damping_slider_shows_the_damping_ratio_of_the_load_sharing_model():
    """A configured damping coefficient must be shown as a ratio and survive other changes."""
    damping = {"material_damping": 500.0, "backlash_damping": 3.0}
    settings = GEAR_CONFIG | {"dampings": {"d": damping}}
    load_sharing_pair = build_model(config.load(settings).model_description("d"))
    shown = page.Sliders(settings, "d")
    assert shown.sliders["damping_ratio"].initial == pytest.approx(
        load_sharing_pair.damping_ratio, rel=1e-11
    )
    # A changed torque must not change the damping coefficient of the motion.
    changed = config.load(move_sliders(settings, "d", torque=40.0)).model_description("d")
    assert build_model(changed).material_damping == pytest.approx(500.0, rel=0.02)


@pytest.mark.parametrize("settings", [GEAR_CONFIG, TIP_RELIEF_CONFIG])
def test_shares_of_neighbouring_tooth_pairs_add_up_to_the_load(settings):
    """Load shares one base pitch apart must add up to 1, and match the forces of the library."""
    shown, stage = page.Page(settings, "d"), config.load(settings).gears.gear_stage()
    position, share = (shown.figures.sources["share"].data[axis] for axis in "xy")
    # The next tooth pair follows one base pitch, or 256 samples, later.
    assert 256 * (position[1] - position[0]) == pytest.approx(1e3 * stage.base_pitch, rel=1e-9)
    assert position[[0, -1]] == pytest.approx(1e3 * np.array(stage.path), abs=0.1)
    np.testing.assert_allclose(share[256:] + share[:-256], 1.0, rtol=1e-12)
    np.testing.assert_allclose(share[position.size - 256 : 256], 1.0, rtol=1e-12)
    model = gearlib.LoadSharingPair.from_geometry(
        stage, torque=30e3 / (300.0 * math.pi), corner_contact=False
    )
    forces = model.tooth_forces([0.0], model.static_state(0.5)[:1])[0]
    # At phase 0, the middle of double contact, the newest tooth pair is near the start of the path.
    middle = 1e3 * (stage.path[0] + (stage.contact_ratio % 1.0 / 2.0) * stage.base_pitch)
    assert np.interp(middle, position, share) == pytest.approx(forces[0] / model.load, rel=1e-6)


def test_moving_a_slider_redraws_the_figures_or_shows_why_it_is_refused():
    """Valid values must redraw all figures; an invalid one must hide them and show the reason."""
    shown = page.Page(GEAR_CONFIG, "d")
    initial_curves = {name: source.data["y"] for name, source in shown.figures.sources.items()}
    shown.widgets["torque"].value = 60.0
    sources = shown.figures.sources
    for name, source in sources.items():
        # The unloaded transmission error, "0", does not depend on the torque.
        assert len(source.data["x"]) and (
            source.data["y"] is not initial_curves[name] or name == "0"
        ), name
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
    # For helical gears a base pitch has 64 samples; the shares of all tooth pairs add up to 1.
    share = sources["share"].data["y"]
    shares = np.append(share, np.zeros(-share.size % 64)).reshape(-1, 64)
    np.testing.assert_allclose(shares.sum(axis=0), 1.0, rtol=1e-12)


@pytest.mark.parametrize(("name", "clicked_value"), [("tuning", 0.8312), ("speed", 9000.4)])
def test_clicking_the_resonance_curve_moves_the_speed_slider(name, clicked_value):
    """The slider must move to the clicked tuning or speed, at most to its end."""
    shown = page.Page(CONFIG, "k1") if name == "tuning" else page.Page(GEAR_CONFIG, "d")
    widget = shown.widgets[name]
    for x in (clicked_value, 1e9):
        shown.handle_click(Tap(shown.figures.resonance, x=x, y=1.0))
        assert widget.value == pytest.approx(min(x, widget.end), abs=widget.step)
        assert shown.figures.marker.location == pytest.approx(widget.value, rel=1e-9)


@pytest.mark.parametrize(
    ("settings", "options", "message"),
    [
        (TRAIN_CONFIG, (), "gears is missing: the configuration describes only a train"),
        (GEAR_CONFIG, ("--model", "train"), "No such option"),
    ],
)
def test_a_configuration_that_the_page_cannot_show_is_refused(
    tmp_path, monkeypatch, settings, options, message
):
    """The command must fail with a message before it starts a server."""
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(settings), encoding="utf-8")
    monkeypatch.setattr(page, "serve", lambda *_: pytest.fail("the page was served"))
    command = ["explore", "--config", str(tmp_path / "mine.yaml"), *options]
    result = CliRunner().invoke(cli.main, command)
    assert result.exit_code == 2 and message in result.output


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """Start an explorer of the gears in GEAR_CONFIG, yield its address, and stop it."""
    with socket.socket() as port_socket:
        port_socket.bind(("127.0.0.1", 0))  # the system chooses a free port
        port = port_socket.getsockname()[1]
    folder = tmp_path_factory.mktemp("explored")
    (folder / "config.yaml").write_text(yaml.safe_dump(GEAR_CONFIG), encoding="utf-8")
    command = [sys.executable, "-m", "gearlib", "explore", "--no-show", "--port", str(port)]
    server = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    yield f"http://127.0.0.1:{port}"
    server.kill()
    server.wait()


def _find_note(driver, old_note=""):
    """Return the note about the motion, or "" while the page still shows the old note."""
    notes = (
        text for text in visible_texts(driver, "p") if "The motion from static equilibrium" in text
    )
    return next((text for text in notes if text != old_note), "")


def _is_reachable(driver, address):
    """Return whether the browser can open the explorer."""
    try:
        driver.get(address)
    except Exception:  # the server has not started yet
        return False
    return "gearlib" in driver.title


@pytest.mark.slow
def test_the_page_in_a_browser_follows_sliders_fits_the_window_and_saves(browser, address):
    """A moved slider must change note and saved configuration; no width may need scrolling."""
    wait_for(lambda: _is_reachable(browser, address))
    first_note = wait_for(lambda: _find_note(browser))
    # The page has at least six figures with a canvas, and each slider has a handle.
    wait_for(lambda: len(visible_texts(browser, "canvas")) >= 6)
    handles = wait_for(lambda: find_elements_in_shadow_roots(browser, ".noUi-handle"))
    names = list(page.Sliders(GEAR_CONFIG, "d").sliders)
    assert len(handles) == len(names) == 13
    handles[names.index("module")].send_keys(Keys.PAGE_UP * 2)
    second_note = wait_for(lambda: _find_note(browser, first_note))
    assert re.search(r"Computed in \d+ ms", second_note)
    for width in (1280, 420):
        size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        root = "document.documentElement"
        assert browser.execute_script(f"return {root}.scrollWidth - {root}.clientWidth;") == 0
    buttons = find_elements_in_shadow_roots(browser, "a.bk-btn, button.bk-btn, a[download]")
    next(button for button in buttons if "Save" in button.text).click()
    saved = wait_for(lambda: list(browser.downloads.glob("config*.yaml")))[0]
    text = wait_for(lambda: saved.read_text(encoding="utf-8"))
    assert config.load(yaml.safe_load(text)).gears.pinion.module > 2.5e-3
    assert console_errors(browser) == []
