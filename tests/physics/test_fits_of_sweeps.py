"""Fits to slow sweeps of synthetic rigs: statistics over speed, jumps, onset of contact loss."""

import math

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib.uncertainty.observation import resonance_speeds
from gearlib.uncertainty.observations import make_observations
from tests.paper import PAPER_PAIR
from tests.properties.known_models import gears

TRUTH = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
FREE = {"material_damping": (1000.0, 9000.0), "reduced_mass": (2.6, 3.7), "load": (2e3, 5e3)}
HEIGHT = ("displacement_max",)


def resonance(pair, seed, names=(*HEIGHT, "contact_loss_fraction"), gain=1.0, count=11):
    """Return a synthetic resonance curve, measured at `count` speeds up and down.

    Each of the variables `names` has noise of 2 % of its standard deviation, or none if `seed` is
    None, and is multiplied by the `gain` of its sensor.
    """
    rng, tunings = np.random.default_rng(seed), np.linspace(0.6, 1.0, count)
    runs = [
        gearlib.sweep(pair, tunings, periods=300, record_periods=1, direction=direction)
        for direction in ("up", "down")
    ]
    data = xr.Dataset(
        coords={
            "speed": ("sample", np.tile(tunings * pair.speed(1.0), 2)),
            "direction": ("sample", np.repeat([1, -1], count)),
        }
    )
    for name in names:
        scale = {"displacement": pair.static_deflection}.get(name.partition("_")[0], 1.0)
        values = scale * np.hstack([run[name].values for run in runs])
        noise = 0.0 if seed is None else 0.02 * values.std()
        attrs = {"noise_std": gain * noise, "unknown_gain": int(gain != 1.0)}
        data[name] = "sample", gain * (values + rng.normal(0.0, noise, 2 * count)), attrs
    return data


def test_a_fit_to_exact_curves_of_unknown_noise_recovers_the_damping():
    """A fit to curves without noise must return the damping with which they were computed."""
    # Jump speeds are known to half a step only. If they shared one noise scale with the curves,
    # they would change the damping by 12 %.
    guess, bounds = TRUTH.replace(material_damping=4200.0), FREE["material_damping"]
    fit = gearlib.fit(guess, resonance(TRUTH, None), {"material_damping": bounds})
    # The orbits of data and model settle to about 1e-9 of each other.
    damping = fit.params["material_damping"].value
    assert damping == pytest.approx(TRUTH.material_damping, rel=1e-7) and not fit.unknown


def test_the_load_is_not_identifiable_with_an_unknown_gain():
    """A fit must report that load and unknown gain of the sensor cannot be separated."""
    # While the coast flank is not touched, displacements are proportional to the load and fractions
    # of time do not depend on it.
    data = resonance(TRUTH, 1, gain=2.5)
    guess = TRUTH.replace(reduced_mass=3.1, load=3200.0)
    fit = gearlib.fit(guess, data, {name: FREE[name] for name in ("reduced_mass", "load")})
    assert fit.params["reduced_mass"].identifiable and not fit.params["load"].identifiable
    assert any(sentence.startswith("load is not ident") for sentence in fit.unknown)


def test_a_speed_measured_twice_counts_twice():
    """Repeating all measurements must double the sum of squared residuals."""
    once = resonance(TRUTH, 3).isel(sample=slice(12))
    residuals = make_observations(TRUTH, once)[0].residuals(TRUTH)
    twice = xr.concat([once, once], "sample", combine_attrs="override")
    repeated_residuals = make_observations(TRUTH, twice)[0].residuals(TRUTH)
    assert repeated_residuals.size == 2 * residuals.size
    np.testing.assert_allclose(
        repeated_residuals @ repeated_residuals, 2.0 * residuals @ residuals, rtol=1e-9
    )


def test_points_are_compared_with_the_branch_on_their_side_of_the_jump():
    """Residuals of sweep points must refer to the solution branch on which each point lies."""
    data = resonance(TRUTH, 2, count=21)
    points, jumps = make_observations(TRUTH, data)
    drawn_jumps = jumps.make_curves(jumps.predicted_signals(TRUTH))
    assert {jump.name for jump in drawn_jumps} == {"jump up", "jump down"}
    for curve in points.make_curves(points.predicted_signals(TRUTH)):
        values, fitted = curve.values
        assert np.sqrt(np.mean((fitted - values) ** 2)) < 0.05 * np.ptp(values)
    # A model that jumps some points later has no large residual, because each point of the data is
    # compared with the branch that it lies on, not with the settled motion at its speed.
    heavier_pair = TRUTH.replace(reduced_mass=1.02 * TRUTH.reduced_mass)
    residuals = points.residuals(heavier_pair).reshape(2, -1)
    heavier_curves = resonance(heavier_pair, 0, count=21)
    for name, branch_residuals in zip(data.data_vars, residuals, strict=True):
        pointwise_differences = [
            np.interp(data.speed[half], heavier_curves.speed[half], heavier_curves[name][half])
            - data[name][half]
            for half in (slice(0, 21), slice(21, None))
        ]
        largest = np.abs(pointwise_differences).max() / data[name].noise_std
        assert np.abs(branch_residuals).max() < 0.5 * largest


def test_jumps_and_onset_of_gears_on_rigid_bearings_match_their_pair():
    """Jump speeds of gears on rigid bearings must equal those of the one-degree pair.

    Rigid bearings leave the same single degree of freedom.
    """
    # The speeds are searched near the measured ones, by sweeps and branches of all coordinates.
    model = gears(math.inf, 3953.7, 3953.7)
    tunings = {"jump_down": 0.7, "jump_up": 0.82, "onset_of_contact_loss": 0.8}
    measured = {name: float(model.speed(tuning)) for name, tuning in tunings.items()}
    speeds = resonance_speeds(model, measured)
    pair_speeds = resonance_speeds(model.pair, measured)
    assert speeds == pytest.approx(pair_speeds, rel=1e-11) and speeds.keys() == tunings.keys()


@pytest.mark.parametrize("name", ["speed", "displacement_max"])
def test_missing_values_are_refused(name):
    """A NaN among measured values must be refused by the name of its variable."""
    data = resonance(TRUTH, 1, HEIGHT)
    data[name].values[3] = np.nan
    message = f"^{name} = .*NaN.* not allowed: it must be finite in each"
    with pytest.raises(ValueError, match=message):
        gearlib.fit(TRUTH, data, FREE)
