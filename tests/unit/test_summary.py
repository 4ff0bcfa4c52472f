"""What a run is in a sentence, and when contact counts as lost."""

import numpy as np
import pytest

from gearlib import simulate, sweep
from gearlib.data.motions import contact_loss_fraction, describe, mask_unbounded
from tests.paper import PAPER
from tests.properties.known_models import pairs_as_train

STEEP = PAPER.replace(stiffness_ratio=0.2)


@pytest.mark.parametrize(
    ("period", "inverse", "bounces", "words"),
    [
        (0, 0.0, 0.0, "has not settled after 2 mesh periods; the flanks never part"),
        (1, 0.0, 1.0, "repeats every mesh period; it loses contact once per mesh period"),
        (2, 0.0, 0.5, "repeats every 2 mesh periods; it loses contact 0.5 times per mesh period"),
        (16, 0.01, 2.0, "repeats every 16 mesh periods; it strikes both flanks"),
    ],
)
def test_a_motion_in_words(period, inverse, bounces, words):
    run = simulate(PAPER, 0.7, periods=2)
    run = run.assign(period=period, fraction_inverse=inverse, bounces=bounces)
    assert describe(run) == f"The motion from rest {words}."


def test_rounding_of_times_is_no_loss_of_contact():
    losses = contact_loss_fraction(np.array([1.0, 1.0 - 1e-12, 1.0 + 1e-12, 0.999, 0.0]))
    assert losses == pytest.approx([0.0, 0.0, 0.0, 0.001, 1.0], rel=1e-12, abs=0.0)


@pytest.mark.parametrize("model", [STEEP, pairs_as_train(STEEP)])
def test_curves_end_where_motions_grow(model):
    # Without damping it grows in wide tongues, to some millions and beyond 1e8.
    curve = sweep(model, np.linspace(0.5, 1.4, 60), periods=70, record_periods=1)
    reach = np.abs(curve.displacement_max.values.reshape(60, -1)).max(axis=1)
    grown, shown = ~(reach <= 1e3 * model.extent), mask_unbounded(curve, model.extent)
    assert grown.any() and not grown.all() and np.nanmax(shown.displacement_max) < 1e4
    for name in ("displacement_min", "dynamic_force_max", "final_state"):
        gone = np.isnan(shown[name].values.reshape(60, -1)).all(axis=1)
        np.testing.assert_array_equal(gone, grown)
    assert shown.period.equals(curve.period) and shown.status.equals(curve.status)
