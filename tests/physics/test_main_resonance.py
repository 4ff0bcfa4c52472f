"""Compare quantities of designs near the main resonance with branches, sweeps and closed forms."""

import numpy as np
import pytest
from scipy import stats

import gearlib
from gearlib.analysis.orbits import special_points as special
from gearlib.analysis.orbits.jumps import main_resonance
from gearlib.data.motions import FRACTION_TOLERANCE
from gearlib.uncertainty.designs import ABSENT, FOUND, LOST, QUANTITIES, DesignQuantities
from gearlib.uncertainty.scatter import sobol_indices
from tests.paper import PAPER_PAIR
from tests.properties.known_models import gears_on_bearings

NOMINAL_PAIR = PAPER_PAIR.replace(material_damping=4.5e3, backlash_damping=300.0)
QUANTITY_NAMES = tuple(
    name for name in QUANTITIES if "load_sharing" not in name and name != "dynamic_factor"
)
JUMP_NAMES = ("jump_up", "jump_down")


def planetary_set(error):
    """Return a planetary set whose first pin has the tangential position error `error`, m."""
    pin_errors = [(0.0, error), (0.0, 0.0), (0.0, 0.0)]
    return gearlib.planetary(stiffness_ratio=(0.7, 0.8), pin_errors=pin_errors)


@pytest.fixture(scope="module")
def nominal_search():
    """Return the search for the quantities NAMES around the nominal design DAMPED."""
    return DesignQuantities(NOMINAL_PAIR, QUANTITY_NAMES, speed=float(NOMINAL_PAIR.speed(0.9)))


def test_jumps_onset_and_peak_match_a_whole_branch(nominal_search):
    """Jumps, onset of contact loss and peak of a perturbed design must match its whole branches."""
    factors = {"max_stiffness": 1.02, "contact_ratio": 0.97, "load": 1.03, "backlash": 0.98}
    perturbed = {name: factor * getattr(NOMINAL_PAIR, name) for name, factor in factors.items()}
    model = NOMINAL_PAIR.replace(**perturbed)
    values = dict(zip(QUANTITY_NAMES, nominal_search.evaluate(model)[0], strict=True))
    down = gearlib.continue_orbit(gearlib.periodic_orbit(model, 1.3), to=0.55)
    orbit = gearlib.periodic_orbit(model, 0.75)
    assert orbit.pattern == (1,)  # permanent drive contact
    up = gearlib.continue_orbit(orbit, to=1.0)
    up_folds = np.flatnonzero(up.label.values == special.FOLD)
    down_folds = np.flatnonzero(down.label.values == special.FOLD)
    first_grazing = np.flatnonzero(up.label.values == special.GRAZING)[0]
    # The upward jump is at the first fold with rising tuning, the downward jump at the third fold
    # with falling tuning.
    tunings = up.tuning[up_folds[0]], down.tuning[down_folds[2]], up.tuning[first_grazing]
    for name, tuning in zip((*JUMP_NAMES, "onset_of_contact_loss"), tunings, strict=True):
        assert values[name] == pytest.approx(float(model.speed(tuning)), rel=1e-9), name
    # The largest computed value on a branch is slightly below its maximum.
    displacements = down.displacement_max.values[: down_folds[0] + 1]
    largest_displacement = float(displacements.max()) * model.static_deflection
    assert largest_displacement <= values["peak"] * (1.0 + 1e-12)
    assert values["peak"] < 1.01 * largest_displacement


def test_the_fold_of_a_narrow_hysteresis_is_found():
    """Jump speeds must exist just below the damping at which both jumps merge, but not above it.

    A bisection finds this damping; just below it, the jump tunings differ by less than 1e-3.
    """
    model = PAPER_PAIR.replace(backlash_damping=500.0, backlash=60e-6, stiffness_ratio=0.6)
    low, high = 4e3, 1.4e4
    for _ in range(20):
        damping = 0.5 * (low + high)
        jump = main_resonance(model.replace(material_damping=damping), ("jump_up",)).jump_up
        low, high = (damping, high) if np.isfinite(jump) else (low, damping)
    below = main_resonance(model.replace(material_damping=0.998 * low), JUMP_NAMES)
    assert 0.0 < below.jump_up - below.jump_down < 1e-3
    above = main_resonance(model.replace(material_damping=1.002 * high), JUMP_NAMES)
    assert np.isnan([above.jump_up, above.jump_down]).all() and not above.failed


def test_the_branch_is_followed_to_its_fold_though_the_period_doubles_before():
    """A period doubling on the branch must not end the search for the fold of the downward jump."""
    model = PAPER_PAIR.replace(
        max_stiffness=4.22e8,
        stiffness_ratio=0.5714,
        contact_ratio=1.65,
        reduced_mass=0.1747,
        load=3146.3,
        backlash=266e-6,
    )
    damping_scale = 2.0 * model.reduced_mass * model.mean_eigenfrequency
    model = model.replace(material_damping=0.05 * damping_scale)
    jump_down = main_resonance(model, ("jump_down",)).jump_down
    branch = gearlib.continue_orbit(gearlib.periodic_orbit(model, 1.3), to=0.9 * jump_down)
    labels = branch.label.values
    fold = int(np.flatnonzero(labels == special.FOLD)[0])
    assert (labels[:fold] == special.DOUBLING).any()
    assert branch.tuning.values[fold] == pytest.approx(jump_down, rel=1e-9)


def test_a_design_without_jumps_reports_no_jump_and_the_linear_peak(nominal_search):
    """With strong damping, jumps and onset must be absent, and the peak must match a sweep."""
    model = NOMINAL_PAIR.replace(material_damping=1.1e4)
    values, codes = nominal_search.evaluate(model)
    value_by_name = dict(zip(QUANTITY_NAMES, values, strict=True))
    code_by_name = dict(zip(QUANTITY_NAMES, codes, strict=True))
    for name in (*JUMP_NAMES, "onset_of_contact_loss"):
        assert np.isnan(value_by_name[name]) and code_by_name[name] == ABSENT
    run = gearlib.sweep(model, np.linspace(0.85, 1.05, 81), periods=300, record_periods=1)
    largest_displacement = float(run.displacement_max.max()) * model.static_deflection
    assert code_by_name["peak"] == FOUND
    # The sweep has steps of 0.0025 in the tuning.
    assert value_by_name["peak"] == pytest.approx(largest_displacement, rel=1e-4)


def test_quantities_at_the_duty_point_match_duty_point(nominal_search):
    """Quantities of the nominal design must equal those of `duty_point` at the same speed."""
    values = dict(zip(QUANTITY_NAMES, nominal_search.nominal, strict=True))
    point = gearlib.duty_point(NOMINAL_PAIR, float(NOMINAL_PAIR.speed(0.9)))
    assert values["peak_force_ratio"] == pytest.approx(float(point.peak_force_ratio), rel=1e-9)
    assert values["force"] == pytest.approx(float(point.mesh_force_max), rel=1e-9)
    assert values["transmission_error"] == pytest.approx(float(point.error_peak_to_peak), rel=1e-9)
    # A negative margin means that contact is lost.
    assert values["contact_margin"] < 0.0 < float(point.contact_loss_fraction)


def test_jump_and_onset_of_a_six_degree_model_match_its_branch():
    """Onset and upward jump must lie at the first grazing and the first fold of the branch."""
    model = gears_on_bearings(5e8, material_damping=4.5e3, backlash_damping=300.0)
    names = ("onset_of_contact_loss", *JUMP_NAMES)
    values, codes = DesignQuantities(model, names).evaluate(model)
    low, high = (float(model.tuning_at(rpm)) for rpm in (3900.0, 4200.0))
    up = gearlib.continue_orbit(gearlib.periodic_orbit(model, low), to=high)
    points = [
        np.flatnonzero(up.label.values == label)[0] for label in (special.GRAZING, special.FOLD)
    ]
    assert values[:2] == pytest.approx(model.speed(up.tuning.values[points]), rel=1e-9)
    # The branch with falling tuning cannot be followed beyond a period doubling before the fold.
    assert np.isnan(values[2]) and codes[2] == LOST


def test_a_train_loses_contact_and_jumps_where_a_sweep_does():
    """A sweep must show the loss of contact and the jump between speeds just below and above."""
    train = planetary_set(0.0)
    nominal_search = DesignQuantities(train, ("onset_of_contact_loss", "jump_up"))
    onset, jump = nominal_search.nominal
    # A pin error of either sign unloads a planet, which then loses contact earlier.
    for pin_error in (1e-7, -1e-7):
        (onset_with_error, _), _ = nominal_search.evaluate(planetary_set(pin_error))
        assert onset_with_error < onset
    speeds = [0.9 * onset, onset - 2.0, onset + 2.0, jump - 4.0, jump + 4.0]
    run = gearlib.sweep(train, speeds=speeds, direction="up", periods=1500, record_periods=1)
    loses_contact = (run.fraction_drive < 1.0 - FRACTION_TOLERANCE).any("mesh")
    assert loses_contact.values.tolist() == [False, False, True, True, True]
    peak_to_peak = (run.displacement_max - run.displacement_min).max("mesh").values
    _, _, above_onset, below_jump, above_jump = peak_to_peak
    assert above_jump > 1.3 * below_jump and below_jump < 1.1 * above_onset


def test_sobol_indices_of_a_quotient_match_its_moments():
    """Sobol' indices of the quotient load / stiffness must follow from the moments of both.

    At constant stiffness, the mesh is at rest with the deflection load / stiffness. The contact
    margin is then a product of two independent variables: load and compliance.
    """
    model = PAPER_PAIR.replace(stiffness_ratio=1.0, material_damping=4e3)
    tolerances = {"load": {"min": 1e3, "max": 6e3}, "max_stiffness": {"min": 2e8, "max": 7.5e8}}
    indices = sobol_indices(model, tolerances, ("contact_margin",), 512, seed=3, speed=3000.0)
    load, stiffness = stats.uniform(1e3, 5e3), stats.uniform(2e8, 5.5e8)
    load_mean, load_square = load.mean(), load.moment(2)
    compliance_mean = stiffness.expect(lambda k: k**-1.0)
    compliance_square = stiffness.expect(lambda k: k**-2.0)
    variance = load_square * compliance_square - (load_mean * compliance_mean) ** 2
    load_index = load.var() * compliance_mean**2 / variance
    stiffness_index = (compliance_square - compliance_mean**2) * load_mean**2 / variance
    first_indices = indices.first_index.values[0]
    total_indices = indices.total_index.values[0]
    # The tolerance allows for the sampling error of 512 designs.
    assert first_indices == pytest.approx((load_index, stiffness_index), abs=0.02)
    assert total_indices == pytest.approx([1.0 - stiffness_index, 1.0 - load_index], abs=0.02)
    lower_bounds, upper_bounds = indices.first_index_interval.values[0].T
    assert ((lower_bounds < first_indices) & (first_indices < upper_bounds)).all()
    assert int(indices.missing_designs[0]) == 0
