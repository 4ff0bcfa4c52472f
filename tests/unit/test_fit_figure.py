"""What the artists of the pictures of fits hold."""

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot

import gearlib
from gearlib import plot
from gearlib.uncertainty.synthetic_rigs import synthetic_rig
from tests.paper import PAPER

TRUTH = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)


@pytest.fixture(autouse=True)
def no_window():
    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")


def test_measured_and_fitted_orders_lie_over_each_other():
    low, high = TRUTH.speed(0.6), TRUTH.speed(0.7)
    data = synthetic_rig(TRUTH, [(0.0, low), (0.4, high), (0.8, low)], 1)
    free = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7)}
    fit = gearlib.fit(TRUTH.replace(reduced_mass=3.0), data, free)
    panels = plot.fit(fit).axes
    assert len(panels) == 4 and "order z (µm)" in panels[0].get_ylabel()
    for axes, curve in zip(panels, fit.curves(), strict=True):
        measured, up, down = axes.lines
        np.testing.assert_array_equal(measured.get_xdata(), curve.at)
        shown = np.where(curve.falls, down.get_ydata(), up.get_ydata())
        scale = measured.get_ydata() / curve.heights[0]
        np.testing.assert_allclose(shown / scale, curve.heights[1])
        assert (np.isnan(up.get_ydata()) | np.isnan(down.get_ydata())).all()


def test_fitted_speeds_stand_beside_their_intervals():
    attrs = {"units": "min-1", "noise_std": 2.0}
    data = xr.Dataset({"onset_of_contact_loss": ((), TRUTH.speed(0.81), attrs)})
    pair = TRUTH.replace(material_damping=7e3, backlash_damping=7e3)
    axes = plot.fit(gearlib.fit(pair, data, {"reduced_mass": (2.6, 3.7)})).axes[0]
    fitted = next(line for line in axes.lines if line.get_label() == "fitted")
    assert abs(fitted.get_ydata()[0]) < 0.1
    assert axes.get_xticklabels()[0].get_text().startswith("onset of contact loss")
    with pytest.raises(ValueError, match="found is not allowed: gearlib.plot.fit draws a fit of"):
        plot.fit(7)
