"""The main resonance and quantities of designs: against whole branches, sweeps, settled runs."""

import dataclasses

import numpy as np
import pytest

import gearlib
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.data.motions import FRACTION_TOLERANCE
from gearlib.uncertainty.design_quantities import FOUND, LOST, NONE, QUANTITIES, DesignQuantities
from tests.paper import PAPER
from tests.properties.known_models import gears


def pins(error):
    """Return a planetary set with a tangential error of its first pin, m."""
    errors = [(0.0, error), (0.0, 0.0), (0.0, 0.0)]
    return gearlib.planetary(stiffness_ratio=(0.7, 0.8), pin_errors=errors)


DAMPED = PAPER.replace(material_damping=4.5e3, backlash_damping=300.0)
#: The largest motion of the first lies at its fold, that of the second on the way to it.
WIDE = DAMPED.replace(material_damping=7e3, backlash=200e-6)
FIELDS = [one.name for one in dataclasses.fields(PAPER) if one.name != "teeth"]
PAIR_TRAINS = tuple(name for name in QUANTITIES if "load_sharing" not in name)


def drawn(model, share, seed):
    """Return a design whose numbers all scatter by so much."""
    factors = 1.0 + share * np.random.default_rng(seed).standard_normal(len(FIELDS))
    return model.replace(
        **{name: getattr(model, name) * x for name, x in zip(FIELDS, factors, strict=True)}
    )


@pytest.fixture(scope="module")
def searches():
    speed = float(DAMPED.speed(0.9))
    return {model: DesignQuantities(model, PAIR_TRAINS, speed=speed) for model in (DAMPED, WIDE)}


@pytest.mark.parametrize("seed", [3, 4])
def test_jumps_and_onset_are_those_of_a_whole_branch(searches, seed):
    model = drawn(DAMPED, 0.03, seed)
    values = dict(zip(PAIR_TRAINS, searches[DAMPED](model)[0], strict=True))
    down = gearlib.continue_orbit(gearlib.periodic_orbit(model, 1.3), to=0.55)
    orbit = gearlib.periodic_orbit(model, 0.75)
    assert orbit.pattern == (1,)
    up = gearlib.continue_orbit(orbit, to=1.0)
    folds = [np.flatnonzero(one.label.values == special.FOLD)[0] for one in (up, down)]
    touch = np.flatnonzero(up.label.values == special.GRAZING)[0]
    # The motion jumps up at the first fold of the branch from above, and falls at the next but one.
    last = np.flatnonzero(down.label.values == special.FOLD)[2]
    places = up.tuning[folds[0]], down.tuning[last], up.tuning[touch]
    for name, place in zip(("jump_up", "jump_down", "onset_of_contact_loss"), places, strict=True):
        assert values[name] == pytest.approx(float(model.speed(place)), rel=1e-9), name
    # Of points of a curve the highest is a little lower than its top.
    before = down.displacement_max.values[: folds[1] + 1]
    top = float(before.max()) * model.static_deflection
    assert top <= values["peak"] * (1.0 + 1e-12) and values["peak"] < 1.01 * top


@pytest.mark.parametrize("model", [DAMPED, WIDE])
def test_quantities_are_smooth_functions_of_the_design(searches, model):
    search = searches[model]
    for name in FIELDS:
        size = getattr(model, name)
        low, high, near, far = (
            search(model.replace(**{name: (1.0 + share) * size}))[0]
            for share in (-2e-5, 2e-5, -1e-5, 1e-5)
        )
        # Differences over two steps agree, as they do where nothing but rounding is lost.
        slopes = (high - low) / 4e-5, (far - near) / 2e-5
        bound = 1e-6 * np.abs(slopes[1]) + 1e-6 * np.abs(search.nominal)
        assert (np.abs(slopes[0] - slopes[1]) < bound).all(), name


def test_the_fold_of_a_narrow_hysteresis_is_found():
    # Just below the damping at which both jumps meet: 0.3 rpm apart.
    model = PAPER.replace(
        material_damping=9e3, backlash_damping=500.0, backlash=60e-6, stiffness_ratio=0.6
    )
    low, high = 4e3, 1.4e4
    for _ in range(25):
        damping = 0.5 * (low + high)
        found = main_resonance(model.replace(material_damping=damping), ("jump_up",))
        low, high = (damping, high) if np.isfinite(found.jump_up) else (low, damping)
    found = main_resonance(model.replace(material_damping=0.998 * low), ("jump_up", "jump_down"))
    assert 0.0 < found.jump_up - found.jump_down < 1e-3
    found = main_resonance(model.replace(material_damping=1.002 * high), ("jump_up", "jump_down"))
    assert np.isnan([found.jump_up, found.jump_down]).all() and not found.lost


def test_the_branch_is_followed_to_its_fold_though_the_period_doubles_before():
    model = PAPER.replace(
        max_stiffness=4.22e8,
        stiffness_ratio=0.5714,
        contact_ratio=1.65,
        reduced_mass=0.1747,
        load=3146.3,
        backlash=266e-6,
    )
    size = 2.0 * 0.05 * model.reduced_mass * model.mean_eigenfrequency
    model = model.replace(material_damping=size)
    fall = main_resonance(model, ("jump_down",)).jump_down
    branch = gearlib.continue_orbit(gearlib.periodic_orbit(model, 1.3), to=0.9 * fall)
    labels, tunings = branch.label.values, branch.tuning.values
    fold = int(np.flatnonzero(labels == special.FOLD)[0])
    assert (labels[:fold] == special.DOUBLING).any()
    assert tunings[fold] == pytest.approx(fall, rel=1e-9)


def test_the_onset_knows_nothing_of_backlash_and_scales(searches):
    search = searches[DAMPED]
    scale = {"load": 3.0, "backlash": 3.0}
    twin = DAMPED.replace(**{name: getattr(DAMPED, name) * x for name, x in scale.items()})
    ratios = dict(zip(PAIR_TRAINS, search(twin)[0] / search.nominal, strict=True))
    for name in ("jump_up", "jump_down", "onset_of_contact_loss", "dynamic_factor"):
        assert ratios[name] == pytest.approx(1.0, abs=1e-9), name
    for name in ("peak", "force", "transmission_error", "contact_margin"):
        assert ratios[name] == pytest.approx(3.0, rel=1e-9), name
    onset = PAIR_TRAINS.index("onset_of_contact_loss")
    wider = search(DAMPED.replace(backlash=1.1 * DAMPED.backlash))[0]
    assert wider[onset] == search.nominal[onset]


def test_what_has_no_jumps_says_so(searches):
    values, codes = searches[DAMPED](DAMPED.replace(material_damping=1.1e4))
    found = dict(zip(PAIR_TRAINS, zip(values, codes, strict=True), strict=True))
    for name in ("jump_up", "jump_down", "onset_of_contact_loss"):
        assert np.isnan(found[name][0]) and found[name][1] == NONE
    # The linear resonance has a top of its own.
    value, code = found["peak"]
    assert code == FOUND
    model = DAMPED.replace(material_damping=1.1e4)
    run = gearlib.sweep(model, np.linspace(0.85, 1.05, 81), periods=300, record_periods=1)
    assert value == pytest.approx(
        float(run.displacement_max.max()) * model.static_deflection, rel=1e-4
    )


def test_the_duty_point_is_that_of_a_settled_run(searches):
    values = dict(zip(PAIR_TRAINS, searches[DAMPED].nominal, strict=True))
    point = gearlib.duty_point(DAMPED, float(DAMPED.speed(0.9)))
    assert values["dynamic_factor"] == pytest.approx(float(point.dynamic_factor), rel=1e-9)
    assert values["force"] == pytest.approx(float(point.mesh_force_max), rel=1e-9)
    assert values["transmission_error"] == pytest.approx(float(point.error_peak_to_peak), rel=1e-9)
    assert values["contact_margin"] < 0.0 < float(point.lost_share)


def test_a_train_at_a_duty_point():
    train = gearlib.planetary(
        stiffness_ratio=(0.7, 0.8), pin_errors=[(5e-6, 3e-6), (0.0, 0.0), (0.0, 0.0)]
    )
    quantities = ("force", "dynamic_factor", "transmission_error", "contact_margin")
    quantities += ("load_sharing", "least_load_sharing")
    search = DesignQuantities(train, quantities, speed=float(train.speed(0.6)))
    run = gearlib.simulate(
        train, 0.6, periods=800, record_periods=1, initial_state="static", samples_per_period=8
    )
    span = float(run.displacement_max[0] - run.displacement_min[0])
    known = [
        float(run.dynamic_force_max.max()) * train.load,
        float(run.dynamic_factor.max()),
        span * train.static_deflection,
        float(run.displacement_min.min()) * train.static_deflection,
        float(run.load_sharing.max()),
        float(run.load_sharing.min()),
    ]
    # A run of 800 periods still settles.
    assert search.nominal == pytest.approx(known, rel=1e-5)


def test_six_degrees_of_freedom_have_the_special_points_of_their_branch():
    model = gears(5e8, material=4.5e3, oil=300.0)
    search = DesignQuantities(model, ("onset_of_contact_loss", "jump_up", "jump_down"))
    low, high = (float(model.tuning_at(rpm)) for rpm in (3900.0, 4200.0))
    up = gearlib.continue_orbit(gearlib.periodic_orbit(model, low), to=high)
    places = [
        np.flatnonzero(up.label.values == label)[0] for label in (special.GRAZING, special.FOLD)
    ]
    assert search.nominal[:2] == pytest.approx(model.speed(up.tuning.values[places]), rel=1e-9)
    # On the way down the period doubles before the fold.
    values, codes = search(model)
    assert np.isnan(values[2]) and codes[2] == LOST


def test_a_train_loses_contact_and_jumps_where_a_sweep_does():
    train = pins(0.0)
    search = DesignQuantities(train, ("onset_of_contact_loss", "jump_up"))
    onset, jump = search.nominal
    # An error of either sign loads a planet less.
    for sign in (1.0, -1.0):
        assert search(pins(sign * 1e-7))[0][0] < onset
    speeds = [0.9 * onset, onset - 2.0, onset + 2.0, jump - 4.0, jump + 4.0]
    run = gearlib.sweep(train, speeds=speeds, direction="up", periods=1500, record_periods=1)
    lost = (run.fraction_normal < 1.0 - FRACTION_TOLERANCE).any("mesh")
    assert lost.values.tolist() == [False, False, True, True, True]
    height = (run.displacement_max - run.displacement_min).max("mesh").values
    assert height[4] > 1.3 * height[3] and height[3] < 1.1 * height[2]


def test_taylor_steps_find_the_same(searches):
    # Another code: nonlinear damping, so little of it that it changes nothing.
    twin = gearlib.OneDegreePair(pair=DAMPED, cubic_damping=1e-9)
    names = ("jump_up", "jump_down", "onset_of_contact_loss", "peak", "dynamic_factor")
    search = DesignQuantities(twin, names, speed=float(DAMPED.speed(0.9)))
    own = [PAIR_TRAINS.index(name) for name in names]
    assert search.nominal == pytest.approx(searches[DAMPED].nominal[own], rel=1e-8)
