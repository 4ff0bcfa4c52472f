"""The explorer: what the sliders say, what is drawn and saved; once in a real browser."""

import re
import socket
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from bokeh.models import Span
from selenium.webdriver.common.keys import Keys

import gearlib
from gearlib import config
from gearlib.pages.explorer import one_pair, serving, view
from tests.browser.chromium import browser, errors, everywhere, texts, wait_for
from tests.browser.glyphs import plots_of, points_of

assert browser  # a fixture

GRID = np.linspace(0.6, 0.9, 31)


@pytest.fixture
def pair(mapping):
    return gearlib.GearPair(**config.load(mapping).pair_parameters("k1"))


@pytest.fixture
def explored(mapping):
    return one_pair.Pair(mapping, "k1")


def test_a_setting_stands_for_its_pair(pair, explored):
    again = explored.pair(explored.start)
    # Damping goes through its ratio and back: equal to a rounding or two.
    assert again.material_damping == pytest.approx(pair.material_damping, rel=1e-14)
    assert replace(again, material_damping=pair.material_damping) == pair


def test_a_view_shows_what_the_library_computes(pair):
    seen = view.look(pair, 0.9, GRID)
    run = gearlib.simulate(pair, 0.9, periods=300, record_periods=2)
    np.testing.assert_array_equal(seen.run.displacement[-512:], run.displacement)
    orbit = gearlib.periodic_orbit(pair, 0.9)
    np.testing.assert_allclose(np.abs(seen.multipliers), np.abs(orbit.multipliers), rtol=1e-9)
    up = gearlib.sweep(pair, GRID, periods=70, record_periods=10, direction="up")
    np.testing.assert_array_equal(seen.up["displacement_max"], up.displacement_max)
    assert "loses contact" in seen.message


def test_what_is_saved_computes_what_is_seen(mapping, explored):
    setting = replace(explored.start, tuning=0.73, backlash=60e-6, stiffness_ratio=0.7)
    saved = config.load(yaml.safe_load(explored.configuration(setting)))
    assert gearlib.GearPair(**saved.pair_parameters("k1")) == explored.pair(setting)
    assert saved.phase_planes.tunings == [0.73]
    assert saved.scenes == config.load(mapping).scenes


def test_what_was_left_out_is_not_saved(mapping):
    short = one_pair.Pair({key: mapping[key] for key in ("gear_pair", "dampings")}, "k1")
    text = short.configuration(replace(short.start, damping=0.1))
    assert set(yaml.safe_load(text)) == {"gear_pair", "dampings", "phase_planes"}


def test_moving_a_slider_updates_every_source(mapping):
    shown = serving.page_of(mapping, "k1")
    before = {name: source.data["y"] for name, source in shown.figures.sources.items()}
    shown.sliders["damping"].value = 0.03
    for name, source in shown.figures.sources.items():
        assert source.data["y"] is not before[name], name
        assert len(source.data["x"]) > 0, name


def test_sliders_reach_around_the_gears_that_are_given(mapping):
    gears = mapping["gear_pair"]
    heavier = mapping | {"gear_pair": gears | {"load": "33 kN", "backlash": "400 um"}}
    strong = {"material_damping": "60000 N s/m", "backlash_damping": "40000 N s/m"}
    heavier["dampings"] = mapping["dampings"] | {"k1": strong}
    for given in (mapping, heavier):
        shown = serving.page_of(given, "k1")
        pair, sliders = shown.explored.base, shown.sliders
        for name, slider in sliders.items():
            assert slider.start <= slider.value <= slider.end, name
        # The load over two decades in steps of a percent or less, in round numbers, the others from
        # none to twice their own.
        load = np.array([sliders["load"].start, sliders["load"].end, sliders["load"].step])
        np.testing.assert_allclose(load[:2] / pair.load, [0.05, 5.0], rtol=0.15)
        assert 0.005 <= load[2] / pair.load <= 0.01
        assert f"{load[2]:e}".rstrip("0123456789+-e") in {"1.", "2.", "5."}
        assert not np.any(np.mod(load[:2], load[2]))
        for name, own in (("damping", pair.damping_ratio), ("backlash_damping", 0.0)):
            assert sliders[name].start == 0.0 and sliders[name].end >= max(0.3, 2.0 * own)
        assert sliders["damping"].end < max(0.3, 2.5 * pair.damping_ratio) + 1e-12


def _named(plot):
    """Return what the legend of a plot names."""
    (legend,) = plot.legend
    return {item.label.value: item.renderers[0] for item in legend.items}


def test_each_glyph_holds_what_it_is_called(mapping, pair):
    shown = serving.page_of(mapping, "k1")
    # Between the folds, where sweeps up and down differ.
    shown.sliders["tuning"].value = 0.81
    plots = plots_of(shown)
    characteristic, nu = plots["Resonance characteristic"], shown.sliders["tuning"].value
    extrema = ("displacement_max", "displacement_min")
    sweeps = {
        way: gearlib.sweep(pair, shown.explored.grid, periods=70, record_periods=10, direction=way)
        for way in ("up", "down")
    }
    assert np.abs(sweeps["up"].displacement_max - sweeps["down"].displacement_max).max() > 0.5
    for way, swept in sweeps.items():
        named = _named(characteristic)[f"sweep {way}"]
        alike = [
            r for r in characteristic.renderers if r.glyph.line_color == named.glyph.line_color
        ]
        assert alike[0] is named
        for name, renderer in zip(extrema, alike, strict=True):
            np.testing.assert_array_equal(points_of(renderer), [shown.explored.grid, swept[name]])
    (marker,) = characteristic.select(Span)
    assert (marker.location, marker.dimension) == (nu, "height")

    run = gearlib.simulate(pair, nu, periods=300, record_periods=3, samples_per_period=256)
    orbit = gearlib.periodic_orbit(pair, nu, guess=run.final_state.values)
    (plane,) = plots["Phase plane"].renderers
    np.testing.assert_array_equal(points_of(plane), [run.displacement, run.velocity])
    course = _named(plots["Time course"])
    np.testing.assert_array_equal(points_of(course["displacement"])[1], run.displacement)
    force = points_of(course["dynamic force / load"])
    np.testing.assert_allclose(force[0], 2.0 * np.pi * np.arange(3 * 256) / 256, atol=1e-9)
    np.testing.assert_array_equal(force[1], run.dynamic_force)
    circle, roots = plots["Floquet multipliers"].renderers
    np.testing.assert_allclose(np.hypot(*points_of(circle)), 1.0, rtol=1e-14)
    real, imaginary = points_of(roots)
    np.testing.assert_array_equal(real + 1j * imaginary, orbit.multipliers)
    (stems,) = plots["Order spectrum"].renderers
    whole = gearlib.simulate(pair, nu, periods=300, record_periods=10, samples_per_period=256)
    assert float(whole.period) == 1.0
    _check_stems(stems, gearlib.orders(whole), [1, 2, 3, 4, 5, 6, 7, 8, 9, 10])


def _check_stems(stems, spectrum, mesh_orders):
    """Each stem rises from a millionth of the mean to the amplitude of its order."""
    x, y = (np.reshape(values, (-1, 3)) for values in points_of(stems))
    assert (x == np.array(mesh_orders)[:, None]).all()
    amplitude = spectrum.force_amplitude.values
    np.testing.assert_array_equal(y[:, 0], 1e-6 * amplitude[0])
    at = np.isin(spectrum.mesh_order.values, mesh_orders)
    np.testing.assert_array_equal(y[:, 1], amplitude[at])
    assert np.isnan(y[:, 2]).all()


@pytest.fixture(scope="module")
def address(request):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "gearlib", "explore", "--no-show", "--port", str(port)]
    server = subprocess.Popen(
        command, cwd=request.config.rootpath, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    yield f"http://127.0.0.1:{port}"
    server.kill()
    server.wait()


def _note(driver, old="", words="The motion from rest"):
    """Return what the page says of the motion, nothing as long as it says the old."""
    return next((t for t in texts(driver, "p") if words in t and t != old), "")


def _drawn(driver):
    """Return how many canvases of figures are seen."""
    return len(texts(driver, "canvas"))


def _reachable(driver, address):
    try:
        driver.get(address)
    except Exception:  # the server is not there yet
        return False
    return "gearlib" in driver.title


@pytest.mark.slow
def test_in_a_browser(browser, address, mapping):
    wait_for(lambda: _reachable(browser, address))
    first = wait_for(lambda: _note(browser))
    assert "the flanks never part" in first
    handle = wait_for(lambda: everywhere(browser, ".noUi-handle"))[0]
    handle.send_keys(Keys.PAGE_UP * 12)
    second = wait_for(lambda: _note(browser, first))
    assert re.search(r"Computed in \d+ ms", second)
    buttons = everywhere(browser, "a.bk-btn, button.bk-btn, a[download]")
    next(b for b in buttons if "Save" in b.text).click()
    saved = wait_for(lambda: list(browser.downloads.glob("config*.yaml")))[0]
    text = wait_for(lambda: saved.read_text(encoding="utf-8"))
    tunings = config.load(yaml.safe_load(text)).phase_planes.tunings
    assert tunings[0] > mapping["phase_planes"]["tunings"][0]
    assert errors(browser) == []


@pytest.mark.slow
def test_drawn_gears_in_a_browser(browser, address):
    wait_for(lambda: _reachable(browser, address))
    first = wait_for(lambda: _note(browser))
    (button,) = [b for b in everywhere(browser, ".bk-btn") if b.text == "drawn gears"]
    button.click()
    second = wait_for(lambda: _note(browser, first))
    # All sliders are there, one more than of the other page.
    wait_for(lambda: len(everywhere(browser, ".noUi-handle")) == 8)
    wait_for(lambda: _drawn(browser) >= 6)
    figures = _drawn(browser)
    # The shift of the pinion, below undercut, and back: by 0.05 each time.
    handle = everywhere(browser, ".noUi-handle")[1]
    handle.send_keys(Keys.PAGE_DOWN * 4)
    refused = "pinion: shift = -0.2 is not allowed"
    wait_for(lambda: any(refused in text for text in texts(browser, "p")))
    wait_for(lambda: _drawn(browser) == 0)
    handle.send_keys(Keys.PAGE_UP * 4)
    wait_for(lambda: _note(browser, second))
    wait_for(lambda: _drawn(browser) == figures)
    assert errors(browser) == []
