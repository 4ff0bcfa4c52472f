"""What the artists of an order map hold."""

import numpy as np
import pytest

import gearlib
from gearlib import plot
from tests.paper import PAPER

PAIR = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)


@pytest.fixture(scope="module")
def there_and_back():
    a, b = PAIR.speed(0.7), PAIR.speed(1.0)
    run = gearlib.run_up(PAIR, speed=[(0.0, a), (0.8, b), (1.6, a)], samples_per_period=64)
    return gearlib.order_map(run, variable="dynamic_force", highest=60)


def test_a_map_holds_levels_lines_and_the_overall_level(there_and_back):
    found = there_and_back
    figure = plot.order_map(found)
    up, down, low_up, low_down, *_ = figure.axes
    assert [axes.get_title() for axes in (up, down)] == ["speed goes up", "speed goes down"]
    rises = np.gradient(found.rpm.values) >= 0.0
    for axes, below, mask in ((up, low_up, rises), (down, low_down, ~rises)):
        part = found.isel(time=np.flatnonzero(mask)).sortby("rpm")
        (mesh,) = axes.collections
        level = 20.0 * np.log10(part.amplitude.values[:, 1:])
        shown = mesh.get_array().reshape(level.shape)
        high = mesh.get_clim()[1]
        np.testing.assert_allclose(shown, np.maximum(level, high - 80.0), rtol=0, atol=1e-9)
        (line,) = below.lines
        np.testing.assert_allclose(line.get_xdata(), part.rpm)
        np.testing.assert_allclose(10.0 ** (line.get_ydata() / 20.0), part.overall, rtol=1e-12)
        orders = {one.get_label(): one.get_ydata()[0] for one in axes.lines}
        first = {"z/2": 12.0, "z": 24.0, "z -1": 23.0, "z +1": 25.0}
        assert orders == first | {"2z": 48.0, "2z -1": 47.0, "2z +1": 49.0}
    assert "dB re 1 N" in low_up.get_ylabel()


def test_over_hertz_and_powers(there_and_back):
    figure = plot.order_map(there_and_back, vertical="frequency")
    line = next(one for one in figure.axes[0].lines if one.get_label() == "z")
    np.testing.assert_allclose(line.get_ydata(), 24.0 * line.get_xdata() / 60.0)
    with pytest.raises(ValueError, match="must be one of 'order', 'frequency'"):
        plot.order_map(there_and_back, vertical="time")
    with pytest.raises(ValueError, match="a dataset of gearlib.order_map"):
        plot.order_map(there_and_back.drop_vars("amplitude"))


def test_a_measured_map_lies_over_the_computed_one(there_and_back):
    found = there_and_back
    louder = found.assign(amplitude=2.0 * found.amplitude, overall=found.overall + 1.0)
    plain, both = plot.order_map(found), plot.order_map(found, measured=louder)
    for axes, before in zip(both.axes[:2], plain.axes[:2], strict=True):
        assert axes.axis() == before.axis()
        _, *circles = axes.collections
        assert len(circles) == 2 and 10 < circles[0].get_offsets().shape[0] <= 30
        for number, one in zip((24.0, 48.0), circles, strict=True):
            speed, order = one.get_offsets().T
            assert (order == number).all()
            at = [int(np.abs(found.rpm.values - x).argmin()) for x in speed]
            level = 20.0 * np.log10(louder.amplitude.sel(order=number).values[at])
            np.testing.assert_allclose(one.get_array(), np.clip(level, *one.get_clim()), atol=1e-9)
    (_, dots) = both.axes[2].lines
    rises = np.gradient(found.rpm.values) >= 0.0
    part = louder.isel(time=np.flatnonzero(rises)).sortby("rpm")
    np.testing.assert_allclose(10.0 ** (dots.get_ydata() / 20.0), part.overall, rtol=1e-12)
    with pytest.raises(ValueError, match="measured.variable = 'displacement' is not allowed"):
        plot.order_map(found, measured=louder.assign_attrs(variable="displacement"))
    with pytest.raises(ValueError, match="measured is not allowed: it must be a dataset"):
        plot.order_map(found, measured=louder.drop_vars("amplitude"))
