"""Tongues of trains: exact multipliers against widths to first order in the stiffness jump."""

import math

import numpy as np
import pytest

from gearlib import planetary
from gearlib.analysis.tongues import undamped
from gearlib.analysis.tongues.first_order import first_order
from gearlib.studies.trains import train_stability

FREE = dict(structural_damping=0.0, material_damping=0.0, backlash_damping=0.0)


def train(teeth, jump, planets=3, **options):
    """Return an undamped planetary train with this jump over its mean stiffness."""
    ratios = [undamped.stiffness_ratio(jump, epsilon) for epsilon in (1.4, 1.6)]
    return planetary(planets=planets, teeth=teeth, stiffness_ratio=ratios, **FREE | options)


def log_radius(model, tuning):
    return math.log(np.abs(np.linalg.eigvals(model.contact_map(tuning))).max())


def exact_width(model, tongue):
    """Return the width of the unstable interval around the middle of a first-order tongue."""
    assert log_radius(model, tongue.tuning) > undamped.NEUTRAL

    def edge(side):
        # The growth is a root at the edge: where it exceeds 1e-6 is the edge to twelve digits.
        inside, outside = tongue.tuning, tongue.tuning + side * tongue.width
        assert log_radius(model, outside) <= undamped.NEUTRAL
        while abs(outside - inside) > 1e-6 * tongue.width:
            middle = 0.5 * (inside + outside)
            if log_radius(model, middle) > undamped.NEUTRAL:
                inside = middle
            else:
                outside = middle
        return inside

    return edge(1) - edge(-1)


@pytest.mark.parametrize(
    ("teeth", "planets", "modes"),
    [
        # In phase: rotational modes and double ones, with themselves and another.
        ((27, 99), 3, [(16, 16), (11, 11), (13, 13), (11, 14)]),
        # A third of a mesh period apart: rotational with double modes.
        ((28, 98), 3, [(14, 16), (14, 14), (11, 13)]),
        # Half a mesh period apart: satellite modes take part.
        ((26, 98), 4, None),
    ],
)
def test_first_order_widths_are_those_of_exact_multipliers(teeth, planets, modes):
    wider = first_order(train(teeth, 0.02, planets), 0.5, 3.0, 2)
    if modes is None:
        modes = [one.modes for one in sorted(wider, key=lambda one: -one.width)[:4]]
    chosen = [one for one in wider if one.modes in modes and one.order == 1]
    assert len(chosen) == len(modes)
    for one in chosen:
        errors = []
        for jump in (0.01, 0.02):
            model = train(teeth, jump, planets)
            same = [t for t in first_order(model, 0.5, 3.0, 1) if t.modes == one.modes]
            errors.append(abs(exact_width(model, same[0]) / same[0].width - 1.0))
        # To three digits at 1 and 2 %, better for the smaller jump; to all digits they differ.
        assert errors[1] < 2e-3 and 1e-7 < errors[0] < 0.7 * errors[1], (one, errors)


def test_tongues_vanish_by_contact_ratio_and_by_tooth_numbers():
    for epsilon, orders in ((1.5, {1, 3}), (4.0 / 3.0, {1, 2})):
        ratios = dict(contact_ratio=(epsilon, epsilon), stiffness_ratio=(0.9, 0.9))
        model = planetary(teeth=(27, 99), **ratios, **FREE)
        assert {one.order for one in first_order(model, 0.5, 3.0, 3)} == orders
    kinds = planetary(teeth=(28, 98)).modes().mode_kind.values[1:]
    for one in first_order(train((28, 98), 0.02), 0.5, 3.0, 4):
        # Of the first harmonics only every third couples rotational modes with each other.
        assert set(kinds[list(one.modes)]) != {"rotational"} or one.order % 3 == 0


def test_a_chart_shows_tongues_of_all_harmonics_that_reach_its_tunings():
    model = train((28, 98), 0.3)
    tongues = first_order(model, 0.5, 0.9, 60)
    assert max(one.order for one in tongues) > 3
    middles = sorted(one.tuning for one in tongues)
    assert train_stability._named(model, np.array(middles)).all()
    beside = np.array([one.tuning + 0.6 * one.width for one in tongues if one.width > 1e-3])
    assert beside.size and not train_stability._named(model, np.sort(beside)).all()


@pytest.mark.parametrize("teeth", [(27, 99), (28, 98)])
def test_growth_of_many_tunings_is_that_of_each(teeth):
    model = train(teeth, 0.3)
    tunings = np.linspace(0.6, 2.6, 9)
    expected = [max(log_radius(model, nu), 0.0) for nu in tunings]
    # Exponentials of 34 rows by two ways; double multipliers part by the root of rounding.
    np.testing.assert_allclose(undamped.growth(model, tunings), expected, rtol=1e-9, atol=3e-7)
    assert np.ptp(expected) > 0.01


def test_a_gyroscopic_train_is_refused():
    with pytest.raises(ValueError, match="gyroscopic = True is not allowed"):
        undamped.growth(planetary(turning=True, gyroscopic=True), [1.0])
