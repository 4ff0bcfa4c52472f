"""The scenes of the planetary train: configuration, data and figures."""

import dataclasses

import numpy as np
import pytest

from gearlib import planetary
from gearlib.analysis.tongues import undamped
from gearlib.config import load
from gearlib.figures import symmetry_breaking_figure
from gearlib.studies.trains import symmetry, train_stability
from tests.unit.test_defaults import GEARS

LEAST = {
    "gear_pair": GEARS,
    "dampings": {"oil": {"material_damping": 0.0, "backlash_damping": 20.0}},
}
CONFIG = load(LEAST)
TRAIN = CONFIG.planetary.model_dump()
GRID = {"start", "stop", "step"}


def chart():
    given = CONFIG.train_chart.model_dump(exclude=GRID) | {"values": 3}
    return train_stability.compute(TRAIN, np.arange(12.0, 26.0, 0.5), given)


def breaking(tunings, **other):
    given = CONFIG.symmetry_breaking.model_dump(exclude={*GRID, "periods_shown"}) | other
    return symmetry.compute(TRAIN, tunings, given | {"starts": 4, "first_starts": 2})


def test_the_default_train_is_the_library_s():
    # Angles of the configuration have fewer digits than those of the library.
    ours, theirs = planetary(**TRAIN), planetary()
    assert ours.mesh_names == theirs.mesh_names
    np.testing.assert_allclose(ours.linear_modes[0], theirs.linear_modes[0], rtol=1e-5)
    for one, other in zip(ours.bodies, theirs.bodies, strict=True):
        same = dataclasses.replace(one, base_radius=other.base_radius, inertia=other.inertia)
        assert same.mass == other.mass and same.support_damping == other.support_damping


def test_a_jump_is_the_difference_of_the_levels_over_the_mean():
    train = train_stability.with_jump(TRAIN, 0.3, {"reference_frequency": 1000.0})
    for mesh in train.meshes:
        levels = mesh.max_stiffness * np.array([1.0, mesh.stiffness_ratio])
        assert (levels[0] - levels[1]) / mesh.mean_stiffness == pytest.approx(0.3, rel=1e-12)
        assert mesh.mean_stiffness == pytest.approx(5e8, rel=1e-12)


def test_shares_of_the_chart_are_those_of_its_points():
    data = chart()
    unstable = data.growth.values > undamped.NEUTRAL
    named = data.first_order_unstable.values == 1
    missed = (unstable & ~named).sum(axis=-1) / unstable.sum(axis=-1)
    np.testing.assert_allclose(data.missed_share, missed)
    np.testing.assert_allclose(data.unstable_share, unstable.mean(axis=-1))
    # What is unstable grows with the jump, and the wide tongues are mostly those of first order.
    assert (np.diff(data.unstable_share.sel(plane="stiffness_jump")) > 0.0).all()
    assert (missed < 0.15).all() and unstable.any(axis=-1).all()


def test_tongues_of_higher_harmonics_are_named():
    given = CONFIG.train_chart.model_dump(exclude=GRID) | {"values": 1}
    train = train_stability.with_jump(
        TRAIN | {"teeth": given["teeth"][0]}, given["largest_jump"], given
    )
    # Twice the highest natural frequency over 2 and 3: the middles of its own tongues.
    top = 2.0 * np.sqrt(train.linear_modes[0][-1]) / train.reference_angular_frequency
    data = train_stability.compute(TRAIN, top / np.array([3.0, 2.0]), given)
    assert data.first_order_unstable.isel(phasing=0, row=0).sel(plane="stiffness_jump").all()


def test_symmetry_breaks_where_only_other_multipliers_leave_the_circle():
    data = breaking([16.0, 19.5, 15.0], shown=19.5)
    assert data.verdict.values.tolist() == [1, 2, 3]
    assert data.motion_count.dtype == data.period.dtype == np.int32
    assert (data.symmetric_multiplier > 1.0).values.tolist() == [False, False, True]
    # Beside a stable motion starts come back; where it breaks each leads to a motion of its own.
    assert data.settled.values.tolist() == [1, 0, 0]
    assert data.bounces.values[0].max() == 0.0 and data.bounces_high.values[1, :3].min() > 0.1
    assert data.symmetric_bounces.values[1].max() == 0.0
    own = data.symmetric_dynamic_force_max.values
    np.testing.assert_allclose(data.dynamic_force_max_high.values[0], own[0], rtol=1e-9)
    assert (data.dynamic_force_max_high.values[1, :3] > 2.0 * own[1, :3]).all()
    course = data.dynamic_force.sel(mesh="sun 1").values
    assert np.isfinite(course).all() and course.min() == 0.0


def test_without_a_symmetric_orbit_the_figure_says_so():
    data = breaking([16.0, 17.0], shown=20.0)
    words = [text.get_text() for text in symmetry_breaking_figure.draw(data, 1).axes[-1].texts]
    assert words == ["no symmetric orbit, or chaos"]
