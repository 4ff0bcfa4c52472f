"""Derivatives beside `test_conformance_of_derivatives.py`: samples, limits, edges."""

import dataclasses
import math

import numpy as np
import pytest

from gearlib import (
    GearPair,
    OneDegreePair,
    continue_orbit,
    orbit_sensitivities,
    periodic_orbit,
    planetary,
    simulate,
)
from gearlib.analysis.orbits.branch_points import Shooting
from gearlib.analysis.orbits.continuation import orbit_at
from gearlib.analysis.orbits.followed_parameters import RATIOS as FOLLOWED
from gearlib.analysis.orbits.followed_parameters import value_of
from gearlib.analysis.orbits.shooting import product
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.analysis.orbits.special_points import GRAZING as TOUCHING
from gearlib.models.derivatives import PARAMETERS
from gearlib.runs.sensitivities import DOUBLE, EDGE, GRAZING, ONE_SIDED
from gearlib.runs.sensitivities import FOLD as FOLDED
from tests.paper import PAPER
from tests.properties.known_models import (
    CHAIN,
    DAMPED,
    GEARS,
    OSCILLATOR,
    OTHER,
    STRIKING,
    pairs_as_train,
)
from tests.references.described_models import describe, places
from tests.references.reference_motion import turning_state
from tests.references.reference_slopes import of_run
from tests.trains.random_trains import random_problem

START = ("initial_displacement", "initial_velocity")
PARTS = ("multiplier_real", "multiplier_imaginary")
SHARE, LIMIT = 1e-10, 10**6
SAMPLES = ("displacement", "velocity", "acceleration", "dynamic_force")
BOUNCING = planetary(
    stiffness_ratio=(0.7, 0.7), contact_ratio=(1.5, 1.5), reference_frequency=1475.7
)


def changed(model, path, step):
    """Return a model with the number at a path of its description grown by a step."""
    key, *rest = path
    value = model[key] if isinstance(model, (tuple, list)) else getattr(model, key)
    new = changed(value, rest, step) if rest else value + step
    if isinstance(model, (tuple, list)):
        return tuple(new if i == key else one for i, one in enumerate(model))
    return dataclasses.replace(model, **{key: new})


def moved(model, tuning, name, share):
    """Return (model, tuning, change) with a parameter changed by a share of it."""
    if name == "tuning":
        return model, tuning * (1.0 + share), tuning * share
    if name == "load" and model.mesh_names:
        bodies = [dataclasses.replace(b, torque=b.torque * (1.0 + share)) for b in model.bodies]
        return model.replace(bodies=bodies), tuning, share * model.load
    slopes = places(describe(model), name)
    step = share * places_value(model, name)
    for path, slope in slopes.items():
        model = changed(model, path, slope * step)
    return model, tuning, step


def sample_cases():
    """Yield (model, tuning, start, parameters): of random trains one parameter of an element."""
    yield DAMPED, 0.9, (0.3, -2.0), ("reduced_mass", "contact_ratio", "material_damping")
    yield OneDegreePair(pair=DAMPED), 0.9, (0.5, -6.0), ("load", "backlash", "stiffness_ratio")
    yield GEARS, 0.9, (0.3, -5.0), ("inertias[0]", "bearing_stiffness[1]", "contact_ratio", "load")
    still = GEARS.replace(moving_backlash=False, preload=False)
    yield still, 0.6, (0.3, -5.0), ("masses[1]", "bearing_damping[0]", "backlash")
    yield OSCILLATOR, 0.8, (0.3, -1.0), ("upper_stiffness", "lower_edge", "damping", "tuning")
    yield CHAIN, 0.7, STRIKING, ("mass of body idler", "contact_ratio of mesh idler-wheel")
    for seed in range(6):
        rng = np.random.default_rng(100 + seed)
        train, tuning, state = random_problem(np.random.default_rng(seed))
        # Modes of one frequency may part.
        hertz = train.reference_angular_frequency / (2.0 * math.pi)
        train = train.replace(reference_frequency=hertz)
        left = ("torque", "error", "offset", "support", "torsional", "initial", "backlash of")
        names = [n for n in train.derivatives if " of " in n and not n.startswith(left)]
        names = [n for n in names if places_value(train, n)]
        names += [f"backlash of mesh {m.name}" for m in train.meshes if np.isfinite(m.backlash)]
        names = ["tuning", "load", *rng.choice(names, 2, replace=False).tolist()]
        yield train, tuning, "static" if seed % 3 == 0 else tuple(state), names


def places_value(model, name):
    value = describe(model)
    for key in next(iter(places(value, name))):
        value = value[key]
    return value


@pytest.mark.parametrize("case", list(sample_cases()), ids=lambda case: type(case[0]).__name__)
def test_samples_against_differences(case):
    model, tuning, state, names = case
    options = {"periods": 3, "record_periods": 2, "samples_per_period": 8, "initial_state": state}
    run, share = simulate(model, tuning, sensitivities=names, **options), 1e-5
    for name in names:
        both = [moved(model, tuning, name, s * share) for s in (1, -1)]
        ends = [simulate(other, nu, **options) for other, nu, _ in both]
        step = both[0][2]
        if len({one.sizes["event"] for one in (*ends, run)}) > 1:
            continue
        for variable in (*SAMPLES, *model.extra_samples):
            if f"d_{variable}_d_{name}" not in run:
                continue
            difference = (ends[0][variable] - ends[1][variable]).values / (2.0 * share)
            found = run[f"d_{variable}_d_{name}"].values * step / share
            # Where no event or switch lies between the two.
            jump = (ends[0].contact != ends[1].contact) | (ends[0].stiffness != ends[1].stiffness)
            jump = jump.values.reshape(len(jump), -1).any(axis=1)
            if variable in ("acceleration", "friction_force", "dynamic_force"):
                jump[::2] |= True
            size = 1.0 + np.abs(difference).max(initial=0.0)
            # Truncation is 1e-10 of third derivatives, rounding 1e-13 / 1e-5.
            off = np.abs(found - difference)[~jump].max(initial=0.0)
            assert off <= 1e-6 * size, (name, variable, off)


def test_units():
    options = {"periods": 4, "record_periods": 2, "initial_state": (0.3, -2.0)}
    names = ("reduced_mass", "contact_ratio", "material_damping")
    run = simulate(DAMPED, 0.9, sensitivities=names, **options)
    assert run.d_displacement_d_reduced_mass.attrs["units"] == "kg-1"
    assert run.d_event_phase_d_reduced_mass.attrs["units"] == "rad kg-1"
    assert run.d_velocity_d_contact_ratio.attrs["units"] == "1"
    assert run.d_displacement_max_d_material_damping.attrs["units"] == "m N-1 s-1"
    same = simulate(OneDegreePair(pair=DAMPED), 0.9, sensitivities=names, **options)
    for name in names:
        for one in ("displacement", "final_state", "event_phase"):
            assert same[f"d_{one}_d_{name}"].attrs == run[f"d_{one}_d_{name}"].attrs
    inertia = "d_displacement_d_inertia of body wheel 0"
    train = simulate(
        pairs_as_train(DAMPED), 0.9, periods=1, sensitivities="inertia of body wheel 0"
    )
    assert train[inertia].attrs["units"] == "kg-1 m-2"
    # The values are those of a run without derivatives.
    plain = simulate(DAMPED, 0.9, **options)
    for name in plain.variables:
        np.testing.assert_array_equal(run[name], plain[name])


@pytest.mark.parametrize("as_model", [lambda pair: pair, lambda pair: OneDegreePair(pair=pair)])
def test_across_a_grazing(as_model):
    pair = GearPair.from_ratios(
        contact_ratio=1.6, stiffness_ratio=0.6, damping=0.1, backlash_damping=0.02, backlash=2.0
    )
    names, ends = ("tuning", *START), []
    for miss, code, share in (
        (-1e-2, 0, SHARE),
        (-1e-6, 0, SHARE),
        (-1e-13, GRAZING, 1e-6),
        (1e-13, GRAZING, 1e-6),
        (1e-6, 0, SHARE),
    ):
        state = tuple(turning_state(describe(pair), 0.8, 0.4, 0, miss).tolist())
        run = simulate(as_model(pair), 0.8, periods=1, initial_state=state, sensitivities=names)
        assert int(run.sensitivity_status) == code
        rows = of_run(describe(pair), 0.8, 1, state, names)
        # By the names of the variables the state comes before the four fractions.
        reference = np.array([row[-6:-4] for row in rows], float)
        found = np.array([run[f"d_final_state_d_{name}"].values for name in names])
        # At the grazing derivatives change like its root, and rounding by the root of rounding.
        assert abs(found - reference).max() <= share * abs(reference).max()
        ends.append(found)
        slow = abs(run.event_velocity.values) * 0.8 < 1e-5
        phases = run.d_event_phase_d_tuning.values
        assert (np.isnan(phases) == slow).all() and slow.any() == (miss == -1e-13)
    np.testing.assert_allclose(ends[2], ends[3], rtol=0, atol=1e-6)


def test_a_start_on_a_flank_line():
    # Two sides of a start between which the oil takes the place of the material.
    states = ((1e-9, -1.0), (0.0, -1.0))
    first, second = (
        simulate(DAMPED, 0.9, periods=1, initial_state=state, sensitivities=START)
        for state in states
    )
    assert (int(first.sensitivity_status), int(second.sensitivity_status)) == (0, ONE_SIDED)
    gap = abs(
        first.d_final_state_d_initial_displacement - second.d_final_state_d_initial_displacement
    )
    assert float(gap.max()) > 0.01
    np.testing.assert_allclose(
        first.d_final_state_d_initial_velocity,
        second.d_final_state_d_initial_velocity,
        rtol=0,
        atol=1e-7,
    )


def test_settled_runs_have_the_derivatives_of_their_orbit():
    names = ("material_damping", "contact_ratio", "tuning")
    run = simulate(DAMPED, 0.9, periods=100_000, sensitivities=names)
    orbit = orbit_sensitivities(periodic_orbit(DAMPED, 0.9), names)
    for name in names:
        for variable in ("displacement_max", "fraction_backlash", "displacement", "event_phase"):
            one, other = (d[f"d_{variable}_d_{name}"].values for d in (run, orbit))
            # Both are at rest to rounding, 1e-14, over the distance of the multipliers from 1.
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-11 * abs(other).max())


def test_powers_of_a_settled_map():
    light = PAPER.replace(material_damping=64.0)
    run = simulate(light, 0.7, periods=7000, sensitivities=START)
    _, maps, _ = light.propagator(0.7).maps(np.zeros(2), 7000, LIMIT)
    found = np.column_stack([run[f"d_final_state_d_{name}"] for name in START])
    expected = product(maps)
    # Some 7000 products.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * abs(expected).max())
    assert 0.0 < abs(expected).max() < 1e-14


def test_special_orbits_say_so():
    # Without contact loss and at constant stiffness both multipliers are one, where they meet.
    steady = GearPair.from_ratios(contact_ratio=1.0, stiffness_ratio=0.6, damping=1.0)
    orbit = orbit_sensitivities(periodic_orbit(steady, 0.7), ("damping_ratio",))
    assert int(orbit.sensitivity_status) == DOUBLE
    assert np.isnan(orbit.d_multiplier_real_d_damping_ratio).all()
    branch = continue_orbit(periodic_orbit(OTHER, 0.8), to=0.93)
    for label, code in ((FOLD, FOLDED), (TOUCHING, GRAZING)):
        point = int(np.flatnonzero(branch.label == label)[0])
        found = orbit_sensitivities(orbit_at(OTHER, branch, point), ("backlash_damping_ratio",))
        assert int(found.sensitivity_status) == code
        assert np.isnan(found.d_state_d_backlash_damping_ratio).all() == (label == FOLD)
        assert np.isnan(found.d_multiplier_real_d_backlash_damping_ratio).all()
    # Short of the grazing by less than can be told from it.
    short = periodic_orbit(
        OTHER, float(branch.tuning[point]) - 2e-12, guess=branch.state.values[point]
    )
    assert short.pattern == (1,)
    found = orbit_sensitivities(short, ("backlash_damping_ratio",))
    assert int(found.sensitivity_status) == GRAZING
    assert np.isnan(found.d_multiplier_real_d_backlash_damping_ratio).all()


def test_two_repeats_of_an_orbit():
    # Multipliers are squares: mu^2 changes by 2 mu dmu.
    names = ("contact_ratio", "material_damping", "tuning")
    orbit = periodic_orbit(DAMPED, 0.9)
    one, two = (orbit_sensitivities(dataclasses.replace(orbit, period=n), names) for n in (1, 2))

    def complex_of(data, name):
        real, imaginary = (data[name.format(part)].values for part in PARTS)
        return real + 1j * imaginary

    first = complex_of(one, "{}")
    # A pair comes in either order.
    order = np.argsort(abs(first[:, None] ** 2 - complex_of(two, "{}")), axis=1)[:, 0]
    for name in names:
        slopes = complex_of(two, "d_{}_d_" + name)[order]
        expected = 2.0 * first * complex_of(one, "d_{}_d_" + name)
        np.testing.assert_allclose(slopes, expected, rtol=1e-9)
        np.testing.assert_allclose(two[f"d_state_d_{name}"], one[f"d_state_d_{name}"], rtol=1e-9)


@pytest.mark.parametrize(
    ("model", "state", "name"),
    [
        *((pair, (0.096, -2.833), name) for name in FOLLOWED for pair in (
            OTHER, OneDegreePair(pair=OTHER), GEARS.replace(eccentricities=(0, 0)))
        ),
        *((BOUNCING, "static", name) for name in BOUNCING.parameters),
    ],
)  # fmt: skip
def test_continuation_has_the_derivatives_by_its_parameters(model, state, name):
    tuning, several = 1.0 if model is BOUNCING else 0.88, model is BOUNCING
    value = value_of(model, tuning, name)
    problem = Shooting(model, tuning, 1 if several else 2, (name,), (1.0,), LIMIT)
    start = model.start_state(state) if several else model.propagator(tuning).start(state)
    y = problem.unknowns(start, [value])
    found = problem.slopes(y)[:, 0]
    if several:
        # The difference counts in units of the parameter: a damping is small beside it.
        problem.units[-1] = max(value, 1.0)
        y[-1] = value / problem.units[-1]
    difference = problem._difference(y, y.size - 1)
    np.testing.assert_allclose(found, difference, rtol=0, atol=1e-6 * abs(found).max() + 1e-9)


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
    ("pair", "more", "part"),
    [
        (DAMPED, {"sensitivities": ("damping",)}, "sensitivities = 'damping' is not allowed"),
        (DAMPED, {"sensitivities": True}, "sensitivities = True is not .* a sequence of names"),
        (DAMPED, {"sensitivities": ("load", "load")}, "names must be all different"),
        (OneDegreePair(pair=DAMPED, cubic_damping=1.0), {"method": "rk4"}, "by method 'rk4'"),
        (DAMPED, {"method": "taylor"}, "by method 'taylor'"),
    ],
)
def test_wrong_input(pair, more, part):
    with pytest.raises(ValueError, match=part):
        simulate(pair, 0.9, periods=1, **{"sensitivities": ("load",)} | more)


def test_a_run_that_cannot_go_on():
    run = simulate(DAMPED, 0.05, periods=2, max_events=2, sensitivities=("load", "tuning"))
    assert int(run.status) == 1
    assert math.isnan(run.d_displacement_max_d_load) and set(PARAMETERS) > {"load", "tuning"}


@pytest.mark.parametrize(
    ("model", "name", "part"),
    [
        (OneDegreePair(pair=DAMPED.replace(contact_ratio=1.0)), "contact_ratio", "> 1 and < 2"),
        (GEARS, "inertias[2]", r"'inertias\[2\]' is not allowed: it must be one of"),
        (OSCILLATOR, "backlash", "'backlash' is not allowed: it must be one of 'upper_edge'"),
        (CHAIN, "inertia of body sun", "'inertia of body sun' is not .* 'inertia of body motor'"),
        (
            CHAIN,
            "damping_ratio",
            "'damping_ratio' is not allowed: it must be one of 'tuning', 'load'",
        ),
        (CHAIN, "torque of body motor", "by a torque .* must be 'load'"),
        (
            planetary(stiffness_ratio=(0.7, 0.7)),
            "mass of body planet 1",
            r"reference_frequency = None is not .* as 9647.91 \(Hz\)",
        ),
        (planetary(), "stiffness_ratio", "not allowed at stiffness_ratio = 1.0: it must be < 1"),
        (
            planetary(stiffness_ratio=(0.7, 0.7), contact_ratio=(1.0, 1.5)),
            "contact_ratio",
            "not allowed at contact_ratio = 1.0: it must be > 1 and < 2",
        ),
    ],
)
def test_names_that_a_model_has_not(model, name, part):
    with pytest.raises(ValueError, match=part) as error:
        simulate(model, 0.9, periods=1, sensitivities=(name,))
    assert "\n" not in str(error.value)
