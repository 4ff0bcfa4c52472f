"""Compare the derivatives of `gearlib.sensitivities` with difference quotients in 50 digits."""

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib import periodic_orbit, sensitivities, simulate
from gearlib.analysis.orbits.special_points import GRAZING
from tests.independent import differences
from tests.independent.systems import describe
from tests.properties import known_models as models
from tests.properties.known_models import DAMPED, PAIR_ON_BOTH_FLANKS, MotionCase
from tests.references import StoredReferences

REFERENCES = StoredReferences("sensitivities")
#: Parameters of a pair for which derivatives are compared.
PAIR_PARAMETERS = (
    "contact_ratio",
    "stiffness_ratio",
    "material_damping",
    "backlash_ratio",
    "tuning",
)
UNDAMPED = DAMPED.replace(material_damping=0.0, backlash_damping=0.0)
FOURIER_PAIR = gearlib.OneDegreePair(
    pair=DAMPED, cubic_damping=4e5, cubic_stiffness=2e9, profile=gearlib.Fourier(5)
)
#: A motion of each kind of model, with the parameters for which derivatives are compared.
CASES = {
    "pair": (MotionCase(DAMPED, 0.9, (0.5, -3.0), 12), PAIR_PARAMETERS),
    "undamped": (MotionCase(UNDAMPED, 0.9, (0.3, -2.0), 3), PAIR_PARAMETERS),
    "no backlash": (
        MotionCase(DAMPED.replace(backlash=0.0), 0.8, (0.3, -2.0), 3),
        ("load", "tuning"),
    ),
    "oscillator": (
        MotionCase(models.OSCILLATOR, 0.8, (0.3, -1.0), 3),
        ("upper_stiffness", "damping"),
    ),
    "series": (MotionCase(FOURIER_PAIR, 0.8, (1.0, -5.0), 2), ("cubic_damping", "stiffness_ratio")),
    "deviating": (models.MOTION_CASES["deviating"], ("load", "contact_ratio")),
    "unequal gears": (
        MotionCase(models.GEARS, 0.9, (0.3, -5.0), 2),
        ("inertias[0]", "bearing_stiffness[1]"),
    ),
    "chain": (
        MotionCase(models.CHAIN, 0.7, models.STRIKING, 1),
        ("mass of body idler", "contact_ratio of mesh idler-wheel", "tuning"),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_derivatives_of_runs_match_differences_in_50_digits(name):
    """Derivatives of all variables must agree with the reference within their error estimates."""
    (model, tuning, state, periods), parameters = CASES[name]
    options = {"periods": periods, "initial_state": state, "samples_per_period": 1}

    def compute_variables(model, tuning):
        """Return the compared variables of a run."""
        return simulate(model, tuning, **options)[differences.VARIABLES]

    result = sensitivities(compute_variables, model, parameters, tuning=tuning)
    arguments = describe(model), tuning, periods, state, list(parameters)
    reference_rows = REFERENCES.rows(differences.of_run, *arguments)
    for parameter, row in zip(parameters, reference_rows, strict=True):
        # A row has the derivatives of all variables, one after the other.
        remaining = np.array(row, float)
        for variable in differences.VARIABLES:
            values = result[f"d_{variable}_d_{parameter}"].values.ravel()
            error_estimates = result[f"d_{variable}_d_{parameter}_error"].values.ravel()
            expected, remaining = remaining[: values.size], remaining[values.size :]
            scale = np.abs(expected).max(initial=0.0)
            # Where a derivative is 0, the reference has a rounding error.
            parameter_scale = (
                tuning if parameter == "tuning" else abs(model.value(parameter)) or 1.0
            )
            tolerance = error_estimates.max(initial=0.0) + 1e-12 * scale + 1e-15 / parameter_scale
            assert np.abs(values - expected).max(initial=0.0) <= tolerance, (parameter, variable)


def test_derivatives_of_an_orbit_and_its_multipliers_match_50_digits():
    """Derivatives of state and multipliers of an orbit must agree with the reference."""

    def compute_orbit(model, tuning):
        """Return state and multipliers of a periodic orbit in a single array."""
        result = periodic_orbit(model, tuning, guess=(0.096, -2.833))
        return np.concatenate([result.state, result.multipliers.real, result.multipliers.imag])

    parameters, tuning, period = ("backlash", "material_damping"), 0.88, 1
    result = sensitivities(compute_orbit, PAIR_ON_BOTH_FLANKS, parameters, tuning=tuning)
    # The reference starts its search from a rounded state.
    guess = tuple(compute_orbit(PAIR_ON_BOTH_FLANKS, tuning)[:2].round(6).tolist())
    arguments = describe(PAIR_ON_BOTH_FLANKS), tuning, period, guess, list(parameters)
    reference_rows = REFERENCES.rows(differences.of_orbit, *arguments)
    for parameter, row in zip(parameters, reference_rows, strict=True):
        expected = np.array(row, float)
        difference = np.abs(result[f"d_value_d_{parameter}"].values - expected).max()
        assert difference <= 1e-8 * np.abs(expected).max(), parameter


def test_the_derivative_of_a_run_up_with_respect_to_the_load_matches_the_closed_form():
    """The derivative of the displacement must be displacement / load.

    Without contact loss, the displacement is proportional to the load.
    """

    def largest_displacements(model, start):
        """Return the largest displacement in each revolution of a run-up from a speed, rpm."""
        return gearlib.run_up(model, start, start * 1.2, duration=0.05).displacement_max

    result = sensitivities(largest_displacements, DAMPED, ("load", "start"), start=1000.0)
    run = gearlib.run_up(DAMPED, 1000.0, 1200.0, duration=0.05)
    assert result.d_displacement_max_d_load.attrs["units"] == "m/(N)"
    np.testing.assert_allclose(
        result.d_displacement_max_d_load, run.displacement_max / DAMPED.load, rtol=1e-9
    )
    assert np.isfinite(result.d_displacement_max_d_start).all()


def test_sensitivities_at_a_grazing_warn_that_events_appear_or_vanish():
    """At a grazing orbit, a warning must say that small changes create or remove events."""
    pair = gearlib.GearPair.from_ratios(
        contact_ratio=1.5,
        stiffness_ratio=0.6,
        damping=0.05,
        backlash_damping=0.05,
        backlash_ratio=4,
    )
    branch = gearlib.continue_orbit(periodic_orbit(pair, 0.6), to=1.0)
    grazing_tuning = float(branch.tuning[int(np.flatnonzero(branch.label == GRAZING)[0])])

    def largest_displacement(model, tuning):
        return simulate(model, tuning, periods=400).displacement_max

    with pytest.warns(UserWarning, match="contact events appear or vanish"):
        sensitivities(largest_displacement, pair, "tuning", tuning=grazing_tuning)


def test_a_parameter_at_the_end_of_its_range_gets_a_one_sided_derivative():
    """At the contact ratio 1, the smallest one allowed, the derivative must be taken from above."""

    def final_state(model):
        return simulate(model, 0.6, periods=3).final_state

    pair = DAMPED.replace(contact_ratio=1.0)
    result = sensitivities(final_state, pair, "contact_ratio").d_final_state_d_contact_ratio
    # The one-sided difference quotient of second order is (4 f(h) - f(2 h) - 3 f(0)) / (2 h).
    step = 1e-6
    increment, double_increment = (
        final_state(pair.replace(contact_ratio=1.0 + count * step)) - final_state(pair)
        for count in (1, 2)
    )
    expected = (4.0 * increment - double_increment) / (2.0 * step)
    xr.testing.assert_allclose(result, expected, rtol=1e-5)
