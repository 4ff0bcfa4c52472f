"""Derivatives of piecewise-linear models: those of a `GearPair`, and differences."""

import dataclasses

import numpy as np
import pytest

from gearlib import (
    DeadZoneOscillator,
    GearPair,
    Harmonics,
    OneDegreePair,
    SixDegreePair,
    continue_orbit,
    fold_sensitivities,
    orbit_sensitivities,
    periodic_orbit,
    simulate,
)
from gearlib.analysis.orbits.branch_points import Shooting
from gearlib.analysis.orbits.parameters import RATIOS, value_of
from gearlib.models.derivatives import PARAMETERS, START
from gearlib.models.profiles import Steps
from gearlib.runs.sensitivities import EDGE, GRAZING, ONE_SIDED
from tests.physics.test_dead_zone import as_oscillator
from tests.physics.test_sensitivities import (
    DAMPED,
    EVENT,
    EXTREMA,
    OTHER,
    TIMES,
    grazing_state,
)

VARIABLES = ("displacement", "velocity", "acceleration", "dynamic_force", *EXTREMA, *TIMES, *EVENT)
SAME = OneDegreePair(pair=DAMPED)
GEARS = SixDegreePair(
    pair=DAMPED,
    base_radii=(0.034, 0.05),
    inertias=(0.004, 0.01),
    masses=(3.0, 5.0),
    bearing_stiffness=(5e8, 5e8, 6e8, 6e8),
    bearing_damping=(800.0,) * 4,
    teeth=(3, 2),
    eccentricities=(1e-6, 2e-6),
    friction=(0.05, 0.05),
    pitch_phase=1.0,
)
OSCILLATOR = DeadZoneOscillator(
    upper_edge=0.2,
    lower_edge=-0.9,
    upper_stiffness=1.3,
    lower_stiffness=0.8,
    damping=0.05,
    upper_damping=0.1,
    ground_stiffness=0.1,
    load=0.1,
    forcing=Harmonics((0.7,), (0.2,)),
    deviation=Harmonics((), (0.1,)),
)


def same(one, other, first, second, factor, value, share):
    """Assert that derivatives of two models by a relative change are the same.

    `factor` is what the second parameter changes by with the first.
    """
    for variable in VARIABLES:
        values = value * one[f"d_{variable}_d_{first}"].values
        found = value * factor * other[f"d_{variable}_d_{second}"].values
        size = 1.0 + np.abs(values).max(initial=0.0)
        np.testing.assert_allclose(found, values, rtol=0, atol=share * size, err_msg=first)


@pytest.mark.parametrize(
    ("periods", "state"), [(3, (0.3, -2.0)), (12, (0.5, -6.0)), (300, (0.0, 0.0))]
)
def test_one_degree_is_a_gear_pair(periods, state):
    options = {"periods": periods, "initial_state": state, "sensitivities": tuple(PARAMETERS)}
    one, other = simulate(DAMPED, 0.9, **options), simulate(SAME, 0.9, **options)
    assert (
        int(one.sensitivity_status)
        == int(other.sensitivity_status)
        == (0 if any(state) else ONE_SIDED)
    )
    for name, (units, _) in PARAMETERS.items():
        # Both have some 1e-13 in twelve periods.
        same(one, other, name, name, 1.0, getattr(DAMPED, name, 1.0), 1e-11)
        final = f"d_final_state_d_{name}"
        size = float(abs(one[final]).max())
        np.testing.assert_allclose(other[final], one[final], rtol=0, atol=1e-11 * size + 1e-20)
        assert other[final].attrs == one[final].attrs and units


def test_an_oscillator_is_a_gear_pair():
    # Damping of both contacts, the lower edge and the frequency are ratios of the pair.
    options = {"periods": 6, "initial_state": (0.3, -6.0)}
    own = ("damping", "upper_damping", "lower_damping", "lower_edge", "tuning", *START)
    names = ("damping_ratio", "backlash_damping_ratio", "backlash_ratio", "tuning", *START)
    one = simulate(DAMPED, 0.9, sensitivities=names, **options)
    other = simulate(as_oscillator(DAMPED), 0.9, sensitivities=own, **options)
    for name in ("tuning", *START):
        same(one, other, name, name, 1.0, 1.0, 1e-12)
    same(one, other, "backlash_ratio", "lower_edge", -1.0, 1.0, 1e-12)
    same(one, other, "backlash_damping_ratio", "damping", 2.0, 1.0, 1e-12)
    both = sum(other[f"d_displacement_d_{side}_damping"] for side in ("upper", "lower"))
    np.testing.assert_allclose(2.0 * both, one.d_displacement_d_damping_ratio, rtol=0, atol=1e-11)


def moved(model, tuning, name, share):
    """Return (model, tuning, change) with a parameter changed by a share of it."""
    if name == "tuning":
        return model, tuning * (1.0 + share), tuning * share
    field, _, index = name.partition("[")
    if index:
        values = list(getattr(model, field))
        step = values[int(index[:-1])] * share
        values[int(index[:-1])] += step
        return model.replace(**{field: tuple(values)}), tuning, step
    value = getattr(model, field)
    return model.replace(**{field: value * (1.0 + share)}), tuning, value * share


@pytest.mark.parametrize(
    ("model", "tuning", "state"),
    [
        (GEARS, 0.9, (0.3, -5.0)),
        (GEARS.replace(moving_backlash=False, preload=False), 0.6, (0.3, -5.0)),
        (OSCILLATOR, 0.8, (0.3, -1.0)),
        (
            OSCILLATOR.replace(
                upper_stiffness=Steps((0.5, 2.0), (1.0, 1.4)), forcing=Harmonics((0.3,))
            ),
            0.8,
            (0.3, -1.0),
        ),
    ],
)
def test_other_models_against_differences(model, tuning, state):
    ratios = ("damping_ratio", "backlash_damping_ratio", "backlash_ratio")
    names = [name for name in model.derivatives if name not in (*START, *ratios)]
    options = {"periods": 3, "record_periods": 2, "samples_per_period": 8, "initial_state": state}
    run, share = simulate(model, tuning, sensitivities=(*names, *START), **options), 1e-5
    assert run.sizes["event"] > 2
    for name in names:
        (one, _, step), (other, *_) = (moved(model, tuning, name, s * share) for s in (1, -1))
        speeds = [moved(model, tuning, name, s * share)[1] for s in (1, -1)]
        ends = [simulate(m, nu, **options) for m, nu in zip((one, other), speeds, strict=True)]
        more = (*model.extra_samples, "final_state")
        for variable in (*VARIABLES, *more):
            difference = (ends[0][variable] - ends[1][variable]).values / (2.0 * share)
            found = run[f"d_{variable}_d_{name}"].values * step / share
            if variable in ("acceleration", "friction_force", "dynamic_force"):
                # A sample at a switch is on either side.
                difference, found = difference[::2], found[::2]
            size = 1.0 + np.abs(difference).max(initial=0.0)
            # Truncation is 1e-10 of third derivatives, rounding 1e-13 / 1e-5.
            off = np.abs(found - difference).max(initial=0.0)
            assert off <= 1e-6 * size, (name, variable, off)


def test_orbits_are_those_of_a_gear_pair():
    names = ("contact_ratio", "damping_ratio", "backlash_ratio", "tuning")
    for tuning, guess in ((0.88, (0.096, -2.833)), (0.851, (-0.1022, -1.4451))):
        one, other = (
            orbit_sensitivities(periodic_orbit(pair, tuning, guess=guess), names)
            for pair in (OTHER, OneDegreePair(pair=OTHER))
        )
        for name in names:
            for variable in ("state", "multiplier_real", "multiplier_imaginary"):
                values = one[f"d_{variable}_d_{name}"].values
                found = other[f"d_{variable}_d_{name}"].values
                # An orbit is known to 1e-13 over the slowness of its events.
                np.testing.assert_allclose(found, values, rtol=0, atol=1e-10 * abs(values).max())
    branch = continue_orbit(periodic_orbit(OTHER, 0.8), to=0.81)
    with pytest.raises(ValueError, match="tuning must not be among them"):
        fold_sensitivities(OTHER, branch, 0, names)


@pytest.mark.parametrize("name", RATIOS)
@pytest.mark.parametrize("pair", [OneDegreePair(pair=OTHER), GEARS.replace(eccentricities=(0, 0))])
def test_branches_have_exact_derivatives(pair, name):
    tuning = 0.88
    value = value_of(pair, tuning, name)
    problem = Shooting(pair, tuning, 2, (name,), (1.0,), 10**6)
    z = pair.propagator(tuning).start((0.096, -2.833))
    y = problem.unknowns(z, [value])
    found, difference = problem.slopes(y)[:, 0], problem._difference(y, y.size - 1)
    np.testing.assert_allclose(found, difference, rtol=0, atol=1e-6 * abs(found).max() + 1e-9)


def test_across_a_grazing():
    pair = OneDegreePair(
        pair=dataclasses.replace(OTHER, material_damping=0.2, backlash_damping=0.04)
    )
    for miss, code in ((-1e-2, 0), (-1e-13, GRAZING), (1e-13, GRAZING), (1e-6, 0)):
        state = grazing_state(pair.pair, 0.8, miss)
        options = {"periods": 1, "initial_state": state, "sensitivities": ("tuning", *START)}
        one, other = (simulate(model, 0.8, **options) for model in (pair.pair, pair))
        assert int(one.sensitivity_status) == int(other.sensitivity_status) == code
        # At the grazing rounding counts by its root.
        size = 1e-10 if code == 0 else 1e-6
        for name in ("tuning", *START):
            for variable in ("final_state", "displacement_min", "event_phase"):
                values, found = (run[f"d_{variable}_d_{name}"].values for run in (one, other))
                if found.shape == values.shape:
                    np.testing.assert_allclose(found, values, rtol=1e3 * size, atol=size)


def nans(run):
    """Return the derivatives of a run that are not all numbers."""
    return {name for name in run.data_vars if name[:2] == "d_" and np.isnan(run[name]).any()}


@pytest.mark.parametrize("contact_ratio", [1.0, 2.0])
def test_forces_jump_at_the_edge_of_the_contact_ratio(contact_ratio):
    pair = DAMPED.replace(contact_ratio=contact_ratio)
    for name, code in (("contact_ratio", EDGE), ("load", 0)):
        run = simulate(pair, 0.8, periods=20, sensitivities=name)
        assert int(run.sensitivity_status) == code
        wanted = {f"d_dynamic_force_{end}_d_{name}" for end in ("max", "min")} if code else set()
        assert nans(run) == wanted


def test_an_infinite_backlash_stays_infinite():
    gears = GEARS.replace(backlash=np.inf)
    run = simulate(gears, 0.8, periods=3, sensitivities=("load", "backlash"))
    assert np.isinf(run.backlash).all() and not nans(run)
    assert not run.d_backlash_d_load.any() and not run.d_final_state_d_backlash.any()


@pytest.mark.parametrize("periods", [1, 3])
def test_a_slow_mesh(periods):
    """From rest on the flank line, which is no touch; near its extrema most of the time."""
    pair = GearPair.from_ratios(
        contact_ratio=1.569, stiffness_ratio=0.5879, damping=0.0617, backlash_damping=0.0617
    )
    run = simulate(OneDegreePair(pair=pair), 0.01, periods=periods, sensitivities="tuning")
    assert int(run.sensitivity_status) == 0 and int(run.status) == 0
    own = simulate(pair, 0.01, periods=periods, sensitivities="tuning")
    for name in ("displacement_max", "dynamic_force_max", "final_state"):
        wanted = own[f"d_{name}_d_tuning"]
        np.testing.assert_allclose(run[f"d_{name}_d_tuning"], wanted, rtol=1e-7, atol=1e-9)


def test_a_full_start_of_six_degrees():
    state = tuple(GEARS.propagator(0.9).start((0.3, -2.0)))
    runs = [
        simulate(GEARS, 0.9, periods=2, initial_state=start, sensitivities="tuning")
        for start in ((0.3, -2.0), state)
    ]
    np.testing.assert_array_equal(runs[0].displacement, runs[1].displacement)
    # The speed of the run-out at the start, over the tuning, is the same but for its rounding.
    one, other = (run.d_displacement_d_tuning for run in runs)
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-13)
    with pytest.raises(ValueError, match="is not allowed with all 12 components"):
        simulate(GEARS, 0.9, periods=1, initial_state=state, sensitivities="initial_velocity")


@pytest.mark.parametrize(
    ("model", "name", "part"),
    [
        (OneDegreePair(pair=DAMPED.replace(contact_ratio=1.0)), "contact_ratio", "> 1 and < 2"),
        (GEARS, "inertias[2]", r"'inertias\[2\]' is not allowed: it must be one of"),
        (OSCILLATOR, "backlash", "'backlash' is not allowed: it must be one of 'upper_edge'"),
    ],
)
def test_wrong_input(model, name, part):
    with pytest.raises(ValueError, match=part):
        simulate(model, 0.9, periods=1, sensitivities=(name,))
