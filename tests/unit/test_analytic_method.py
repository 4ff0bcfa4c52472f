"""The scenes of the frequency domain: datasets and figures, from small settings."""

import numpy as np
import pytest

from gearlib import GearPair
from gearlib.figures import analytic_method as figures
from gearlib.figures import steady_orbits as orbit_figures
from gearlib.studies import analytic_method
from gearlib.studies.trials import steady_orbits
from tests.paper import PARAMETERS
from tests.unit.test_work_precision import SETTINGS


@pytest.fixture(scope="module")
def data():
    settings = {
        "shown": [0.7, 1.0],
        "iterations": 40,
        "iteration_harmonics": 32,
        "harmonics": 16,
        "most_degenerate": 2,
        "balance_harmonics": [8, 16],
        "schmidt_harmonics": [8, 16],
    }
    run = {"periods": 120, "record_periods": 10}
    return analytic_method.compute(
        PARAMETERS | {"material_damping": 3953.7}, [0.7, 0.96, 1.2], settings, run
    )


def test_iterates_come_to_the_orbit(data):
    error = data.iterate_error.values
    # 0.25 / 32^2 of the truncated series, with room of two.
    assert (np.nanmin(error, axis=1) < 5e-4).all() and (error[:, 0] > 0.3).all()
    assert data.algebraic_step.values.any(axis=1).all()


def test_the_range_of_convergence(data):
    factor = data.contraction.sel(contact_loss="lost").values
    converged = data.converged.sel(contact_loss="lost").values.astype(bool)
    # At 0.96 contact is lost: it takes a degenerate part.
    assert factor[0, 1] > 1.0 and not converged[0, 1]
    assert (factor[1:, 1] < 1.0).all() and converged[1:, 1].all()
    assert converged[:, [0, 2]].all() and (data.contraction.values[0] < 1.0).all()


def test_harmonic_balance_lies_on_the_exact_curve(data):
    for name, exact in (("balance_max", "displacement_max"), ("balance_min", "displacement_min")):
        # 16 harmonics: 0.25 / 16^2; extrema between 128 phases: another 1e-3.
        np.testing.assert_allclose(data[name], data[exact], rtol=0, atol=4e-3)
    assert data.stable.values.all()
    assert (np.diff(data.balance_displacement_error.values) < 0.0).all()


def test_without_loss():
    pair = analytic_method.without_loss(GearPair(**PARAMETERS, material_damping=100.0))
    assert pair.backlash == 0.0 and pair.backlash_damping == 100.0


def test_steady_orbits(monkeypatch):
    short = [steady_orbits.LADDERS["harmonic_balance"][0]._replace(values=(4, 16, 64))]
    monkeypatch.setitem(steady_orbits.LADDERS, "harmonic_balance", short)
    arguments = ["exact", "harmonic_balance"], ["smooth", "bouncing"], PARAMETERS, SETTINGS
    errors = steady_orbits.errors(*arguments)
    lines = errors.line.values
    assert set(lines) == {"exact", "harmonic balance"}
    # A settled run has its own rounding.
    assert (errors.state_error.values[:, lines == "exact"] < 1e-12).all()
    over_harmonics = errors.state_error.values[:, lines == "harmonic balance"]
    assert (over_harmonics[:, -1] < 1e-2 * over_harmonics[:, 0]).all()
    assert np.isnan(errors.event_error.values[0]).all()
    assert (errors.event_error.values[1, 1:] < 1e-2).all()
    # Damping is the same everywhere: Liouville's formula, which Hill's method keeps to rounding.
    assert (errors.multiplier_error.values[:, lines == "harmonic balance"] < 1e-12).all()
    # By differences of settled runs.
    assert (errors.multiplier_error.values[:, lines == "exact"] < 1e-6).all()
    assert orbit_figures.draw_orbits(errors).axes


def test_figures(data):
    assert len(figures.draw_convergence(data).axes) == 2 * 2 + 2 + 1
    assert len(figures.draw_harmonics(data).axes) == 2 + 1
