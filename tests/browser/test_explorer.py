"""The explorer: what its sliders make of a configuration, what is drawn, and one real browser."""

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
from gearlib import cli, config
from gearlib.explorer import page, sliders
from gearlib.explorer.figures import derived_quantities
from gearlib.explorer.view import compute_view
from tests.browser.chromium import browser, errors, everywhere, texts, wait_for

assert browser  # a fixture

DRAWN = {
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
RELIEVED = config.overlay(DRAWN, {"gears": {"pinion": {"tip_relief": RELIEF}}})


def moved(mapping, damping, **values):
    """Return the sliders of a configuration, and the one that they make with some values, SI."""
    gears = sliders.Sliders(mapping, damping)
    start = {name: one.initial for name, one in gears.sliders.items()}
    assert values.keys() <= start.keys()
    return gears, gears.configuration(start | values)


def pair_of(mapping, damping):
    return gearlib.GearPair(**config.load(mapping).pair_parameters(damping))


def test_what_is_not_moved_stays_as_it_is_given(mapping):
    for given, damping in ((mapping, "k1"), (DRAWN, "d")):
        again = moved(given, damping)[1]
        tuning = again.pop("phase_planes")["tunings"]
        assert again == {key: value for key, value in given.items() if key != "phase_planes"}
        assert tuning == [mapping["phase_planes"]["tunings"][0]] or given is DRAWN
    assert pair_of(DRAWN, "d").speed(tuning[0]) == pytest.approx(9000.0)


def test_sliders_of_a_pair_change_its_numbers(mapping):
    values = {"tuning": 0.73, "backlash": 60e-6, "stiffness_ratio": 0.7, "damping_ratio": 0.1}
    whole = moved(mapping, "k1", **values)[1]
    pair, before = pair_of(whole, "k1"), pair_of(mapping, "k1")
    expected = before.replace(backlash=60e-6, stiffness_ratio=0.7)
    critical = 2.0 * expected.reduced_mass * expected.mean_eigenfrequency
    assert pair.material_damping == pytest.approx(0.1 * critical, rel=1e-11)
    assert replace(pair, material_damping=before.material_damping) == expected
    assert whole["phase_planes"]["tunings"] == [0.73]
    assert config.load(whole).scenes == config.load(mapping).scenes


def test_sliders_of_a_drawing_change_the_gears_of_the_library():
    values = {"module": 3e-3, "pinion_teeth": 25, "pinion_shift": 0.2, "helix_angle": 0.2}
    values |= {"torque": 40.0, "speed": 5000.0, "backlash": 100e-6, "width": 0.02}
    gears, whole = moved(DRAWN, "d", **values)
    mesh, before = config.load(whole).gears.mesh(), config.load(DRAWN).gears.mesh()
    pinion, old = mesh.pinion, before.pinion
    assert (pinion.teeth, pinion.module, pinion.shift) == (25, 3e-3, 0.2)
    assert (mesh.wheel.module, mesh.wheel.helix_angle, mesh.width) == (3e-3, 0.2, 0.02)
    # Tips stay as high above the shifted profile, in modules.
    above = [
        (one.tip_diameter - one.reference_diameter) / 2.0 / one.module - one.shift
        for one in (pinion, old)
    ]
    assert above[0] == pytest.approx(above[1], rel=1e-9)
    assert whole["gears"]["torque"] == 40.0 and "power" not in whole["gears"]
    assert mesh.backlash == 100e-6
    (tuning,) = whole["phase_planes"]["tunings"]
    assert pair_of(whole, "d").speed(tuning) == pytest.approx(5000.0)


def test_reliefs_change_in_proportion_or_are_as_long_as_single_contact_allows():
    mesh = config.load(moved(RELIEVED, "d", tip_relief=30e-6, module=5e-3)[1]).gears.mesh()
    assert mesh.pinion.tip_relief.amount == pytest.approx(30e-6)
    assert mesh.pinion.tip_relief.length == pytest.approx(4e-3)
    assert mesh.wheel.tip_relief is None
    mesh = config.load(moved(DRAWN, "d", tip_relief=30e-6)[1]).gears.mesh()
    for gear in (mesh.pinion, mesh.wheel):
        assert gear.tip_relief.length == pytest.approx(mesh.longest_relief)


def test_a_view_of_a_pair_shows_what_the_library_computes(mapping):
    whole = moved(mapping, "k1", tuning=0.81)[1]
    seen, pair = compute_view(whole, "k1"), pair_of(mapping, "k1")
    run = gearlib.simulate(pair, 0.81, periods=304, record_periods=3)
    np.testing.assert_array_equal(seen.run.displacement[-768:], run.displacement)
    orbit = gearlib.periodic_orbit(pair, 0.81, guess=run.final_state.values)
    np.testing.assert_allclose(np.abs(seen.multipliers), np.abs(orbit.multipliers), rtol=1e-9)
    grid = np.linspace(0.5, 1.4, 500)
    for way, found in (("up", seen.up), ("down", seen.down)):
        swept = gearlib.sweep(pair, grid, periods=70, record_periods=10, direction=way)
        np.testing.assert_array_equal(found.displacement_max, swept.displacement_max)
    np.testing.assert_array_equal(
        seen.orders.force_amplitude, gearlib.orders(seen.run).force_amplitude
    )


def test_a_view_of_drawn_gears_shows_pairs_of_teeth():
    seen, gears = compute_view(moved(RELIEVED, "d")[1], "d"), config.load(RELIEVED).gears
    torque = 30e3 / (9000.0 * math.tau / 60.0)
    error = gears.mesh().transmission_error(torque, stiffness="energy")
    np.testing.assert_allclose(seen.error.transmission_error[-1], error.transmission_error[0])
    teeth = gearlib.LoadSharingPair.from_geometry(
        gears.mesh(), torque=torque, damping_ratio=0.03, backlash_damping_ratio=0.01
    )
    asked = {"periods": 303, "record_periods": 23, "until_settled": True}
    run = gearlib.simulate(teeth, speed=9000.0, **asked)
    assert float(seen.run.displacement_max) == pytest.approx(float(run.displacement_max), rel=1e-9)
    said = dict(derived_quantities(seen))
    assert said["contact ratio"] == f"{gears.mesh().contact_ratio:.4f}"
    assert said["peak-to-peak error"] == f"{1e6 * error.peak_to_peak_error.item():.2f} µm"


def test_moving_a_slider_draws_anew_or_says_why_it_cannot_be():
    shown = page.Page(DRAWN, "d")
    before = {name: source.data["y"] for name, source in shown.figures.sources.items()}
    shown.widgets["torque"].value = 60.0
    # Without load there is no error.
    for name, source in shown.figures.sources.items():
        assert len(source.data["x"]) and (source.data["y"] is not before[name] or name == "0"), name
    seen = compute_view(shown.configuration(), "d")
    sources = shown.figures.sources
    np.testing.assert_array_equal(sources["plane"].data["x"], seen.run.displacement[-768:])
    np.testing.assert_array_equal(sources["force"].data["y"], seen.run.dynamic_force[-768:])
    np.testing.assert_allclose(
        sources["chosen"].data["y"][:-1], 1e6 * seen.error.transmission_error.values[-1]
    )
    roots = sources["multipliers"].data
    np.testing.assert_array_equal(roots["x"] + 1j * roots["y"], seen.multipliers)
    assert yaml.safe_load(shown.file().read()) == shown.configuration()
    shown.widgets["pinion_shift"].value = -0.9
    assert "gears.pinion.shift = -0.9 is not allowed" in shown.note.object
    assert not shown.figure_column.visible and shown.button.disabled
    # Helical gears have no Harris map here.
    shown.widgets["pinion_shift"].value = 0.0
    shown.widgets["helix_angle"].value = 10.0
    assert shown.figure_column.visible and not shown.figures.teeth_panes[0].visible


@pytest.mark.parametrize(("name", "at"), [("tuning", 0.8312), ("speed", 9000.4)])
def test_a_click_on_the_characteristic_shows_the_motion_there(mapping, name, at):
    shown = page.Page(*((mapping, "k1") if name == "tuning" else (DRAWN, "d")))
    widget = shown.widgets[name]
    for x in (at, 1e9):
        shown.pick(Tap(shown.figures.resonance, x=x, y=1.0))
        assert widget.value == pytest.approx(min(x, widget.end), abs=widget.step)
        assert shown.figures.marker.location == pytest.approx(widget.value, rel=1e-9)


@pytest.mark.parametrize(
    ("whole", "options", "words"),
    [
        (
            {"train": {"kind": "planetary"}},
            (),
            "gears is missing: the configuration describes a train",
        ),
        (DRAWN, ("--model", "train"), "No such option"),
    ],
)
def test_what_the_page_cannot_show_is_refused(tmp_path, monkeypatch, whole, options, words):
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(whole), encoding="utf-8")
    monkeypatch.setattr(page, "serve", lambda *_: pytest.fail("it was served"))
    command = ["explore", "--config", str(tmp_path / "mine.yaml"), *options]
    said = CliRunner().invoke(cli.main, command)
    assert said.exit_code == 2 and words in said.output


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    folder = tmp_path_factory.mktemp("explored")
    (folder / "config.yaml").write_text(yaml.safe_dump(DRAWN), encoding="utf-8")
    command = [sys.executable, "-m", "gearlib", "explore", "--no-show", "--port", str(port)]
    server = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    yield f"http://127.0.0.1:{port}"
    server.kill()
    server.wait()


def _note(driver, old=""):
    """Return what the page says of the motion, nothing as long as it says the old."""
    found = (text for text in texts(driver, "p") if "The motion from rest" in text)
    return next((text for text in found if text != old), "")


def _reachable(driver, address):
    try:
        driver.get(address)
    except Exception:  # the server is not there yet
        return False
    return "gearlib" in driver.title


@pytest.mark.slow
def test_in_a_browser(browser, address):
    wait_for(lambda: _reachable(browser, address))
    first = wait_for(lambda: _note(browser))
    wait_for(lambda: len(texts(browser, "canvas")) >= 6)
    handles = wait_for(lambda: everywhere(browser, ".noUi-handle"))
    assert len(handles) == 13
    handles[2].send_keys(Keys.PAGE_UP * 2)
    second = wait_for(lambda: _note(browser, first))
    assert re.search(r"Computed in \d+ ms", second)
    for width in (1280, 420):
        size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        wide = "const root = document.documentElement; return root.scrollWidth - root.clientWidth;"
        assert browser.execute_script(wide) == 0
    buttons = everywhere(browser, "a.bk-btn, button.bk-btn, a[download]")
    next(b for b in buttons if "Save" in b.text).click()
    saved = wait_for(lambda: list(browser.downloads.glob("config*.yaml")))[0]
    text = wait_for(lambda: saved.read_text(encoding="utf-8"))
    assert config.load(yaml.safe_load(text)).gears.pinion.module > 2.5e-3
    assert errors(browser) == []
