"""Fit models to synthetic run-ups, jumps and orbits, whose true parameters are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.uncertainty import observation
from gearlib.uncertainty.observations import split_variable_names
from gearlib.uncertainty.synthetic_rigs import synthetic_rig
from tests.paper import PAPER_PAIR

TRUE_PAIR = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
PARAMETER_BOUNDS = {
    "material_damping": (1000.0, 9000.0),
    "reduced_mass": (2.6, 3.7),
    "contact_ratio": (1.4, 1.75),
}
#: Names of parameters of `planetary_set`.
SUN_MESH_STIFFNESS, PIN_OFFSET = "max_stiffness of mesh sun 1", "offset of body planet 1, y"


def speed_course(pair):
    """Return a speed course, (s, rpm), up through the resonance in half a second and down again."""
    low_speed, high_speed = pair.speed(0.6), pair.speed(1.0)
    return [(0.0, low_speed), (0.5, high_speed), (1.0, low_speed)]


def test_a_fit_without_coast_contact_reports_a_lower_bound_of_the_backlash():
    """If the coast flank is never touched, the backlash must be at least the largest separation."""
    data = synthetic_rig(TRUE_PAIR, speed_course(TRUE_PAIR), seed=3)
    free = {"material_damping": (1000.0, 9000.0), "backlash": (1e-5, 9e-5)}
    fit = gearlib.fit(TRUE_PAIR.replace(backlash=6e-5), data, free)
    (sentence,) = fit.unknown
    assert sentence.startswith("backlash is not identifiable: the coast side is never in contact")
    bound = float(sentence.split("at least ")[1].split(" m")[0])
    run = gearlib.run_up(TRUE_PAIR, speed=speed_course(TRUE_PAIR))
    # The bound omits the revolutions in which the motion jumps, whose separation is larger.
    assert 0.7 * bound < -float(run.displacement_min.min()) and bound < 1.01 * TRUE_PAIR.backlash
    assert not fit.params["backlash"].identifiable and "not known" in str(fit)
    assert fit.params["material_damping"].identifiable


def test_a_fit_with_coast_contact_recovers_the_backlash():
    """If both flanks are touched, the fitted backlash must agree within five standard errors."""
    truth = TRUE_PAIR.replace(backlash=1e-5)
    data = synthetic_rig(truth, speed_course(truth), seed=0)
    fit = gearlib.fit(truth.replace(backlash=1.2e-5), data, {"backlash": (2e-6, 6e-5)})
    backlash = fit.params["backlash"]
    assert backlash.identifiable
    assert abs(backlash.value - truth.backlash) < 5.0 * backlash.stderr < 1e-7


def jump_speeds(pair):
    """Return a dataset of the jump speeds of downward and upward sweeps, with noise of 1 rpm.

    The speeds are exact: jumps occur at the folds of the branch of periodic orbits.
    """
    branch = gearlib.continue_orbit(gearlib.periodic_orbit(pair, 1.1), to=0.6)
    fold_tunings = np.sort(branch.tuning.values[branch.label.values == FOLD])
    jump_down_speed, jump_up_speed = fold_tunings * pair.speed(1.0)
    attrs = {"units": "min-1", "noise_std": 1.0}
    return xr.Dataset(
        {"jump_down": ((), jump_down_speed, attrs), "jump_up": ((), jump_up_speed, attrs)}
    )


def test_two_jump_speeds_determine_two_parameters():
    """A fit of two parameters to two exact jump speeds must return the true values."""
    free = {name: PARAMETER_BOUNDS[name] for name in ("material_damping", "reduced_mass")}
    guess = TRUE_PAIR.replace(reduced_mass=3.05, material_damping=4200.0)
    fit = gearlib.fit(guess, jump_speeds(TRUE_PAIR), free)
    for name, parameter in fit.params.items():
        # With as many data as parameters, the fit has no residuals.
        assert parameter.value == pytest.approx(getattr(TRUE_PAIR, name), rel=1e-6), name
    assert "[[Variables]]" in str(fit) and fit.ndata == 2


def planetary_set(**options):
    """Return a planetary set whose first pin has a tangential error of 10 um.

    `options` are further arguments of `gearlib.planetary`.
    """
    pin_errors = (0.0, 1e-5), (0.0, 0.0), (0.0, 0.0)
    train = gearlib.planetary(stiffness_ratio=(0.6, 0.7), pin_errors=pin_errors, **options)
    # The reference frequency must not change with fitted parameters.
    return train.replace(reference_frequency=train.reference_angular_frequency / (2.0 * np.pi))


def noisy_orbit(model, speed, names):
    """Return a dataset of quantities of the periodic orbit at a speed (rpm), with 0.3 % noise.

    The names are variables of measured data, such as "load_sharing_sun_1".
    """
    rng = np.random.default_rng(5)
    samples = observation.SAMPLES_PER_PERIOD
    orbit = observation.orbit_quantities(model, speed, guess=None, samples_per_period=samples)
    data = xr.Dataset(coords={"speed": ("sample", [speed])})
    for name, (quantity, mesh) in split_variable_names(model, names).items():
        value = observation.mesh_quantity(orbit, quantity, mesh)
        attrs = {"noise_std": 0.003 * abs(value)}
        data[name] = "sample", value + rng.normal(0.0, attrs["noise_std"], 1), attrs
    return data


def test_load_sharing_and_orders_determine_a_stiffness_and_a_pin_error():
    """Fit the stiffness of a sun mesh and a pin error to quantities of a noisy orbit.

    The true values must lie within five standard errors and in the reported intervals.
    """
    # Ring and carrier have rigid bearings.
    truth = planetary_set(support_stiffness=(1e8, math.inf, math.inf, 1e8))
    names = [*(f"load_sharing_sun_{i}" for i in (1, 2, 3)), "order_amplitude_1_sun_1"]
    guess = truth.with_values({SUN_MESH_STIFFNESS: 5.5e8, PIN_OFFSET: 0.0})
    free = {SUN_MESH_STIFFNESS: (4e8, 1e9), PIN_OFFSET: (-3e-5, 3e-5)}
    fit = gearlib.fit(guess, noisy_orbit(truth, 2500.0, names), free)
    assert fit.ndata == 4 and fit.redchi < 2.6 and not fit.unknown
    for name, parameter in fit.params.items():
        assert abs(parameter.value - truth.value(name)) < 5.0 * parameter.stderr, name
        low, high = parameter.interval
        assert low <= truth.value(name) <= high, name
    # The errors must be small compared with the pin error of 10 um and the stiffness of 6.6e8 N/m.
    assert fit.params[PIN_OFFSET].stderr < 2e-6 and fit.params[SUN_MESH_STIFFNESS].stderr < 2e7


def test_every_settable_parameter_reads_back_the_value_set():
    """Setting any parameter by name to its current value must leave the model unchanged."""
    # If x and y have different values, there is no name for both.
    train = planetary_set().with_values({"support_damping of body sun, y": 7.0})
    assert "support_damping of body sun" not in train.settable
    # If a support is rigid along x, the name without an axis refers to y.
    guided_train = gearlib.split_power_reducer(TRUE_PAIR)
    support = {"support_stiffness": (math.inf, 1e8), "support_damping": (0.0, 500.0)}
    body = replace(guided_train.bodies[0], mass=3.0, **support)
    guided_train = guided_train.replace(bodies=(body, *guided_train.bodies[1:]))
    assert guided_train.value(f"support_damping of body {body.name}") == 500.0
    for model in (train, guided_train):
        for name in model.settable:
            value = model.value(name)
            copy = model.with_values({name: value})
            assert copy.value(name) == value and copy == model, name
    changed = train.with_values({"support_stiffness of body sun": 2e8, "error of mesh sun 2": 1e-6})
    assert changed.by_name["sun"].support_stiffness == (2e8, 2e8)
    assert [changed.value(f"error of mesh sun {i}") for i in (1, 2)] == [0.0, 1e-6]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"free": {"contact_ratio": (1.5, 2.5)}}, "contact_ratio = 2.5"),
        ({"data": xr.Dataset()}, "it must have a displacement over time, one of"),
        ({"free": PARAMETER_BOUNDS}, "2 observations for 3 parameters, and must have at least"),
    ],
)
def test_a_fit_without_usable_data_or_parameters_is_refused_in_one_sentence(changes, message):
    """A fit must refuse unusable data or bounds in one line that names the cause."""
    arguments = {"model": TRUE_PAIR, "data": jump_speeds(TRUE_PAIR)}
    arguments["free"] = {"reduced_mass": PARAMETER_BOUNDS["reduced_mass"]}
    with pytest.raises(ValueError, match="not allowed") as refusal:
        gearlib.fit(**arguments | changes)
    assert message in str(refusal.value) and "\n" not in str(refusal.value)
