"""The scenes of the frequency domain: datasets and figures, from small settings."""

import numpy as np
import pytest

from gearlib.studies import analytic_method
from tests.paper import PARAMETERS


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
