"""A crossing or an extremum that rounding hides ends a run with a status, wherever it is asked for.

The kernels run as plain Python here, so that the question can be answered with "cannot tell".
"""

import math

import numpy as np
import pytest

from gearlib import OneDegreePair, simulate
from gearlib.data import status
from gearlib.kernels import orbit
from gearlib.kernels.several_meshes import distances, periods, record
from gearlib.kernels.several_meshes import train_run as trains
from gearlib.kernels.taylor import taylor_maps
from gearlib.kernels.taylor import taylor_run as nonlinear
from gearlib.models.propagators import several_meshes, taylor
from tests.paper import PAPER
from tests.properties.known_models import gears

SIX = gears(3e7, 3953.7, 500.0, free=True)
CURVED = OneDegreePair(pair=PAPER, cubic_damping=4e5)


def plain(monkeypatch, home, name, *users):
    """Let a kernel run as Python in its module and in those that import it."""
    function = getattr(home, name).py_func
    for module in (home, *users):
        monkeypatch.setattr(module, name, function)


def unknown(monkeypatch, module, name, answer):
    monkeypatch.setattr(module, name, lambda *_: answer)


@pytest.fixture
def python(monkeypatch):
    """Run the kernels in Python."""
    plain(monkeypatch, trains, "run_train", several_meshes)
    plain(monkeypatch, periods, "go", trains)
    plain(monkeypatch, distances, "first_events", periods)
    plain(monkeypatch, record, "record", periods)
    plain(monkeypatch, record, "_add_extrema")
    plain(monkeypatch, nonlinear, "take_step", taylor_maps)
    plain(monkeypatch, nonlinear, "first_crossing")
    plain(monkeypatch, orbit, "add_curve")
    plain(monkeypatch, nonlinear, "run_nonlinear", taylor)
    plain(monkeypatch, nonlinear, "add_step")
    return monkeypatch


def is_unresolved(run):
    assert run.status == status.UNRESOLVED
    assert "initial state" in run.status.attrs["message"]
    assert np.isnan(run.displacement_max) and np.isnan(run.final_state).all()


@pytest.mark.parametrize("count", [1, 2])
def test_a_crossing_in_many_coordinates(python, count):
    # With two periods the first one, which is not recorded, meets it.
    unknown(python, distances, "first_fall", (-1.0, 0.0))
    is_unresolved(simulate(SIX, 0.9, periods=count, initial_state=(0.5, -2.0)))


def test_an_extremum_in_many_coordinates(python):
    unknown(python, record, "highest_from", math.nan)
    is_unresolved(simulate(SIX, 0.9, periods=1))


@pytest.mark.parametrize(
    ("home", "name", "answer"), [(nonlinear, "first_fall", -1.0), (orbit, "highest", math.nan)]
)
def test_one_degree_in_taylor_steps(python, home, name, answer):
    unknown(python, home, name, answer)
    is_unresolved(simulate(CURVED, 0.9, periods=1))


@pytest.mark.parametrize("model", [SIX, CURVED])
def test_maps(python, model):
    unknown(python, distances, "first_fall", (-1.0, 0.0))
    unknown(python, nonlinear, "first_fall", -1.0)
    unknown(python, nonlinear, "fall_by_shape", -1.0)
    plain(python, taylor_maps, "vary_nonlinear", taylor)
    _, maps, code = model.propagator(0.9).maps(model.propagator(0.9).start((0.5, -2.0)), 1, 1000)
    assert code == status.UNRESOLVED and np.isnan(maps).all()


def test_every_status_has_its_words_and_its_flag():
    codes = list(status.FLAGS["flag_values"])
    assert codes == list(range(len(codes)))
    assert len(status.FLAGS["flag_meanings"].split()) == len(codes)
