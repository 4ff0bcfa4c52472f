"""A crossing or an extremum that rounding hides ends a run with a status, wherever it is asked for.

The kernels run as plain Python here, so that the question can be answered with "cannot tell".
"""

import math

import numpy as np
import pytest

from gearlib import OneDegreePair, simulate
from gearlib.data import status
from gearlib.kernels import orbit
from gearlib.kernels.piecewise_linear import run as linear
from gearlib.kernels.piecewise_linear import variation as linear_variation
from gearlib.kernels.piecewise_linear import whole_periods as linear_periods
from gearlib.kernels.taylor import run as nonlinear
from gearlib.kernels.taylor import variation
from gearlib.models.propagators import piecewise_linear, taylor
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
    plain(monkeypatch, linear, "run_linear", piecewise_linear)
    plain(monkeypatch, linear, "_first_event")
    plain(monkeypatch, linear, "_summarise")
    plain(monkeypatch, linear, "go", linear_variation)
    plain(monkeypatch, linear_periods, "pass_period", linear)
    plain(monkeypatch, linear_periods, "_fall")
    plain(monkeypatch, nonlinear, "take_step", variation)
    plain(monkeypatch, nonlinear, "first_crossing")
    plain(monkeypatch, orbit, "add_curve")
    plain(monkeypatch, nonlinear, "run_nonlinear", taylor)
    plain(monkeypatch, nonlinear, "add_step")
    return monkeypatch


def is_unresolved(run):
    assert run.status == status.UNRESOLVED
    assert "initial state" in run.status.attrs["message"]
    assert np.isnan(run.displacement_max) and np.isnan(run.final_state).all()


@pytest.mark.parametrize("periods", [1, 2])
def test_a_crossing_in_many_coordinates(python, periods):
    # With two periods the first one, which is not recorded, meets it.
    unknown(python, linear, "first_fall", -1.0)
    unknown(python, linear_periods, "fall_by_shape", -1.0)
    unknown(python, linear_periods, "first_fall", -1.0)
    is_unresolved(simulate(SIX, 0.9, periods=periods, initial_state=(0.5, -2.0)))


def test_an_extremum_in_many_coordinates(python):
    unknown(python, orbit, "highest", math.nan)
    is_unresolved(simulate(SIX, 0.9, periods=1))


@pytest.mark.parametrize(
    ("home", "name", "answer"), [(nonlinear, "first_fall", -1.0), (orbit, "highest", math.nan)]
)
def test_one_degree_in_taylor_steps(python, home, name, answer):
    unknown(python, home, name, answer)
    is_unresolved(simulate(CURVED, 0.9, periods=1))


@pytest.mark.parametrize(("model", "kernel"), [(SIX, "vary_linear"), (CURVED, "vary_nonlinear")])
def test_maps(python, model, kernel):
    unknown(python, linear, "first_fall", -1.0)
    unknown(python, nonlinear, "first_fall", -1.0)
    unknown(python, nonlinear, "fall_by_shape", -1.0)
    if model is SIX:
        plain(python, linear_variation, kernel, piecewise_linear)
    else:
        plain(python, variation, kernel, taylor)
    _, maps, code = model.propagator(0.9).maps(model.propagator(0.9).start((0.5, -2.0)), 1, 1000)
    assert code == status.UNRESOLVED and np.isnan(maps).all()


def test_every_status_has_its_words_and_its_flag():
    codes = list(status.FLAGS["flag_values"])
    assert codes == list(range(len(codes)))
    assert len(status.FLAGS["flag_meanings"].split()) == len(codes)
