"""The main resonance, quantities of designs, Sobol' indices: against branches, sweeps, moments."""

import numpy as np
import pytest
from scipy import stats

import gearlib
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.data.motions import FRACTION_TOLERANCE
from gearlib.uncertainty.designs import ABSENT, FOUND, LOST, QUANTITIES, DesignQuantities
from gearlib.uncertainty.scatter import sobol_indices
from tests.paper import PAPER
from tests.properties.known_models import gears

DAMPED = PAPER.replace(material_damping=4.5e3, backlash_damping=300.0)
NAMES = tuple(
    name for name in QUANTITIES if "load_sharing" not in name and name != "dynamic_factor"
)
JUMPS = ("jump_up", "jump_down")


def planetary_set(error):
    """Return a planetary set with a tangential error of its first pin, m."""
    errors = [(0.0, error), (0.0, 0.0), (0.0, 0.0)]
    return gearlib.planetary(stiffness_ratio=(0.7, 0.8), pin_errors=errors)


@pytest.fixture(scope="module")
def search():
    return DesignQuantities(DAMPED, NAMES, speed=float(DAMPED.speed(0.9)))


def test_jumps_onset_and_peak_match_a_whole_branch(search):
    # Numbers of the design are a little off.
    changes = {"max_stiffness": 1.02, "contact_ratio": 0.97, "load": 1.03, "backlash": 0.98}
    model = DAMPED.replace(**{name: x * getattr(DAMPED, name) for name, x in changes.items()})
    values = dict(zip(NAMES, search.evaluate(model)[0], strict=True))
    down = gearlib.continue_orbit(gearlib.periodic_orbit(model, 1.3), to=0.55)
    orbit = gearlib.periodic_orbit(model, 0.75)
    assert orbit.pattern == (1,)
    up = gearlib.continue_orbit(orbit, to=1.0)
    first = [np.flatnonzero(branch.label.values == special.FOLD)[0] for branch in (up, down)]
    touch = np.flatnonzero(up.label.values == special.GRAZING)[0]
    # The motion jumps up at the first fold of the branch from above, and falls at the next but one.
    last = np.flatnonzero(down.label.values == special.FOLD)[2]
    places = up.tuning[first[0]], down.tuning[last], up.tuning[touch]
    for name, place in zip((*JUMPS, "onset_of_contact_loss"), places, strict=True):
        assert values[name] == pytest.approx(float(model.speed(place)), rel=1e-9), name
    # Of points of a curve the highest is a little lower than its top.
    before = down.displacement_max.values[: first[1] + 1]
    top = float(before.max()) * model.static_deflection
    assert top <= values["peak"] * (1.0 + 1e-12) and values["peak"] < 1.01 * top


def test_the_fold_of_a_narrow_hysteresis_is_found():
    # Just below the damping at which both jumps meet: 0.3 rpm apart.
    model = PAPER.replace(backlash_damping=500.0, backlash=60e-6, stiffness_ratio=0.6)
    low, high = 4e3, 1.4e4
    for _ in range(20):
        damping = 0.5 * (low + high)
        jump = main_resonance(model.replace(material_damping=damping), ("jump_up",)).jump_up
        low, high = (damping, high) if np.isfinite(jump) else (low, damping)
    below = main_resonance(model.replace(material_damping=0.998 * low), JUMPS)
    assert 0.0 < below.jump_up - below.jump_down < 1e-3
    above = main_resonance(model.replace(material_damping=1.002 * high), JUMPS)
    assert np.isnan([above.jump_up, above.jump_down]).all() and not above.failed


def test_the_branch_is_followed_to_its_fold_though_the_period_doubles_before():
    model = PAPER.replace(
        max_stiffness=4.22e8,
        stiffness_ratio=0.5714,
        contact_ratio=1.65,
        reduced_mass=0.1747,
        load=3146.3,
        backlash=266e-6,
    )
    unit = 2.0 * model.reduced_mass * model.mean_eigenfrequency
    model = model.replace(material_damping=0.05 * unit)
    fall = main_resonance(model, ("jump_down",)).jump_down
    branch = gearlib.continue_orbit(gearlib.periodic_orbit(model, 1.3), to=0.9 * fall)
    labels = branch.label.values
    fold = int(np.flatnonzero(labels == special.FOLD)[0])
    assert (labels[:fold] == special.DOUBLING).any()
    assert branch.tuning.values[fold] == pytest.approx(fall, rel=1e-9)


def test_a_design_without_jumps_reports_no_jump_and_the_linear_peak(search):
    model = DAMPED.replace(material_damping=1.1e4)
    results = dict(zip(NAMES, zip(*search.evaluate(model), strict=True), strict=True))
    for name in (*JUMPS, "onset_of_contact_loss"):
        assert np.isnan(results[name][0]) and results[name][1] == ABSENT
    peak, code = results["peak"]
    run = gearlib.sweep(model, np.linspace(0.85, 1.05, 81), periods=300, record_periods=1)
    top = float(run.displacement_max.max()) * model.static_deflection
    assert code == FOUND and peak == pytest.approx(top, rel=1e-4)


def test_quantities_at_the_duty_point_match_duty_point(search):
    values = dict(zip(NAMES, search.nominal, strict=True))
    point = gearlib.duty_point(DAMPED, float(DAMPED.speed(0.9)))
    assert values["peak_force_ratio"] == pytest.approx(float(point.peak_force_ratio), rel=1e-9)
    assert values["force"] == pytest.approx(float(point.mesh_force_max), rel=1e-9)
    assert values["transmission_error"] == pytest.approx(float(point.error_peak_to_peak), rel=1e-9)
    assert values["contact_margin"] < 0.0 < float(point.contact_loss_fraction)


def test_jump_and_onset_of_a_six_degree_model_match_its_branch():
    model = gears(5e8, material=4.5e3, oil=300.0)
    names = ("onset_of_contact_loss", *JUMPS)
    values, codes = DesignQuantities(model, names).evaluate(model)
    low, high = (float(model.tuning_at(rpm)) for rpm in (3900.0, 4200.0))
    up = gearlib.continue_orbit(gearlib.periodic_orbit(model, low), to=high)
    places = [
        np.flatnonzero(up.label.values == label)[0] for label in (special.GRAZING, special.FOLD)
    ]
    assert values[:2] == pytest.approx(model.speed(up.tuning.values[places]), rel=1e-9)
    # On the way down the period doubles before the fold.
    assert np.isnan(values[2]) and codes[2] == LOST


def test_a_train_loses_contact_and_jumps_where_a_sweep_does():
    train = planetary_set(0.0)
    search = DesignQuantities(train, ("onset_of_contact_loss", "jump_up"))
    onset, jump = search.nominal
    # An error of either sign loads a planet less.
    for sign in (1.0, -1.0):
        assert search.evaluate(planetary_set(sign * 1e-7))[0][0] < onset
    speeds = [0.9 * onset, onset - 2.0, onset + 2.0, jump - 4.0, jump + 4.0]
    run = gearlib.sweep(train, speeds=speeds, direction="up", periods=1500, record_periods=1)
    lost = (run.fraction_drive < 1.0 - FRACTION_TOLERANCE).any("mesh")
    assert lost.values.tolist() == [False, False, True, True, True]
    height = (run.displacement_max - run.displacement_min).max("mesh").values
    assert height[4] > 1.3 * height[3] and height[3] < 1.1 * height[2]


def test_sobol_indices_of_a_quotient_match_its_moments():
    # At constant stiffness the mesh rests at load / stiffness: indices of a product, by moments.
    model = PAPER.replace(stiffness_ratio=1.0, material_damping=4e3)
    tolerances = {"load": {"min": 1e3, "max": 6e3}, "max_stiffness": {"min": 2e8, "max": 7.5e8}}
    indices = sobol_indices(model, tolerances, ("contact_margin",), 512, seed=3, speed=3000.0)
    load, stiffness = stats.uniform(1e3, 5e3), stats.uniform(2e8, 5.5e8)
    mean, square = load.mean(), load.moment(2)
    other, inverse = (stiffness.expect(lambda x, n=n: x**-n) for n in (1.0, 2.0))
    variance = square * inverse - (mean * other) ** 2
    parts = (square - mean**2) * other**2, (inverse - other**2) * mean**2
    first, second = (part / variance for part in parts)
    index = indices.first_index.values[0]
    # Of 512 designs.
    assert index == pytest.approx((first, second), abs=0.02)
    assert indices.total_index.values[0] == pytest.approx([1.0 - second, 1.0 - first], abs=0.02)
    low, high = indices.first_index_interval.values[0].T
    assert ((low < index) & (index < high)).all()
    assert int(indices.missing_designs[0]) == 0
