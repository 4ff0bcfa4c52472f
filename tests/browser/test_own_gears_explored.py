"""The explorer opens with the gears of the user, and what it saves describes them again."""

import socket
from dataclasses import replace

import numpy as np
import panel as pn
import pytest
import yaml
from click.testing import CliRunner
from selenium.webdriver.common.action_chains import ActionChains

from gearlib import cli, config
from gearlib.pages.explorer import serving
from tests.browser.chromium import browser, errors, everywhere, texts, wait_for

assert browser  # a fixture

PAIR = {
    "gears": {
        "pinion": {"teeth": 23, "module": "2.5 mm", "width": "18 mm"},
        "wheel": {"teeth": 61},
        "backlash": "80 um",
        "torque": "85 N m",
    },
    "dampings": {"d": {"damping_ratio": 0.03, "backlash_damping_ratio": 0.03}},
}
RELIEF = {"amount": "15 um", "length": "2 mm", "shape": "parabolic"}
PINION = PAIR["gears"]["pinion"] | {"tip_relief": RELIEF, "pitch_errors": ["5 um"] + ["0 um"] * 22}
RELIEVED = PAIR | {"gears": PAIR["gears"] | {"pinion": PINION}}
TRAIN = {"train": {"kind": "planetary"}}


def explored(tmp_path, monkeypatch, whole, *options):
    """Return the `Explorer` that the command serves, and what the command answers."""
    file, served = tmp_path / "mine.yaml", []
    file.write_text(yaml.safe_dump(whole), encoding="utf-8")
    monkeypatch.setattr(serving, "serve", lambda *given: served.append(given[:2]))
    said = CliRunner().invoke(cli.main, ["explore", "--config", str(file), *options])
    return (serving.Explorer(*served[0]) if served else None), said


@pytest.mark.parametrize("whole", [PAIR, RELIEVED])
def test_the_users_gears_are_seen_first_and_saved(tmp_path, monkeypatch, whole):
    explorer, said = explored(tmp_path, monkeypatch, whole)
    assert said.exit_code == 0 and serving.opened(whole) == serving.DRAWN
    assert explorer.mapping == whole and explorer.choice.value == serving.DRAWN
    page = explorer.page
    assert "z 23/61, module 2.5 mm" in page.explored.heading
    again = yaml.safe_load(page.file().read())
    gears = config.load(again).gears
    assert [gears.pinion.teeth, gears.wheel.teeth, gears.pinion.module] == [23, 61, 2.5e-3]
    assert gears.torque == 85.0 and gears.backlash == 80e-6
    # Opened again, it holds the same.
    second, _ = explored(tmp_path, monkeypatch, again)
    assert vars(second.page.setting()) == vars(page.setting())
    assert yaml.safe_load(second.page.file().read()) == again


def test_relief_and_pitch_errors_of_the_drawing_are_what_moves(tmp_path, monkeypatch):
    explorer, _ = explored(tmp_path, monkeypatch, RELIEVED)
    page, drawing = explorer.page, explorer.page.explored
    mesh, given = drawing.mesh(page.setting()), config.load(RELIEVED).gears.mesh()
    for name in ("pinion", "wheel"):
        own, drawn = getattr(mesh, name), getattr(given, name)
        assert (own.tip_relief, own.pitch_errors) == (drawn.tip_relief, drawn.pitch_errors)
    assert "tip relief and pitch errors as drawn" in drawing.heading
    # The same teeth meet after 23 mesh periods; the page follows that motion and says so.
    assert "repeats every 23 mesh periods" in page.note.object
    error = drawing.mesh(page.setting()).transmission_error(85.0, phases=89)
    curve = page.figures.sources["chosen"].data
    assert len(curve["x"]) == 23 * 89 + 1 and curve["x"][-1] == 23.0
    np.testing.assert_allclose(curve["y"][:-1], 1e6 * error.transmission_error.values[0])
    page.sliders["relief"].value = 30.0
    page.sliders["module"].value = 5.0
    page.choices["errors"].value = False
    mesh = drawing.mesh(page.setting())
    twice = replace(given.pinion.tip_relief, amount=30e-6, length=4e-3)
    assert mesh.pinion.tip_relief == twice and mesh.wheel.tip_relief is None
    assert mesh.pinion.pitch_errors == () and "repeats every mesh period" in page.note.object
    saved = config.load(yaml.safe_load(page.file().read())).gears.mesh()
    assert saved.pinion.tip_relief == twice and saved.pinion.pitch_errors == ()


def test_a_pair_that_is_not_changed_keeps_its_drawing(tmp_path, monkeypatch):
    explorer, _ = explored(tmp_path, monkeypatch, PAIR)
    explorer.choice.value = serving.PAIR
    again = yaml.safe_load(explorer.page.file().read())
    del again["phase_planes"]
    assert again == PAIR


@pytest.mark.parametrize(
    ("whole", "options", "words"),
    [
        (TRAIN, (), "gears is missing: the explorer shows gear pairs"),
        (PAIR, ("--model", "train"), "--model train is not allowed"),
    ],
)
def test_trains_are_refused(tmp_path, monkeypatch, whole, options, words):
    explorer, said = explored(tmp_path, monkeypatch, whole, *options)
    assert explorer is None and said.exit_code == 2 and words in said.output


def test_options_that_contradict_a_drawing_are_refused(tmp_path, monkeypatch):
    explorer, said = explored(tmp_path, monkeypatch, PAIR, "--load", "3000")
    assert explorer is None and "--load is not allowed" in said.output
    explorer, said = explored(tmp_path, monkeypatch, PAIR, "--material-damping", "900")
    assert said.exit_code == 0 and explorer.mapping["gears"] == PAIR["gears"]


def _layout(chosen):
    explorer = serving.Explorer(PAIR, "d")
    explorer.choice.value = chosen
    return explorer.layout()


@pytest.fixture(scope="module")
def served():
    """The address of the pages of a drawn pair: its drawing, and its motion over tuning."""
    pages = {"0": lambda: _layout(serving.DRAWN), "1": lambda: _layout(serving.PAIR)}
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = pn.serve(pages, show=False, threaded=True, port=port, address="127.0.0.1")
    yield f"http://127.0.0.1:{port}"
    server.stop()


def _seen(browser, address, least, width, height):
    """Open a page in a window of this size; return the heights of its figures."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(address)
    wait_for(lambda: len(texts(browser, "canvas")) >= least, 60.0)
    return _heights(browser)


def _heights(browser):
    return [canvas.size["height"] for canvas in everywhere(browser, "canvas")]


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 420])
def test_no_page_is_wider_than_the_window(browser, served, width):
    for page, least in (("0", 5), ("1", 4)):
        _seen(browser, f"{served}/{page}", least, width, 800)
        wide = "return [document.documentElement.scrollWidth, window.innerWidth];"
        shown, window = browser.execute_script(wide)
        assert shown <= window == width


@pytest.mark.slow
def test_figures_grow_with_the_window_and_a_click_moves_the_motion(browser, served):
    low = _seen(browser, f"{served}/1", 4, 1280, 800)
    high = _seen(browser, f"{served}/1", 4, 1280, 1200)
    # Of 400 px more 55 % and 45 %: each row as much as it has of the window.
    grown = [b - a for a, b in zip(low, high, strict=True) if b != a]
    assert len(grown) >= 4 and sorted({*grown}) == [180, 220]
    (before,) = [text for text in texts(browser, ".bk-slider-title") if "tuning" in text]
    assert before == "tuning ν: 0.6"
    ActionChains(browser).move_to_element(everywhere(browser, "canvas")[0]).click().perform()
    wait_for(lambda: before not in texts(browser, ".bk-slider-title"), 60.0)
    (after,) = [text for text in texts(browser, ".bk-slider-title") if "tuning" in text]
    assert 0.8 < float(after.split(": ")[1]) < 1.1
    assert errors(browser) == []
