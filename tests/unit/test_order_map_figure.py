"""What the artists of an order map hold."""

import numpy as np
import pytest

import gearlib
from gearlib import plot
from tests.paper import PAPER


@pytest.fixture(scope="module")
def levels():
    """The order map of a run-up there and back."""
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
    a, b = pair.speed(0.7), pair.speed(1.0)
    run = gearlib.run_up(pair, speed=[(0.0, a), (0.8, b), (1.6, a)], samples_per_period=64)
    return gearlib.order_map(run, variable="dynamic_force", highest=60)


def halves(levels):
    """Return the blocks in which the speed rises and falls, by their speed."""
    rises = np.gradient(levels.rpm.values) >= 0.0
    return [levels.isel(time=np.flatnonzero(mask)).sortby("rpm") for mask in (rises, ~rises)]


def test_a_map_holds_levels_lines_and_the_overall_level(levels):
    figure = plot.order_map(levels)
    up, down, low_up, low_down, *_ = figure.axes
    assert [axes.get_title() for axes in (up, down)] == ["speed goes up", "speed goes down"]
    panels = zip((up, down), (low_up, low_down), halves(levels), strict=True)
    for axes, below, part in panels:
        (mesh,) = axes.collections
        level = 20.0 * np.log10(part.amplitude.values[:, 1:])
        lowest = np.maximum(level, mesh.get_clim()[1] - 80.0)
        shown = mesh.get_array().reshape(level.shape)
        np.testing.assert_allclose(shown, lowest, rtol=0, atol=1e-9)
        (line,) = below.lines
        np.testing.assert_allclose(line.get_xdata(), part.rpm)
        np.testing.assert_allclose(10.0 ** (line.get_ydata() / 20.0), part.overall, rtol=1e-12)
    figure = plot.order_map(levels, vertical="frequency")
    line = next(line for line in figure.axes[0].lines if line.get_label() == "z")
    np.testing.assert_allclose(line.get_ydata(), 24.0 * line.get_xdata() / 60.0)
