"""What a run is in a sentence, and when contact counts as lost."""

import numpy as np
import pytest
import xarray as xr

from gearlib import simulate, sweep
from gearlib.data.motions import contact_loss_fraction, description, without_growth
from gearlib.data.variables import describe
from tests.paper import PAPER
from tests.properties.known_models import pairs_as_train


@pytest.mark.parametrize(
    ("period", "motion"),
    [
        (0, "has not settled after 2 mesh periods"),
        (1, "repeats every mesh period"),
        (2, "repeats every 2 mesh periods"),
        (16, "repeats every 16 mesh periods"),
    ],
)
@pytest.mark.parametrize(
    ("inverse", "bounces", "contact"),
    [
        (0.0, 0.0, "the flanks never part"),
        (0.0, 1.0, "it loses contact once per mesh period"),
        (0.0, 0.5, "it loses contact 0.5 times per mesh period"),
        (0.01, 2.0, "it strikes both flanks"),
    ],
)
def test_a_motion_in_words(period, motion, inverse, bounces, contact):
    run = simulate(PAPER, 0.7, periods=2)
    for name, value in {"period": period, "fraction_inverse": inverse, "bounces": bounces}.items():
        run[name] = run[name].copy(data=np.array(value))
    assert description(run) == f"The motion from rest {motion}; {contact}."


def test_rounding_of_times_is_no_loss_of_contact():
    shares = np.array([1.0, 1.0 - 1e-12, 1.0 + 1e-12, 0.999, 0.0])
    np.testing.assert_allclose(
        contact_loss_fraction(shares), [0.0, 0.0, 0.0, 0.001, 1.0], rtol=1e-12
    )
    assert (contact_loss_fraction(shares)[:3] == 0.0).all()


def test_a_variable_without_an_entry_is_named():
    with pytest.raises(KeyError, match="displacement_extra"):
        describe(xr.Dataset({"displacement_extra": 1.0}))


STEEP = PAPER.replace(stiffness_ratio=0.2)


@pytest.mark.parametrize("model", [STEEP, pairs_as_train(STEEP)])
def test_curves_end_where_motions_grow(model):
    # Without damping it grows in wide tongues, to some millions and beyond 1e8.
    curve = sweep(model, np.linspace(0.5, 1.4, 60), periods=70, record_periods=1)
    reach = np.abs(curve.displacement_max.values.reshape(60, -1)).max(axis=1)
    assert np.nanmax(reach) > 1e4 * model.extent
    grown = ~(reach <= 1e3 * model.extent)
    shown = without_growth(curve, model.extent)
    assert grown.any() and not grown.all() and np.nanmax(shown.displacement_max) < 1e4
    for name in ("displacement_min", "dynamic_force_max", "final_state"):
        gone = np.isnan(shown[name].values.reshape(60, -1)).all(axis=1)
        np.testing.assert_array_equal(gone, grown)
    assert shown.period.equals(curve.period) and shown.status.equals(curve.status)
