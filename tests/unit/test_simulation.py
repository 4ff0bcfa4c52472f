"""The public calls: the equation of motion, units, what a run is in a sentence, limits."""

import math
import re

import numpy as np
import pint
import pytest

from gearlib import GearPair, simulate, sweep
from gearlib.data.motions import contact_loss_fraction, describe, mask_unbounded
from tests.paper import PAPER
from tests.properties.known_models import pairs_as_train

PAIR = GearPair.from_ratios(
    contact_ratio=1.569, stiffness_ratio=0.5879, damping=0.0617, backlash_damping=0.0617, backlash=4
)
RUN = {"periods": 60, "record_periods": 4}


def test_equation_of_motion_holds_at_every_sample():
    run = simulate(PAIR, 0.9, samples_per_period=512, **RUN)
    damping = np.where(run.contact == 0, PAIR.backlash_damping_ratio, PAIR.damping_ratio)
    residual = run.acceleration + 2 * damping / 0.9 * run.velocity + (run.dynamic_force - 1) / 0.81
    # Rounding of a sum of terms of order one.
    assert float(abs(residual).max()) < 1e-13 and float(run.bounces) > 0.0
    assert np.array_equal(run.modified_stiffness, run.stiffness * (run.contact != 0))


@pytest.mark.parametrize(
    "call", [lambda pair: simulate(pair, 0.9, **RUN), lambda pair: sweep(pair, [0.7, 0.9], **RUN)]
)
def test_units_tell_what_scales_with_load_and_size(call):
    # The same pair in other units of length, mass and time: powers of two change no digit.
    length, mass, time = 2.0, 4.0, 2.0
    pair = PAPER.replace(material_damping=3953.7, backlash_damping=500.0)
    factors = {"max_stiffness": mass / time**2, "reduced_mass": mass, "backlash": length}
    factors |= {"load": mass * length / time**2}
    factors |= {"material_damping": mass / time, "backlash_damping": mass / time}
    changed = pair.replace(**{name: getattr(pair, name) * x for name, x in factors.items()})
    registry, scales = pint.UnitRegistry(), {"[length]": length, "[mass]": mass, "[time]": time}
    first, second = call(pair), call(changed)
    for name, variable in first.variables.items():
        if variable.dtype.kind in "fi":
            # CF writes powers without a sign for them.
            text = re.sub(r"(?<=[a-z])(-?[0-9])", r"**\1", variable.attrs["units"])
            unit = registry.Unit(text).dimensionality
            factor = math.prod(scales[part] ** power for part, power in unit.items())
            np.testing.assert_array_equal(second[name], factor * variable, err_msg=name)


def test_event_limit_is_a_status_not_a_number():
    chaotic = PAIR.replace(material_damping=0.0, backlash_damping=0.0)
    stuck = simulate(chaotic, 0.05, periods=3, max_events=5)
    assert int(stuck.status) == 1 and "raise max_events" in stuck.status.attrs["message"]
    assert stuck.displacement.isnull().all() and stuck.final_state.isnull().all()
    assert stuck.sizes["event"] == 0
    table = sweep(chaotic, [0.05], periods=300, record_periods=1, max_events=5)
    assert table.status.values.tolist() == [1] and table.displacement_max.isnull().all()


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
