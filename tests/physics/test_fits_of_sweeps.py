"""Fits to slow sweeps of synthetic rigs: statistics over speed, jumps, onset of contact loss."""

import os

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib.analysis.orbits.main_resonance import Resonance
from gearlib.rig.branch_observations import BranchStatistics
from gearlib.rig.orbit_at_speed import STATISTICS, OrbitAtSpeed
from gearlib.rig.speed_observations import Speeds
from tests.paper import PAPER

#: Speeds of each direction.
COUNT = 21
TRUTH = PAPER.replace(material_damping=3953.7, backlash_damping=3953.7)
FREE = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7), "load": (2e3, 5e3)}


def resonance(pair, seed, names=("displacement_max", "fraction_backlash"), gain=1.0):
    """Return a synthetic resonance curve, up and down, with noise; without, if seed is None."""
    rng, tunings = np.random.default_rng(seed), np.linspace(0.6, 1.0, COUNT)
    runs = [
        gearlib.sweep(pair, tunings, periods=300, record_periods=1, direction=way)
        for way in ("up", "down")
    ]
    data = xr.Dataset(
        coords={
            "speed": ("sample", np.tile(tunings * pair.speed(1.0), 2)),
            "direction": ("sample", np.repeat([1, -1], COUNT)),
        }
    )
    for name in names:
        scale = {"length": pair.static_deflection, "force": pair.load, "share": 1.0}
        values = scale[STATISTICS[name]] * np.hstack([run[name].values for run in runs])
        noise = 0.0 if seed is None else 0.02 * values.std()
        attrs = {"noise_std": gain * noise, "unknown_gain": int(gain != 1.0)}
        data[name] = "sample", gain * (values + rng.normal(0.0, noise, 2 * COUNT)), attrs
    return data


@pytest.mark.parametrize("tuning", [0.62, 0.9])
def test_points_have_the_derivatives_at_their_speed(tuning):
    names = (*FREE, "max_stiffness", "stiffness_ratio", "contact_ratio", "backlash")
    run = gearlib.sweep(TRUTH, [0.6, tuning], periods=300, record_periods=1, direction="up")
    speed, state = TRUTH.speed(tuning), run.final_state.values[-1]
    point = OrbitAtSpeed(TRUTH, speed, state, names)
    for i, name in enumerate(names):
        step = 1e-4 * getattr(TRUTH, name)
        ends = [
            OrbitAtSpeed(TRUTH.replace(**{name: getattr(TRUTH, name) + k * step}), speed, state, ())
            for k in (1.0, -1.0, 2.0, -2.0)
        ]
        for one in STATISTICS:
            a, b, c, d = (end.of(one)[0] for end in ends)
            value, slopes, _ = point.of(one)
            slope = (8.0 * (a - b) - (c - d)) / (12.0 * step)
            size = max(abs(value), 1e-12) / getattr(TRUTH, name)
            assert abs(slope - slopes[i]) < 1e-8 * (abs(slope) + size), (name, one)


def test_exact_curves_of_unknown_noise_give_the_truth():
    # Jumps are known to half a step only: with one scale for all they would pull damping by 12 %.
    data = resonance(TRUTH, None)
    guess = TRUTH.replace(material_damping=4200.0, reduced_mass=3.1, load=3200.0)
    found = gearlib.fit(guess, data, FREE, starts=0)
    for name, one in found.params.items():
        # The orbits of data and model settle to some 1e-9 of each other.
        assert one.value == pytest.approx(getattr(TRUTH, name), rel=1e-7), name


@pytest.mark.skipif("GEARLIB_RIGS" not in os.environ, reason="GEARLIB_RIGS: 10 s")
def test_a_resonance_curve_tells_three_parameters():
    guess = TRUTH.replace(material_damping=4200.0, reduced_mass=3.1, load=3200.0)
    found = gearlib.fit(guess, resonance(TRUTH, 1), FREE, starts=0)
    assert 0.5 < found.redchi < 1.6 and not found.unknown
    for name, one in found.params.items():
        assert abs(one.value - getattr(TRUTH, name)) < 4.0 * one.stderr, name
        assert one.stderr < 0.01 * one.value


def test_load_is_a_scale_that_an_unknown_gain_hides():
    # While the far flank is not struck all lengths go with the load, shares of time do not feel it.
    for scale, held in ((2.5, True), (1.0, False)):
        observation = BranchStatistics(resonance(TRUTH, 1, gain=scale), TRUTH)
        for load, struck in ((2e3, False), (3e3, False), (4e3, True)):
            slopes = observation.residuals(TRUTH.replace(load=load), ("reduced_mass", "load"))[1]
            assert slopes[:, 0].any() and slopes[:, 1].any() == (struck or not held)


def test_a_speed_that_is_measured_twice_has_the_same_motion_twice():
    one = resonance(TRUTH, 3).isel(sample=slice(12))
    rest, slopes = BranchStatistics(one, TRUTH).residuals(TRUTH, tuple(FREE))
    twice = xr.concat([one, one], "sample", combine_attrs="override")
    found = BranchStatistics(twice, TRUTH).residuals(TRUTH, tuple(FREE))
    assert found[0].size == 2 * rest.size
    np.testing.assert_allclose(found[0] @ found[0], 2.0 * rest @ rest, rtol=1e-9)
    np.testing.assert_allclose(found[1].T @ found[1], 2.0 * slopes.T @ slopes, rtol=1e-9)


def test_data_of_unknown_noise_that_no_model_comes_near_are_said_to_be():
    data = resonance(TRUTH, 3, ("displacement_max",))
    free = {"material_damping": (1000.0, 9000.0)}
    for factor, said in ((1.0, False), (1e3, True)):
        one = data.assign(
            displacement_max=(data.displacement_max.dims, factor * data["displacement_max"].values)
        )
        unknown = gearlib.fit(TRUTH, one, free, starts=0).unknown
        assert any("whose noise is not known" in one for one in unknown) == said


def test_each_side_of_a_jump_has_its_own_branch():
    data = resonance(TRUTH, 2)
    one = BranchStatistics(data, TRUTH)
    assert len(one.branches) == 4 and set(one.jumps) == {"jump_up", "jump_down"}
    # What is drawn of the model does not hang on the noise that was said, and is what was measured.
    bare = data.copy()
    for name in one.names:
        bare[name] = bare[name].assign_attrs(noise_std=0.0)
    for shown, own in zip(
        one.curves(TRUTH), BranchStatistics(bare, TRUTH).curves(TRUTH), strict=True
    ):
        (values, fitted), (_, same) = shown.heights, own.heights
        np.testing.assert_allclose(same, fitted, rtol=1e-12)
        assert np.sqrt(np.mean((fitted - values) ** 2)) < 0.05 * np.ptp(values)
    # A model that jumps some points later is no large difference at any point.
    near = TRUTH.replace(reduced_mass=1.02 * TRUTH.reduced_mass)
    rest = one.residuals(near, ())[0].reshape(2, -1)
    pixels = resonance(near, 0)
    for i, name in enumerate(one.names):
        far = [
            np.interp(data.speed[k], pixels.speed[k], pixels[name][k]) - data[name][k]
            for k in (slice(0, COUNT), slice(COUNT, None))
        ]
        assert np.abs(rest[i]).max() < 0.5 * np.abs(far).max() / data[name].noise_std


def test_onset_of_contact_loss_is_a_grazing():
    pair = TRUTH.replace(material_damping=7e3, backlash_damping=7e3)
    speed, names = pair.speed(0.83), ("reduced_mass", "material_damping", "stiffness_ratio", "load")

    def onset(pair, names=()):
        data = {"onset_of_contact_loss": xr.DataArray(speed, attrs={"noise_std": 1.0})}
        rest, moved = Speeds(data).residuals(pair, names)
        return float(rest[0]) + speed, moved[0] if names else None

    place, slopes = onset(pair, names)
    least = [
        gearlib.simulate(pair, factor * place / pair.speed(1.0), periods=4000, record_periods=1)
        for factor in (1.0 - 1e-4, 1.0 + 1e-4)
    ]
    assert [int(run.fraction_backlash > 0.0) for run in least] == [0, 1]
    for name, slope in zip(names, slopes, strict=True):
        step = 1e-4 * getattr(pair, name)
        ends = [onset(pair.replace(**{name: getattr(pair, name) + k * step}))[0] for k in (1, -1)]
        own = (ends[0] - ends[1]) / (2.0 * step)
        assert abs(own - slope) < 1e-5 * (abs(slope) + 1e-3 * place / getattr(pair, name)), name


JUMPS = ("jump_up", "jump_down")


def test_folds_that_are_followed_are_those_that_are_searched():
    names = ("reduced_mass", "material_damping", "stiffness_ratio", "load", "backlash")
    resonance = Resonance(TRUTH)
    rows = {name: float(TRUTH.speed(getattr(resonance, name)[2])) for name in JUMPS}
    one = Speeds({name: xr.DataArray(x, attrs={"noise_std": 1.0}) for name, x in rows.items()})
    followed, searched = one._followed(TRUTH, names), one._searched(TRUTH, names)
    sizes = np.array([getattr(TRUTH, name) for name in names])
    for name in JUMPS:
        (speed, slopes), (own, others) = followed[name], searched[name]
        assert own == pytest.approx(speed, rel=1e-9) == rows[name]
        np.testing.assert_allclose(others * sizes, slopes * sizes, rtol=1e-6, atol=1e-6 * speed)


def test_more_parameters_than_data_are_refused():
    onset = xr.Dataset({"onset_of_contact_loss": ((), TRUTH.speed(0.8), {"noise_std": 1.0})})
    with pytest.raises(ValueError, match="1 observations for 2 parameters; they must be as many"):
        gearlib.fit(
            TRUTH.replace(material_damping=7e3, backlash_damping=7e3),
            onset,
            {name: FREE[name] for name in ("material_damping", "reduced_mass")},
            starts=0,
        )


@pytest.mark.parametrize("name", ["speed", "displacement_max"])
def test_gaps_are_refused(name):
    data = resonance(TRUTH, 1, names=("displacement_max",))
    data[name].values[3] = np.nan
    with pytest.raises(
        ValueError, match=f"^{name} = .*NaN.* not allowed: it must be finite in each"
    ):
        gearlib.fit(TRUTH, data, FREE, starts=0)
