"""Fit models to synthetic slow sweeps: statistics over speed, jumps, onset of contact loss."""

import math

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib.uncertainty.observation import resonance_speeds
from gearlib.uncertainty.observations import make_observations
from tests.paper import PAPER_PAIR
from tests.properties.known_models import gears_on_bearings

TRUE_PAIR = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
PARAMETER_BOUNDS = {
    "material_damping": (1000.0, 9000.0),
    "reduced_mass": (2.6, 3.7),
    "load": (2e3, 5e3),
}
MAXIMUM_ONLY = ("displacement_max",)


def measured_resonance(
    pair, seed, names=(*MAXIMUM_ONLY, "contact_loss_fraction"), gain=1.0, count=11
):
    """Return synthetic resonance curves, measured at `count` speeds upwards and downwards.

    Each of the variables `names` has noise of 2 % of its standard deviation, or no noise if `seed`
    is None, and is multiplied by the `gain` of its sensor.
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
        scale = pair.static_deflection if name.startswith("displacement") else 1.0
        values = scale * np.hstack([run[name].values for run in runs])
        noise_std = 0.0 if seed is None else 0.02 * values.std()
        attrs = {"noise_std": gain * noise_std, "unknown_gain": int(gain != 1.0)}
        data[name] = "sample", gain * (values + rng.normal(0.0, noise_std, 2 * count)), attrs
    return data


def test_a_fit_to_exact_curves_of_unknown_noise_recovers_the_damping():
    """A fit to curves without noise must return the damping with which they were computed."""
    # Jump speeds are known to half a step only. If they had the noise scale of the curves, they
    # would change the damping by 12 %.
    guess, bounds = TRUE_PAIR.replace(material_damping=4200.0), PARAMETER_BOUNDS["material_damping"]
    fit = gearlib.fit(guess, measured_resonance(TRUE_PAIR, None), {"material_damping": bounds})
    # The runs settle to about 1e-9, which limits the accuracy of the damping.
    damping = fit.params["material_damping"].value
    assert damping == pytest.approx(TRUE_PAIR.material_damping, rel=1e-7) and not fit.unknown


def test_the_load_is_not_identifiable_with_an_unknown_gain():
    """A fit must report that the load cannot be separated from the unknown gain of the sensor.

    If the coast flank is not touched, displacements are proportional to the load, and fractions of
    time do not depend on it.
    """
    data = measured_resonance(TRUE_PAIR, 1, gain=2.5)
    guess = TRUE_PAIR.replace(reduced_mass=3.1, load=3200.0)
    fit = gearlib.fit(
        guess, data, {name: PARAMETER_BOUNDS[name] for name in ("reduced_mass", "load")}
    )
    assert fit.params["reduced_mass"].identifiable and not fit.params["load"].identifiable
    assert any(sentence.startswith("load is not ident") for sentence in fit.unknown)


def test_a_speed_measured_twice_counts_twice():
    """Repeating all measurements must double the sum of squared residuals."""
    data = measured_resonance(TRUE_PAIR, 3).isel(sample=slice(12))
    residuals = make_observations(TRUE_PAIR, data)[0].residuals(TRUE_PAIR)
    repeated_data = xr.concat([data, data], "sample", combine_attrs="override")
    repeated_residuals = make_observations(TRUE_PAIR, repeated_data)[0].residuals(TRUE_PAIR)
    assert repeated_residuals.size == 2 * residuals.size
    np.testing.assert_allclose(
        repeated_residuals @ repeated_residuals, 2.0 * residuals @ residuals, rtol=1e-9
    )


def test_points_are_compared_with_the_branch_on_their_side_of_the_jump():
    """Each sweep point must be compared with the solution branch on which it lies.

    A model that jumps a few points later must then have no large residuals, in contrast to a
    comparison with its settled motion at the speed of each point.
    """
    speed_count = 21
    data = measured_resonance(TRUE_PAIR, 2, count=speed_count)
    points, jumps = make_observations(TRUE_PAIR, data)
    jump_curves = jumps.make_curves(jumps.predicted_signals(TRUE_PAIR))
    assert {curve.name for curve in jump_curves} == {"jump up", "jump down"}
    for curve in points.make_curves(points.predicted_signals(TRUE_PAIR)):
        measured, predicted = curve.values
        assert np.sqrt(np.mean((predicted - measured) ** 2)) < 0.05 * np.ptp(measured)
    heavier_pair = TRUE_PAIR.replace(reduced_mass=1.02 * TRUE_PAIR.reduced_mass)
    residuals = points.residuals(heavier_pair).reshape(2, -1)
    heavier_curves = measured_resonance(heavier_pair, 0, count=speed_count)
    upward, downward = slice(0, speed_count), slice(speed_count, None)
    for name, branch_residuals in zip(data.data_vars, residuals, strict=True):
        differences_of_motions = [
            np.interp(data.speed[sweep], heavier_curves.speed[sweep], heavier_curves[name][sweep])
            - data[name][sweep]
            for sweep in (upward, downward)
        ]
        largest_difference = np.abs(differences_of_motions).max() / data[name].noise_std
        assert np.abs(branch_residuals).max() < 0.5 * largest_difference


def test_jumps_and_onset_of_gears_on_rigid_bearings_match_their_pair():
    """Jump speeds of gears on rigid bearings must equal those of the pair.

    With rigid bearings, both have the same single degree of freedom.
    """
    # The model with bearings finds jumps by sweeps and branches in all its coordinates.
    model = gears_on_bearings(math.inf, 3953.7, 3953.7)
    tunings = {"jump_down": 0.7, "jump_up": 0.82, "onset_of_contact_loss": 0.8}
    measured = {name: float(model.speed(tuning)) for name, tuning in tunings.items()}
    speeds = resonance_speeds(model, measured)
    pair_speeds = resonance_speeds(model.pair, measured)
    assert speeds == pytest.approx(pair_speeds, rel=1e-11) and speeds.keys() == tunings.keys()


@pytest.mark.parametrize("name", ["speed", "displacement_max"])
def test_missing_values_are_refused(name):
    """A NaN in the measured values must be refused with the name of the variable."""
    data = measured_resonance(TRUE_PAIR, 1, MAXIMUM_ONLY)
    data[name].values[3] = np.nan
    message = f"^{name} = .*NaN.* not allowed: it must be finite in each"
    with pytest.raises(ValueError, match=message):
        gearlib.fit(TRUE_PAIR, data, PARAMETER_BOUNDS)
