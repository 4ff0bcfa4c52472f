"""What `gearlib.plot` refuses, and where it draws; tests/golden/plots has its pictures."""

import pytest
from matplotlib import pyplot

from gearlib import plot, run_up, simulate
from tests.paper import PAPER


@pytest.fixture(autouse=True)
def no_window():
    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")


def test_plots_are_drawn_into_given_axes():
    _, axes = pyplot.subplots()
    assert plot.phase_plane(simulate(PAPER, 0.85, periods=4), axes=axes) is axes and axes.lines


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (plot.resonance, "gearlib.plot.resonance draws datasets of gearlib.sweep"),
        (plot.orders, "gearlib.plot.orders draws datasets of gearlib.orders"),
        (plot.run_up, "gearlib.plot.run_up draws datasets of gearlib.run_up"),
        (lambda run: plot.phase_plane(run, axes=3), "^axes = 3 is not allowed: it must be axes"),
    ],
)
def test_what_cannot_be_drawn_is_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call(simulate(PAPER, 0.85, periods=4))


def test_variables_that_a_run_up_does_not_have_are_refused():
    run = run_up(PAPER, start=PAPER.speed(0.5), stop=PAPER.speed(0.51), duration=0.1)
    with pytest.raises(ValueError, match="phase over revolution is missing"):
        plot.run_up(run, variable="phase")
