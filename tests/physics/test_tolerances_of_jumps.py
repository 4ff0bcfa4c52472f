"""Indices, first order, tightened tolerances, certified boxes: closed forms, samples, corners."""

import dataclasses

import numpy as np
import pytest

import gearlib
from gearlib.tolerances.boxes import certify_box
from gearlib.tolerances.expansions import expansion_errors
from gearlib.tolerances.indices import sobol_indices
from gearlib.tolerances.linear_scatter import BENDS, CUSP, GRAZING, HOLDS, first_order_scatter
from gearlib.tolerances.quantities import Followed
from gearlib.tolerances.tightening import tighten
from tests.geometry.drawings import fzg_c
from tests.paper import PAPER

DAMPED = PAPER.replace(material_damping=4.5e3, backlash_damping=300.0)


def scattered(model, share, names):
    """Return tolerances of a standard deviation of so much of each value."""
    return {
        name: {"mean": getattr(model, name), "std": share * getattr(model, name)} for name in names
    }


def test_indices_are_those_of_a_product():
    # Without damping the onset is a number times (C / m)^(1/2): indices of a product, by moments.
    tolerances = {
        "max_stiffness": {"min": 5e7, "max": 7.5e8},
        "reduced_mass": {"min": 0.3, "max": 6.0},
    }
    found = sobol_indices(PAPER, tolerances, ("onset_of_contact_loss",), 256, seed=3)

    def moments(low, high, power):
        mean = (high ** (power + 1) - low ** (power + 1)) / (power + 1) / (high - low)
        return mean, (np.log(high / low) if power == -0.5 else (high**2 - low**2) / 2.0) / (
            high - low
        )

    first, square = moments(5e7, 7.5e8, 0.5)
    other, inverse = moments(0.3, 6.0, -0.5)
    whole = square * inverse - (first * other) ** 2
    own = (square - first**2) * other**2 / whole, (inverse - other**2) * first**2 / whole
    index = found.first_index.values[0]
    assert index == pytest.approx(own, abs=0.02)
    assert found.total_index.values[0] == pytest.approx([1.0 - own[1], 1.0 - own[0]], abs=0.02)
    low, high = found.first_index_interval.values[0].T
    assert ((low < index) & (index < high)).all()
    assert int(found.missing_designs[0]) == 0
    again = sobol_indices(PAPER, tolerances, ("onset_of_contact_loss",), 256, seed=3)
    assert again.identical(found)


def test_designs_without_a_jump_are_counted():
    model = DAMPED.replace(material_damping=8.4e3)
    tolerances = scattered(model, 0.01, ("material_damping", "contact_ratio"))
    found = sobol_indices(model, tolerances, ("jump_up",), 16)
    assert 0 < int(found.missing_designs[0]) < 4 * 16
    assert np.isfinite(found.total_index.values).all()


@pytest.mark.parametrize(
    "ratio, contact_ratio, damping, backlash, first",
    [(0.429, 1.228, 0.069, 1.11, 0.86), (0.605, 1.797, 0.049, 3.96, 0.645)],
)
def test_a_motion_that_jumps_up_to_the_far_flank_falls_later(
    ratio, contact_ratio, damping, backlash, first
):
    pair = PAPER.replace(stiffness_ratio=ratio, contact_ratio=contact_ratio)
    size = damping * 2.0 * pair.reduced_mass * pair.mean_eigenfrequency
    gap = backlash * pair.static_deflection
    pair = pair.replace(material_damping=size, backlash_damping=size, backlash=gap)
    asked = ("jump_up", "jump_down")
    found = gearlib.scatter(pair, {"load": {"std": "0.1 %"}}, asked, n=4)
    assert all((found[f"{name}_status"] == 0).all() for name in asked)
    # A sweep down over both jumps: the amplitude rises at the first and falls at the second.
    tunings = np.arange(0.6, 1.2, 0.002)
    curve = gearlib.sweep(pair, tunings, direction="down", periods=200, record_periods=1)
    height = curve.displacement_max.values
    i = int(np.argmax(np.diff(height) / height[1:]))
    low, high = curve.tuning.values[i : i + 2] * float(pair.speed(1.0))
    # Of the load alone no speed depends, but by the backlash over the deflection.
    speed = float(found.jump_down_nominal)
    assert low - 2.0 < speed < high + 2.0 < pair.speed(first)
    assert float(found.jump_down_deviation) == pytest.approx(
        float(found.jump_down_first_order), rel=0.5
    )


def test_first_order_holds_where_tolerances_are_small():
    names = ("max_stiffness", "stiffness_ratio", "reduced_mass", "backlash", "material_damping")
    quantities = ("jump_up", "jump_down", "onset_of_contact_loss", "peak")
    found = first_order_scatter(DAMPED, scattered(DAMPED, 0.005, names), quantities, 128)
    assert found.first_order_verdict.values.tolist() == [HOLDS] * 4
    assert found.deviation_ratio.values == pytest.approx(1.0, abs=0.05)
    for name in quantities:
        share = float(found[f"{name}_deviation"] / found[f"{name}_sampled_deviation"])
        # Of 128 balanced samples.
        assert share == pytest.approx(1.0, abs=0.06), name
        low, _, high = found[f"{name}_quantile"].values
        spread = float(found[f"{name}_deviation"])
        assert (high - low) / spread == pytest.approx(2.0 * 1.6449, rel=5e-3)
    assert "jump_up: first order holds" in found.attrs["said"]


def test_what_nothing_moves_holds_in_first_order():
    # Lengths go with the load, and no speed does.
    found = first_order_scatter(DAMPED, {"load": {"std": "5 %"}}, ("jump_up",), 4)
    assert int(found.first_order_verdict[0]) == HOLDS and float(found.deviation_ratio[0]) == 1.0


def test_of_branches_alike_the_worst_counts_in_first_order():
    def train(first=0.0, second=0.0):
        errors = [(0.0, first), (0.0, second), (0.0, 0.0)]
        return gearlib.planetary(stiffness_ratio=(0.7, 0.8), pin_errors=errors)

    pins = {name: {"mean": 0.0, "std": 2e-6} for name in ("first", "second")}
    asked, speed = ("load_sharing", "least_load_sharing"), float(train().speed(0.6))
    found = first_order_scatter(train, pins, asked, 8, speed=speed)
    assert found.first_order_verdict.values.tolist() == [HOLDS] * 2
    # All flanks keep contact: mean forces are linear in the errors, but for their sum.
    assert found.nonlinearity.values == pytest.approx(0.0, abs=0.02)
    for name in asked:
        # Either pin may be the worst, on one side of it, by as much.
        one, other = np.abs(found[f"{name}_effect"].values)
        assert one == pytest.approx(other, rel=1e-6)


def test_first_order_of_any_function_is_that_of_its_parameters():
    def changed(max_stiffness, material_damping):
        return DAMPED.replace(max_stiffness=max_stiffness, material_damping=material_damping)

    given = scattered(DAMPED, 0.005, ("max_stiffness", "material_damping"))
    exact, found = (
        first_order_scatter(model, given, ("jump_up", "peak"), 2) for model in (DAMPED, changed)
    )
    for name in ("jump_up_effect", "peak_effect"):
        # By central differences: what they leave is the square of their step.
        assert found[name].values == pytest.approx(exact[name].values, rel=1e-4), name


def test_first_order_says_where_it_does_not_hold():
    model = DAMPED.replace(material_damping=8.4e3)
    found = first_order_scatter(
        model, scattered(model, 0.01, ("material_damping",)), ("jump_up",), 32
    )
    assert int(found.first_order_verdict[0]) == CUSP
    assert "next to a cusp" in found.attrs["said"]
    wide = {"reduced_mass": {"min": 0.3, "max": 6.0}}
    found = first_order_scatter(PAPER, wide, ("onset_of_contact_loss",), 256)
    assert int(found.first_order_verdict[0]) == BENDS
    onset = float(Followed(DAMPED, (), ("onset_of_contact_loss",)).nominal[0])
    at_duty = scattered(DAMPED, 0.01, ("reduced_mass",)), ("contact_margin",)
    grazing = first_order_scatter(DAMPED, *at_duty, 16, speed=onset)
    assert int(grazing.first_order_verdict[0]) == GRAZING
    # The onset goes with the mass to the power -1/2: both deviations in closed form.
    mean, inverse = 2.0 * (6.0**0.5 - 0.3**0.5) / 5.7, np.log(20.0) / 5.7
    exact, line = np.sqrt(inverse - mean**2), 0.5 * 3.15**-1.5 * 5.7 / np.sqrt(12.0)
    # Of 256 balanced samples.
    assert found.deviation_ratio.values[0] == pytest.approx(line / exact, rel=0.005)


def test_tightened_tolerances_keep_their_risk():
    speed = float(DAMPED.speed(1.13))
    tolerances = scattered(DAMPED, 0.006, ("stiffness_ratio", "contact_ratio", "material_damping"))
    tolerances |= scattered(DAMPED, 0.02, ("reduced_mass",))
    found = tighten(DAMPED, tolerances, speed=speed, n=512)
    # A sum of normal distributions: the margin has to be 2.326 deviations.
    follow = Followed(DAMPED, (), ("contact_margin",), speed=speed)
    deviation = np.linalg.norm(found.effect)
    nominal = follow.nominal[0]
    assert float(found.first_order_of_all) == pytest.approx(nominal / deviation / 2.3263, rel=5e-3)
    alone = found.first_order_share.values
    for i in np.flatnonzero(np.isfinite(alone)):
        rest = np.delete(found.effect.values, i)
        left = (nominal / 2.3263) ** 2 - rest @ rest
        assert alone[i] == pytest.approx(np.sqrt(left) / abs(found.effect.values[i]), rel=2e-2)
    assert np.isfinite(alone).any()
    # Of designs: no more are beyond than may be, and not many fewer.
    given, after = found.probability.values
    low, high = found.probability_interval.values[1]
    assert given > 0.025 and 0.005 < after <= 0.0101 and low < 0.01 < high
    own = np.isfinite(found.tightened_share)
    assert (found.tightened_probability.values[own] <= 0.0101).all()


def test_what_no_tolerance_changes_is_refused():
    speed = float(DAMPED.speed(0.95))
    with pytest.raises(ValueError, match="^limit = 0.0 is not allowed: the nominal design has -"):
        tighten(DAMPED, scattered(DAMPED, 0.02, ("load",)), speed=speed)


def around(model, share, names):
    """Return a box of so much about each value."""
    return {
        name: ((1.0 - share) * getattr(model, name), (1.0 + share) * getattr(model, name))
        for name in names
    }


def test_no_point_contradicts_a_certified_box():
    pytest.importorskip("flint")
    names = (
        "max_stiffness",
        "stiffness_ratio",
        "contact_ratio",
        "reduced_mass",
        "material_damping",
    )
    speed = float(DAMPED.speed(0.76))
    found = certify_box(DAMPED, around(DAMPED, 0.02, names), speed, pieces=300)
    assert 0.2 < found.share < 0.5 and not found
    assert len(found.certified) and len(found.open)
    follow = Followed(DAMPED, (), ("contact_margin",), speed=speed)
    random, proven = np.random.default_rng(1), 0
    for _ in range(1000):
        values = random.uniform(*found.box.T)
        if found.proves(values):
            proven += 1
            model = DAMPED.replace(**dict(zip(names, map(float, values), strict=True)))
            assert follow(model)[0][0] > 0.0
    assert proven / 1000 == pytest.approx(found.share, abs=0.05)
    # All of a smaller box, of which load and backlash are no matter.
    small = around(DAMPED, 0.005, (*names, "load", "backlash"))
    assert certify_box(DAMPED, small, speed, pieces=50)


def test_a_box_of_drawn_gears():
    pytest.importorskip("flint")
    model = gearlib.GearPair.from_geometry(fzg_c(), torque=200.0, damping_ratio=0.08)
    names = ("max_stiffness", "stiffness_ratio", "contact_ratio", "material_damping")
    found = certify_box(model, around(model, 0.01, names), 0.6 * float(model.speed(1.0)))
    assert found and found.share == pytest.approx(1.0, abs=1e-12)


def test_a_box_beside_the_onset_stays_open():
    pytest.importorskip("flint")
    speed = float(Followed(DAMPED, (), ("onset_of_contact_loss",)).nominal[0])
    stiffness = DAMPED.max_stiffness
    box = {"max_stiffness": (0.99 * stiffness, 1.01 * stiffness), "load": (1e3, 1e4)}
    found = certify_box(DAMPED, box, speed, pieces=300)
    # Stiffer pairs have their onset at higher speeds: the upper half is certified, but for its rim.
    assert 0.4 < found.share < 0.5
    assert found.certified[:, 0, 0].min() > stiffness
    assert not found.proves((0.995 * stiffness, 3e3)) and found.proves((1.009 * stiffness, 3e3))


def test_pin_errors_are_certified_at_the_corners():
    pytest.importorskip("flint")

    def set_of(radial, tangential):
        errors = [(radial, tangential), (0.0, 0.0)]
        return gearlib.planetary(
            planets=2, planet_teeth=36, stiffness_ratio=(0.7, 0.8), pin_errors=errors
        )

    speed = float(set_of(0.0, 0.0).speed(0.6))
    found = certify_box(
        set_of, {"radial": (-1e-5, 1e-5), "tangential": (0.0, 1e-5)}, speed, pieces=1
    )
    assert found and found.share == 1.0
    train = set_of(0.0, 0.0)
    # An error so large that a mesh lets go.
    names = [f"error of mesh {name}" for name in train.mesh_names[:1]]
    found = certify_box(train, {names[0]: (-1e-3, 0.0)}, speed, pieces=4)
    assert not found and found.share < 1.0
    # Nor is a small curve a line: 5e-10 m in the middle.
    with pytest.raises(ValueError, match="whose errors and torques change in proportion"):
        certify_box(lambda x: set_of(x + 20.0 * x * x, 0.0), {"x": (0.0, 1e-5)}, speed, pieces=1)
    with pytest.raises(ValueError, match="trains that differ in errors of assembly and torques"):
        certify_box(
            lambda load: dataclasses.replace(train, carrier_ratio=load),
            {"load": (0.1, 0.2)},
            speed,
        )
    for other in (DAMPED, None):
        with pytest.raises(ValueError, match="must be a function that returns a GearTrain"):
            certify_box(lambda load, other=other: other, {"load": (0.1, 0.2)}, speed)


def test_quantities_of_a_train_are_of_the_mesh_that_counts():
    train = gearlib.planetary(planets=2, planet_teeth=36, stiffness_ratio=(0.7, 0.8))
    train = dataclasses.replace(train, reference="ring 2")
    names = ("transmission_error", "force", "contact_margin")
    found = Followed(train, (), names, speed=float(train.speed(0.6))).nominal
    run = gearlib.simulate(train, 0.6, periods=1200, record_periods=1)
    least = run.displacement_min * run.static_deflection
    heights = run.displacement_max * run.static_deflection - least
    force = (run.dynamic_force_max * run.force_scale).max()
    # Transients have died out to 1e-4.
    for value, own in zip(found, (heights.sel(mesh="ring 2"), force, least.min()), strict=True):
        assert value == pytest.approx(float(own), rel=2e-4)
    assert heights.max() > 1.5 * found[0]


def test_polynomials_fail_at_the_jump_and_nowhere_else():
    pytest.importorskip("chaospy")
    names = ("max_stiffness", "reduced_mass", "material_damping")
    jump, _ = Followed(DAMPED, (), ("jump_up", "jump_down")).nominal
    speeds = [0.85 * jump, jump, 1.2 * jump]
    found = expansion_errors(DAMPED, scattered(DAMPED, 0.01, names), speeds, (1, 3), 512)
    chaos, samples = found.distribution_error.values
    # Of 512 exact runs; those of a fit are 8 and 40.
    assert (chaos[1, [0, 2]] < 0.01).all() and (samples[1, [0, 2]] > 0.02).all()
    assert chaos[1, 1] > 0.15 > samples[1, 1]
    assert 0.2 < found.loss_probability[1] <= 1.0
    # Between the motions, where no design is, the polynomial has many; beside the jump it has all.
    exact, stand_in = found.exact_height_quantile, found.height_quantile[0, -1]
    np.testing.assert_allclose(stand_in[[0, 2]], exact[[0, 2]], rtol=0.01)
    low, high = float(exact[1].min()), float(exact[1].max())
    gap = [
        int(((one > low + 0.3 * (high - low)) & (one < high - 0.2 * (high - low))).sum())
        for one in (exact[1], stand_in[1])
    ]
    assert gap[0] < 3 and gap[1] > 30
