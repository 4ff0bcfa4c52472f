"""What the picture of polynomial chaos beside exact runs holds."""

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot

from gearlib import plot

ORDERS, SHARES = [1, 3], np.array([0.1, 0.5, 0.9])


@pytest.fixture
def found():
    pyplot.switch_backend("Agg")
    errors = np.array([[[0.3, 0.4], [0.2, 0.0]], [[0.1, 0.1], [0.05, 0.04]]])
    heights = 1e-6 * np.arange(24.0).reshape(2, 2, 2, 3)
    over = ("estimate", "polynomial_order", "speed")
    yield xr.Dataset(
        {
            "distribution_error": (over, errors),
            "height_quantile": ((*over, "quantile"), heights),
            "exact_height_quantile": (("speed", "quantile"), 1e-6 * np.arange(6.0).reshape(2, 3)),
            "designs_run": ("polynomial_order", [8, 40]),
        },
        {
            "estimate": ["polynomial_chaos", "samples"],
            "polynomial_order": ORDERS,
            "speed": [3000.0, 3300.0],
            "quantile": SHARES,
        },
    )
    pyplot.close("all")


def test_each_speed_has_its_distribution_above_its_errors(found):
    panels = plot.expansions(found).axes
    assert [one.get_title() for one in panels[:2]] == ["3000 rpm", "3300 rpm"]
    for j in (0, 1):
        exact, stand_in = panels[j].lines
        np.testing.assert_allclose(exact.get_xdata(), np.arange(3.0) + 3 * j)
        # Of the highest order.
        np.testing.assert_allclose(stand_in.get_xdata(), np.arange(3.0) + 6 + 3 * j)
        np.testing.assert_array_equal(exact.get_ydata(), SHARES)
        for line, way in zip(panels[2 + j].lines, found.distribution_error.values, strict=True):
            np.testing.assert_array_equal(line.get_xdata(), [8, 40])
            np.testing.assert_array_equal(line.get_ydata(), np.maximum(way[:, j], 1e-4))


def test_other_datasets_are_refused(found):
    with pytest.raises(ValueError, match=r"distribution_error is missing: gearlib.plot.expansions"):
        plot.expansions(xr.Dataset())
    with pytest.raises(ValueError, match="speed = 3000 is not allowed: it must be a dimension"):
        plot.expansions(found.isel(speed=0))
