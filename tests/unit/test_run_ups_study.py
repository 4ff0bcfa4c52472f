"""The study of run-ups: its curves, its order map, what its figure holds."""

import numpy as np
import pytest
import xarray as xr

from gearlib import continue_orbit, order_map, periodic_orbit, run_up, sweep
from gearlib.data import storage
from gearlib.figures import run_ups_figure, style
from gearlib.studies import run_ups
from tests.paper import PAPER

PAIR = PAPER.replace(material_damping=3953.7)
FASTEST, SLOWEST = 40, 320
#: Of the orbits of one mesh period.
FOLDS = np.array([0.6161, 0.6830, 0.8082, 0.8160])


@pytest.fixture(scope="module")
def found():
    settings = {"revolutions": [FASTEST, SLOWEST], "mesh_orders": 2, "damping": "k1"}
    return run_ups.compute(PAIR.as_dict(), 0.5, 1.4, **settings)


def lag(found, count, direction):
    """Return the tuning at which a run-up jumps."""
    one = found.sel(revolutions=count, direction=direction)
    height = (one.displacement_max - one.displacement_min).values
    steps = np.diff(height[np.isfinite(height)])
    i = int(np.argmax(steps))
    return float(one.tuning[i : i + 2].mean())


def test_curves_are_those_of_sweeps_behind_whose_jumps_they_jump(found):
    tunings = np.linspace(0.5, 1.4, 181)
    for direction, way in (("up", 1.0), ("down", -1.0)):
        settled = sweep(PAIR, tunings, periods=400, record_periods=4, direction=direction)
        own = found.sel(revolutions=SLOWEST, direction=direction)
        x = own.tuning.values
        # Away from the folds, where nothing jumps.
        smooth = (np.abs(x[:, None] - FOLDS).min(axis=1) > 0.03) & (x > 0.6)
        by_run = own.displacement_max.values[smooth]
        by_sweep = np.interp(x[smooth], tunings, settled.displacement_max.values)
        assert np.abs(by_run / by_sweep - 1.0).max() < 0.02
        fast, slow = (lag(found, count, direction) for count in (FASTEST, SLOWEST))
        assert way * (fast - slow) > 0.0
    assert found.tuning.sel(revolutions=FASTEST).notnull().sum() == 2 * FASTEST


def test_the_map_is_that_of_the_slowest_run(found):
    low, high = (PAIR.speed(nu) for nu in (0.5, 1.4))
    seconds = 120.0 * SLOWEST / (low + high)
    course = [(0.0, low), (seconds, high), (2.0 * seconds, low)]
    run = run_up(PAIR, speed=course, samples_per_period=run_ups.SAMPLES_PER_PERIOD)
    whole = order_map(run, variable="dynamic_force", highest=48)
    assert found.order.values.tolist() == list(range(49))
    np.testing.assert_allclose(found.amplitude, whole.amplitude, rtol=1e-9, atol=1e-9)
    blocks = found.sizes["block"] // 2
    assert (np.diff(found.rpm[:blocks]) > 0.0).all() and (np.diff(found.rpm[blocks:]) < 0.0).all()


def test_the_figure_holds_run_ups_sweeps_folds_and_the_map(found, tmp_path):
    path = tmp_path / "run_ups.nc"
    storage.write(found, path)
    stored = storage.read(path)
    tunings = np.linspace(0.5, 1.4, 19)
    runs = [sweep(PAIR, tunings, periods=40, record_periods=4, direction=d) for d in ("up", "down")]
    resonance = xr.concat(runs, xr.IndexVariable("direction", ["up", "down"]))
    resonance = resonance.drop_vars("damping", errors="ignore").expand_dims(damping=["k1"])
    branch = continue_orbit(periodic_orbit(PAIR, 0.9, period=1), to=0.6)
    figure = run_ups_figure.draw(stored, resonance=resonance, branches=branch)
    axes, *below = figure.axes
    folds = np.unique(branch.tuning.values[branch.label.values == 1])
    np.testing.assert_allclose(folds, FOLDS, atol=1e-4)
    marked = [line.get_xdata()[0] for line in axes.lines if line.get_color() == "black"]
    np.testing.assert_array_equal(marked, folds)
    drawn = [line for line in axes.lines if line.get_color() in style.PALETTE]
    assert len(drawn) == 8
    np.testing.assert_array_equal(drawn[0].get_ydata(), found.displacement_max[0, 0])
    grey = [line for line in axes.lines if line.get_color() == "#BBBBBB"]
    assert len(grey) == 4
    titles = {one.get_title() for one in below}
    assert {"speed goes up", "speed goes down"} <= titles
