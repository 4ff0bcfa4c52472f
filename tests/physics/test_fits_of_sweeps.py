"""Fits to slow sweeps of synthetic rigs: statistics over speed, jumps, onset of contact loss."""

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib.uncertainty import observation
from gearlib.uncertainty.fits import correlation_sentences
from gearlib.uncertainty.observations import observations_of
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
        scale = {"displacement": pair.static_deflection}.get(name.partition("_")[0], 1.0)
        values = scale * np.hstack([run[name].values for run in runs])
        noise = 0.0 if seed is None else 0.02 * values.std()
        attrs = {"noise_std": gain * noise, "unknown_gain": int(gain != 1.0)}
        data[name] = "sample", gain * (values + rng.normal(0.0, noise, 2 * COUNT)), attrs
    return data


def test_exact_curves_of_unknown_noise_give_the_truth():
    # Jumps are known to half a step only: with one scale for all they would pull damping by 12 %.
    data = resonance(TRUTH, None)
    guess = TRUTH.replace(material_damping=4200.0, reduced_mass=3.1, load=3200.0)
    found = gearlib.fit(guess, data, FREE)
    for name, one in found.params.items():
        # The orbits of data and model settle to some 1e-9 of each other.
        assert one.value == pytest.approx(getattr(TRUTH, name), rel=1e-7), name


def test_load_is_a_scale_that_an_unknown_gain_hides():
    # While the far flank is not struck all lengths go with the load, shares of time do not feel it.
    free = {name: FREE[name] for name in ("reduced_mass", "load")}
    for scale, hidden in ((2.5, True), (1.0, False)):
        data = resonance(TRUTH, 1, gain=scale)
        found = gearlib.fit(TRUTH.replace(reduced_mass=3.1, load=3200.0), data, free)
        assert found.params["reduced_mass"].identifiable
        assert found.params["load"].identifiable != hidden
        assert any(said.startswith("load is not ident") for said in found.unknown) == hidden


def test_a_speed_that_is_measured_twice_has_the_same_motion_twice():
    once = resonance(TRUTH, 3).isel(sample=slice(12))
    residuals = observations_of(TRUTH, once)[0].residuals(TRUTH)
    twice = xr.concat([once, once], "sample", combine_attrs="override")
    both = observations_of(TRUTH, twice)[0].residuals(TRUTH)
    assert both.size == 2 * residuals.size
    np.testing.assert_allclose(both @ both, 2.0 * residuals @ residuals, rtol=1e-9)


def test_data_of_unknown_noise_that_no_model_comes_near_are_said_to_be():
    data = resonance(TRUTH, 3, ("displacement_max",))
    free = {"material_damping": (1000.0, 9000.0)}
    for factor, said in ((1.0, False), (1e3, True)):
        one = data.assign(
            displacement_max=(data.displacement_max.dims, factor * data["displacement_max"].values)
        )
        unknown = gearlib.fit(TRUTH, one, free).unknown
        assert any("whose noise is not known" in one for one in unknown) == said


def test_a_false_alarm_on_independent_residuals_is_rarer_than_one_in_a_hundred():
    channels = observations_of(TRUTH, resonance(TRUTH, None))[0].channels
    rng, size = np.random.default_rng(0), 4 * COUNT
    alarms = [correlation_sentences(channels, rng.normal(size=size)) for _ in range(500)]
    assert sum(map(bool, alarms)) < 5
    assert correlation_sentences(channels, np.sin(0.3 * np.arange(size)))[0].endswith(
        "no interval holds"
    )


def test_each_side_of_a_jump_has_its_own_branch():
    data = resonance(TRUTH, 2)
    points, jumps = observations_of(TRUTH, data)
    places = jumps.draw(jumps.sensed(TRUTH))
    assert {place.name for place in places} == {"jump up", "jump down"}
    for curve in points.draw(points.sensed(TRUTH)):
        values, fitted = curve.heights
        assert np.sqrt(np.mean((fitted - values) ** 2)) < 0.05 * np.ptp(values)
    # A model that jumps some points later is no large difference at any point.
    near = TRUTH.replace(reduced_mass=1.02 * TRUTH.reduced_mass)
    rest = points.residuals(near).reshape(2, -1)
    pixels = resonance(near, 0)
    for i, name in enumerate(data.data_vars):
        far = [
            np.interp(data.speed[k], pixels.speed[k], pixels[name][k]) - data[name][k]
            for k in (slice(0, COUNT), slice(COUNT, None))
        ]
        assert np.abs(rest[i]).max() < 0.5 * np.abs(far).max() / data[name].noise_std


def speeds_of(pair, **speeds):
    """Return the speeds that a fit compares with measured ones, rpm."""
    return [*observation.resonance_speeds(pair, speeds).values()]


def test_onset_of_contact_loss_is_a_grazing():
    pair = TRUTH.replace(material_damping=7e3, backlash_damping=7e3)
    (place,) = speeds_of(pair, onset_of_contact_loss=pair.speed(0.83))
    least = [
        gearlib.simulate(pair, factor * place / pair.speed(1.0), periods=4000, record_periods=1)
        for factor in (1.0 - 1e-4, 1.0 + 1e-4)
    ]
    assert [int(run.fraction_backlash > 0.0) for run in least] == [0, 1]


def test_more_parameters_than_data_are_refused():
    onset = xr.Dataset({"onset_of_contact_loss": ((), TRUTH.speed(0.8), {"noise_std": 1.0})})
    with pytest.raises(ValueError, match="1 observations for 2 parameters; there must be at least"):
        gearlib.fit(
            TRUTH.replace(material_damping=7e3, backlash_damping=7e3),
            onset,
            {name: FREE[name] for name in ("material_damping", "reduced_mass")},
        )


@pytest.mark.parametrize("name", ["speed", "displacement_max"])
def test_gaps_are_refused(name):
    data = resonance(TRUTH, 1, names=("displacement_max",))
    data[name].values[3] = np.nan
    with pytest.raises(
        ValueError, match=f"^{name} = .*NaN.* not allowed: it must be finite in each"
    ):
        gearlib.fit(TRUTH, data, FREE)
