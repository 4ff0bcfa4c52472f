"""The explorer's answers: the schematic at an instant, clicks, sliders in round steps."""

import numpy as np
import panel as pn
import pytest
from bokeh.events import Tap
from bokeh.models import Span

import gearlib
from gearlib.pages.explorer import serving, slider_page
from gearlib.pages.explorer.explored import Slider


def test_the_schematic_turns_and_shows_the_contacts_of_its_instant(mapping):
    shown = serving.page_of(mapping, "k1", "split_power_reducer")
    schematic, speed = shown.figures.train, shown.sliders["speed"]
    speed.value = 4000.0
    speed.param.trigger("value_throttled")
    setting = shown.setting()
    train = shown.explored.train(setting)
    tuning = setting.speed / shown.explored.rpm(setting)
    run = gearlib.simulate(train, tuning, periods=180, record_periods=12, samples_per_period=64)
    contact = run.contact.values[-3 * 64 :]
    _, first = np.unique(contact, axis=0, return_index=True)
    assert len(first) > 1
    for sample in (*first, 3 * 64 - 1):
        schematic.slider.value = sample / 64
        meshes = schematic.sources["meshes"].data
        is_open = [face == "white" for face in meshes["face"]]
        assert is_open == (contact[sample] == 0).tolist()
        apart = ", ".join(np.array(train.mesh_names)[is_open]) or "All meshes are in contact"
        assert apart in schematic.words.object
        assert schematic.marker.location == sample / 64
        # By tooth numbers: the input, 24 teeth, counterclockwise, the satellites the other way.
        ways = [(x[1] - x[0], y[1] - y[0]) for x, y in zip(*(schematic.sources["marks"].data[k]
                for k in ("xs", "ys")), strict=True)]  # fmt: skip
        turned = np.exp(2j * np.pi * sample / 64 / np.array([24, -36]))
        ways = np.array([complex(*ways[i]) for i in (0, 2)])
        np.testing.assert_allclose(ways / abs(ways), turned, atol=1e-12)
    schematic.draw(train, run.assign(status=((), 1)))
    assert "no motion" in schematic.words.object
    assert "white" not in schematic.sources["meshes"].data["face"]
    curves = shown.figures.resonance.renderers
    assert meshes["colour"] == [curves[i].glyph.line_color for i in range(6)]
    assert tuple(meshes["mesh"]) == train.mesh_names
    marked = [pane.object for pane in shown.layout().select(pn.pane.Bokeh)]
    (course,) = [plot for plot in marked if plot.title.text.startswith("Time course")]
    assert course.select(Span)[0].location == schematic.slider.value
    circles = schematic.sources["circles"].data
    for x, y in zip(meshes["x"], meshes["y"], strict=True):
        # Two circles or more go through each pitch point.
        away = np.hypot(np.array(circles["x"]) - x, np.array(circles["y"]) - y)
        assert (abs(away - circles["radius"]) < 1e-9).sum() >= 2


@pytest.mark.parametrize(
    ("chosen", "at", "name"),
    [
        (serving.PAIR, 0.8312, "tuning"),
        (serving.DRAWN, 9000.4, "speed"),
        ("idler", 3000.3, "speed"),
    ],
)
def test_a_click_on_the_characteristic_shows_the_motion_there(mapping, chosen, at, name):
    shown = serving.page_of(mapping, "k1", chosen)
    slider = shown.sliders[name]
    for x, value in ((at, round(at / slider.step) * slider.step), (1e9, slider.end)):
        shown.pick(Tap(shown.figures.resonance, x=x, y=1.0))
        assert slider.value == pytest.approx(value, rel=1e-12)
        (marker,) = shown.figures.resonance.select(Span)
        assert marker.location == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("start", "low", "high", "step", "expected"),
    [
        (3289.5396, 164.477, 16447.7, 32.895, (180.0, 16460.0, 20.0, "0")),
        (0.061683, 0.0, 0.3, 0.0005, (0.0, 0.3, 0.0005, "0[.][00000]")),
        (2.5, 1.25, 5.0, 0.125, (1.3, 5.0, 0.1, "0[.][00]")),
        (0.5001, 0.5001, 1.4, 0.0005, (0.5001, 1.4, 0.0005, "0[.][0000]")),
    ],
)
def test_sliders_go_in_round_steps(start, low, high, step, expected):
    assert slider_page.readable(Slider("", start, (low, high, step))) == expected
