"""`sensitivities` of every kind of model against differences in 50 digits, and its limits."""

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
from tests.references import Stored

REFERENCES = Stored("sensitivities")
#: Variables of a run in the order in which the references have them.
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
    (model, tuning, state, periods), names = CASES[name]
    options = {"periods": periods, "initial_state": state, "samples_per_period": 1}

    def variables(model, tuning):
        return simulate(model, tuning, **options)[differences.VARIABLES]

    result = sensitivities(variables, model, names, tuning=tuning)
    rows = REFERENCES.rows(differences.of_run, describe(model), tuning, periods, state, list(names))
    for parameter, row in zip(names, rows, strict=True):
        row = np.array(row, float)
        for variable in differences.VARIABLES:
            values, errors = (
                result[f"d_{variable}_d_{parameter}{end}"].values.ravel() for end in ("", "_error")
            )
            expected, row = row[: values.size], row[values.size :]
            size = np.abs(expected).max(initial=0.0)
            estimate = errors.max(initial=0.0)
            # Zero in exact numbers is rounding in the reference.
            step = tuning if parameter == "tuning" else abs(model.value(parameter)) or 1.0
            room = estimate + 1e-12 * size + 1e-15 / step
            assert np.abs(values - expected).max(initial=0.0) <= room, (parameter, variable)


def test_derivatives_of_an_orbit_and_its_multipliers_match_50_digits():
    def orbit(model, tuning):
        result = periodic_orbit(model, tuning, guess=(0.096, -2.833))
        return np.concatenate([result.state, result.multipliers.real, result.multipliers.imag])

    names = ("backlash", "material_damping")
    result = sensitivities(orbit, OTHER, names, tuning=0.88)
    start = tuple(orbit(OTHER, 0.88)[:2].round(6).tolist())
    rows = REFERENCES.rows(differences.of_orbit, describe(OTHER), 0.88, 1, start, list(names))
    for name, row in zip(names, rows, strict=True):
        expected = np.array(row, float)
        difference = np.abs(result[f"d_value_d_{name}"].values - expected).max()
        assert difference <= 1e-8 * np.abs(expected).max(), name


def test_the_derivative_of_a_run_up_with_respect_to_the_load_matches_the_closed_form():
    # Without contact loss the displacement is proportional to the load.
    def largest(model, start):
        return gearlib.run_up(model, start, start * 1.2, duration=0.05).displacement_max

    result = sensitivities(largest, DAMPED, ("load", "start"), start=1000.0)
    run = gearlib.run_up(DAMPED, 1000.0, 1200.0, duration=0.05)
    assert result.d_displacement_max_d_load.attrs["units"] == "m/(N)"
    np.testing.assert_allclose(
        result.d_displacement_max_d_load, run.displacement_max / DAMPED.load, rtol=1e-9
    )
    assert np.isfinite(result.d_displacement_max_d_start).all()


def test_sensitivities_at_a_grazing_warn_that_events_appear_or_vanish():
    pair = gearlib.GearPair.from_ratios(
        contact_ratio=1.5,
        stiffness_ratio=0.6,
        damping=0.05,
        backlash_damping=0.05,
        backlash_ratio=4,
    )
    orbit = gearlib.continue_orbit(periodic_orbit(pair, 0.6), to=1.0)
    grazing = float(orbit.tuning[int(np.flatnonzero(orbit.label == GRAZING)[0])])

    def largest(model, tuning):
        return simulate(model, tuning, periods=400).displacement_max

    with pytest.warns(UserWarning, match="contact events appear or vanish"):
        sensitivities(largest, pair, "tuning", tuning=grazing)


def test_a_parameter_at_the_end_of_its_range_gets_a_one_sided_derivative():
    def last(model):
        return simulate(model, 0.6, periods=3).final_state

    pair = DAMPED.replace(contact_ratio=1.0)
    result = sensitivities(last, pair, "contact_ratio").d_final_state_d_contact_ratio
    near = [last(pair.replace(contact_ratio=1.0 + h)) - last(pair) for h in (1e-6, 2e-6)]
    expected = (4.0 * near[0] - near[1]) / 2e-6
    xr.testing.assert_allclose(result, expected, rtol=1e-5)
