"""The explorer's answers: clicks, sliders in round steps."""

import pytest
from bokeh.events import Tap
from bokeh.models import Span

from gearlib.pages.explorer import serving, slider_page
from gearlib.pages.explorer.explored import Slider


@pytest.mark.parametrize(
    ("chosen", "at", "name"),
    [
        (serving.PAIR, 0.8312, "tuning"),
        (serving.DRAWN, 9000.4, "speed"),
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
