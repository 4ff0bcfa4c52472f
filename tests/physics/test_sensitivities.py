"""`sensitivities` of every kind of model against differences in 50 digits."""

import numpy as np
import pytest
import xarray as xr

import gearlib
from gearlib import periodic_orbit, sensitivities, simulate
from gearlib.analysis.orbits.special_points import GRAZING
from tests.independent import differences
from tests.independent.systems import describe
from tests.properties import known_models as models
from tests.properties.known_models import DAMPED, OTHER, Known
from tests.references import StoredReferences

REFERENCES = StoredReferences("sensitivities")
#: Parameters of a pair whose derivatives are compared.
FULL = ("contact_ratio", "stiffness_ratio", "material_damping", "backlash_ratio", "tuning")
UNDAMPED = DAMPED.replace(material_damping=0.0, backlash_damping=0.0)
SERIES = gearlib.OneDegreePair(
    pair=DAMPED, cubic_damping=4e5, cubic_stiffness=2e9, profile=gearlib.Fourier(5)
)
CASES = {
    "pair": (Known(DAMPED, 0.9, (0.5, -3.0), 12), FULL),
    "undamped": (Known(UNDAMPED, 0.9, (0.3, -2.0), 3), FULL),
    "no backlash": (Known(DAMPED.replace(backlash=0.0), 0.8, (0.3, -2.0), 3), ("load", "tuning")),
    "oscillator": (Known(models.OSCILLATOR, 0.8, (0.3, -1.0), 3), ("upper_stiffness", "damping")),
    "series": (Known(SERIES, 0.8, (1.0, -5.0), 2), ("cubic_damping", "stiffness_ratio")),
    "deviating": (models.KNOWN["deviating"], ("load", "contact_ratio")),
    "unequal gears": (
        Known(models.GEARS, 0.9, (0.3, -5.0), 2),
        ("inertias[0]", "bearing_stiffness[1]"),
    ),
    "chain": (
        Known(models.CHAIN, 0.7, models.STRIKING, 1),
        ("mass of body idler", "contact_ratio of mesh idler-wheel", "tuning"),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_derivatives_of_runs_match_differences_in_50_digits(name):
    """Compare derivatives of each variable of a run with differences of a code in 50 digits."""
    (model, tuning, state, periods), names = CASES[name]
    options = {"periods": periods, "initial_state": state, "samples_per_period": 1}

    def variables(model, tuning):
        """Return the compared variables of a run."""
        return simulate(model, tuning, **options)[differences.VARIABLES]

    result = sensitivities(variables, model, names, tuning=tuning)
    rows = REFERENCES.rows(differences.of_run, describe(model), tuning, periods, state, list(names))
    for parameter, remaining_values in zip(names, rows, strict=True):
        remaining_values = np.array(remaining_values, float)
        for variable in differences.VARIABLES:
            values = result[f"d_{variable}_d_{parameter}"].values.ravel()
            errors = result[f"d_{variable}_d_{parameter}_error"].values.ravel()
            # A row holds the derivatives of all variables, one after the other.
            reference_values, remaining_values = (
                remaining_values[: values.size],
                remaining_values[values.size :],
            )
            scale = np.abs(reference_values).max(initial=0.0)
            estimate = errors.max(initial=0.0)
            # A derivative that is exactly zero is rounding in the reference.
            step = tuning if parameter == "tuning" else abs(model.value(parameter)) or 1.0
            room = estimate + 1e-12 * scale + 1e-15 / step
            assert np.abs(values - reference_values).max(initial=0.0) <= room, (parameter, variable)


def test_derivatives_of_an_orbit_and_its_multipliers_match_50_digits():
    """Compare derivatives of state and multipliers of an orbit with differences in 50 digits."""

    def orbit(model, tuning):
        """Return state and multipliers of the periodic orbit as a single array."""
        result = periodic_orbit(model, tuning, guess=(0.096, -2.833))
        return np.concatenate([result.state, result.multipliers.real, result.multipliers.imag])

    names = ("backlash", "material_damping")
    result = sensitivities(orbit, OTHER, names, tuning=0.88)
    start = tuple(orbit(OTHER, 0.88)[:2].round(6).tolist())
    reference_rows = REFERENCES.rows(
        differences.of_orbit, describe(OTHER), 0.88, 1, start, list(names)
    )
    for name, reference_row in zip(names, reference_rows, strict=True):
        reference_values = np.array(reference_row, float)
        difference = np.abs(result[f"d_value_d_{name}"].values - reference_values).max()
        assert difference <= 1e-8 * np.abs(reference_values).max(), name


def test_the_derivative_of_a_run_up_with_respect_to_the_load_matches_the_closed_form():
    """The displacement of a linear run-up must have the derivative displacement / load."""

    # Without contact loss the displacement is proportional to the load, so that its derivative is
    # the displacement divided by the load.
    def largest_displacements(model, start):
        return gearlib.run_up(model, start, start * 1.2, duration=0.05).displacement_max

    result = sensitivities(largest_displacements, DAMPED, ("load", "start"), start=1000.0)
    run = gearlib.run_up(DAMPED, 1000.0, 1200.0, duration=0.05)
    assert result.d_displacement_max_d_load.attrs["units"] == "m/(N)"
    np.testing.assert_allclose(
        result.d_displacement_max_d_load, run.displacement_max / DAMPED.load, rtol=1e-9
    )
    assert np.isfinite(result.d_displacement_max_d_start).all()


def test_sensitivities_at_a_grazing_warn_that_events_appear_or_vanish():
    """At the tuning of a grazing a small change creates or removes contact events."""
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
    """At the lowest contact ratio, 1, the derivative must be taken from above."""

    def final_state(model):
        return simulate(model, 0.6, periods=3).final_state

    pair = DAMPED.replace(contact_ratio=1.0)
    result = sensitivities(final_state, pair, "contact_ratio").d_final_state_d_contact_ratio
    # The expected value is the one-sided difference quotient of second order.
    increments = [
        final_state(pair.replace(contact_ratio=1.0 + step)) - final_state(pair)
        for step in (1e-6, 2e-6)
    ]
    one_sided_quotient = (4.0 * increments[0] - increments[1]) / 2e-6
    xr.testing.assert_allclose(result, one_sided_quotient, rtol=1e-5)
