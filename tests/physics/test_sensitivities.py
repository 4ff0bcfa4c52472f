"""Derivatives of runs, orbits, multipliers and folds against 50 digits."""

import math

import numpy as np
import pytest

from gearlib import (
    GearPair,
    OneDegreePair,
    continue_orbit,
    fold_sensitivities,
    orbit_sensitivities,
    periodic_orbit,
    simulate,
)
from gearlib.analysis.orbits.branch_points import Shooting
from gearlib.analysis.orbits.continuation import orbit_at
from gearlib.analysis.orbits.parameters import RATIOS as FOLLOWED
from gearlib.analysis.orbits.parameters import value_of
from gearlib.analysis.orbits.shooting import product
from gearlib.analysis.orbits.special_points import FOLD
from gearlib.analysis.orbits.special_points import GRAZING as TOUCHING
from gearlib.models.derivatives import PARAMETERS
from gearlib.runs.sensitivities import DOUBLE, GRAZING, ONE_SIDED
from gearlib.runs.sensitivities import FOLD as FOLDED
from tests.paper import PAPER
from tests.physics import high_precision_derivatives as exact
from tests.physics.high_precision import Arc
from tests.references import Stored

REFERENCES = Stored("sensitivities")
RATIOS = ("contact_ratio", "stiffness_ratio", "damping", "backlash_damping", "backlash")
OWN = ("damping_ratio", "backlash_damping_ratio", "backlash_ratio")
START = ("initial_displacement", "initial_velocity")
EXTREMA = ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min")
TIMES = ("fraction_normal", "fraction_backlash", "fraction_inverse", "fraction_min_stiffness")
EVENT = ("event_phase", "event_velocity")
PARTS = ("multiplier_real", "multiplier_imaginary")
#: What is asked for: 1e-10 of each derivative. Those that cancel below 1e-3 of the others, which
#: are of order one in ratios, have no digits of their own.
SHARE, LEAST = 1e-10, 1e-3
DAMPED = PAPER.replace(material_damping=3953.7, backlash_damping=500.0)
MATERIAL = PAPER.replace(material_damping=3953.7)
#: Not the paper's: it strikes both flanks at 0.88 and, unstable, at 0.851.
OTHER = GearPair.from_ratios(
    contact_ratio=1.3, stiffness_ratio=0.7, damping=0.03, backlash_damping=0.01, backlash=0.8
)
LIMIT = 10**6


def random_case(seed):
    """Return (ratios, tuning, state); most lose contact, many strike both flanks."""
    rng = np.random.default_rng(seed)
    ratios = (
        rng.uniform(1.05, 1.95),
        rng.uniform(0.1, 0.95),
        10 ** rng.uniform(-3, -0.3),
        10 ** rng.uniform(-3, -0.3),
        10 ** rng.uniform(-1, 0.7),
    )
    state = rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0)
    return tuple(map(float, ratios)), float(10 ** rng.uniform(-0.5, 0.4)), tuple(map(float, state))


SPECIAL = [
    ((1.0, 0.6, 0.05, 0.02, 1.0), 0.8, (0.3, -2.0)),  # one side of a segment of no length
    ((2.0, 0.6, 0.05, 0.02, 1.0), 0.8, (0.3, -2.0)),
    ((1.5, 0.6, 0.05, 0.3, 0.0), 0.8, (0.3, -2.0)),  # no way between the flanks
    ((1.5, 0.6, 0.05, 0.02, math.inf), 0.9, (0.3, -2.0)),
    ((1.5, 1.0, 1.0, 0.0, 1.0), 0.7, (0.3, -6.0)),  # critical
    ((1.5, 0.6, 2.0, 0.5, 1.0), 0.3, (-3.0, 1.0)),  # over-damped
    ((1.5, 0.6, 0.0, 0.0, 1.0), 0.9, (0.3, -2.0)),
]


def by_ratios(pair, run, variable):
    """Return the derivatives of a variable by the ratios, the tuning and the start.

    A contact or stiffness ratio changes the other ratios of a pair in SI units, which is taken off.
    """

    def of(name):
        return run[f"d_{variable}_d_{name}"].values

    own = [of(name) for name in OWN]
    changed = [
        of(name) - sum(a * b for a, b in zip(pair.ratio_slopes(name)[2:], own, strict=True))
        for name in RATIOS[:2]
    ]
    return [*changed, *own, of("tuning"), *map(of, START)]


def row_of(values, j, recorded=1):
    """Return the derivatives by direction j in the columns of the references."""
    row = [*values["final_state"][j], *(float(values[name][j]) for name in EXTREMA)]
    row += [2.0 * math.pi * recorded * float(values[name][j]) for name in TIMES]
    return row + [float(values[name][j][-1]) for name in EVENT if values[name][j].size]


@pytest.mark.parametrize("case", [*map(random_case, range(40)), *SPECIAL])
def test_runs_against_50_digits(case):
    ratios, tuning, state = case
    pair = GearPair.from_ratios(**dict(zip(RATIOS, ratios, strict=True)))
    names = (*RATIOS[:2], *OWN, "tuning", *START)
    run = simulate(pair, tuning, periods=3, initial_state=state, sensitivities=names)
    values = {
        name: by_ratios(pair, run, name) for name in ("final_state", *EXTREMA, *TIMES, *EVENT)
    }
    own = tuple(getattr(pair, name) for name in GearPair.RATIOS)
    expected = REFERENCES.rows(exact.of_run, own, tuning, 3, state)
    # 5: at a contact ratio of 1 or 2 a segment appears.
    assert int(run.sensitivity_status) == (5 if ratios[0] in (1.0, 2.0) else 0)
    for j, reference in enumerate(expected):
        if math.isinf(own[4]) and j == 4:
            continue
        row = np.array(row_of(values, j)[: len(reference)])
        reference = np.array(reference, float)
        if ratios[0] in (1.0, 2.0) and j == 0:
            # The force jumps at the segment that appears.
            assert np.isnan(row[4:6]).all()
            row, reference = np.delete(row, [4, 5]), np.delete(reference, [4, 5])
        if ratios[1] == 1.0:
            # All stiffness is C_min and C_max.
            row, reference = np.delete(row, 9), np.delete(reference, 9)
        off = np.abs(row - reference) / np.maximum(np.abs(reference), LEAST)
        assert off.max() <= SHARE, (case, j, off)


def test_parameters_in_si_units_against_50_digits():
    fields = tuple(getattr(DAMPED, name) for name in exact.FIELDS)
    arguments = fields, 0.9, 12, (0.5, -3.0)
    run = simulate(DAMPED, 0.9, periods=12, initial_state=(0.5, -3.0), sensitivities=exact.FIELDS)
    for name, reference in zip(
        exact.FIELDS, REFERENCES.rows(exact.of_fields, *arguments), strict=True
    ):
        values = {
            v: [run[f"d_{v}_d_{name}"].values] for v in ("final_state", *EXTREMA, *TIMES, *EVENT)
        }
        reference = np.array(reference, float)
        # Of each quantity in its unit; the load and the backlash only scale without back contact.
        size = np.maximum(np.abs(reference), LEAST * np.abs(reference).max())
        assert (np.abs(row_of(values, 0) - reference) <= SHARE * size).all(), name


def test_samples_and_units():
    options = {"periods": 4, "record_periods": 2, "initial_state": (0.3, -2.0)}
    run = simulate(DAMPED, 0.9, sensitivities=("reduced_mass", "contact_ratio"), **options)
    for name in ("reduced_mass", "contact_ratio"):
        value, ends = getattr(DAMPED, name), []
        for sign in (1, -1):
            moved = DAMPED.replace(**{name: value * (1.0 + sign * 1e-6)})
            ends.append(simulate(moved, 0.9, **options))
        for variable in ("displacement", "velocity", "acceleration", "dynamic_force"):
            # Where no event or switch lies between the two.
            same = (ends[0].contact == ends[1].contact) & (ends[0].stiffness > 1) == (
                ends[1].stiffness > 1
            )
            expected = (ends[0][variable] - ends[1][variable]) / (2e-6 * value)
            found = run[f"d_{variable}_d_{name}"]
            # Truncation and rounding of central differences of this step.
            off = abs(found - expected).where(same, 0.0).max() / abs(expected).where(same).max()
            assert float(off) < 1e-6, (name, variable)
    assert run.d_displacement_d_reduced_mass.attrs["units"] == "kg-1"
    assert run.d_event_phase_d_reduced_mass.attrs["units"] == "rad kg-1"
    assert run.d_velocity_d_contact_ratio.attrs["units"] == "1"
    damped = simulate(DAMPED, 0.9, periods=1, sensitivities="material_damping")
    assert damped.d_displacement_max_d_material_damping.attrs["units"] == "m N-1 s-1"
    # The values are those of a run without derivatives.
    plain = simulate(DAMPED, 0.9, **options)
    for name in plain.variables:
        np.testing.assert_array_equal(run[name], plain[name])


def grazing_state(pair, tuning, miss):
    """Return a state from which the motion turns `miss` above the normal flank."""
    mean = pair.stiffness_ratio + (1 - pair.stiffness_ratio) * (pair.contact_ratio - 1)
    decay = -pair.damping_ratio / tuning
    x, v = Arc(decay, 1 / mean / tuning**2, 1 / tuning**2, miss, 0.0).at(0.5 * tuning)
    return float(x), -float(v)


def test_across_a_grazing():
    pair = GearPair.from_ratios(
        contact_ratio=1.6, stiffness_ratio=0.6, damping=0.1, backlash_damping=0.02, backlash=2.0
    )
    own, names = tuple(getattr(pair, name) for name in GearPair.RATIOS), ("tuning", *START)
    ends = []
    for miss, code, share in (
        (-1e-2, 0, SHARE),
        (-1e-6, 0, SHARE),
        (-1e-13, GRAZING, 1e-6),
        (1e-13, GRAZING, 1e-6),
        (1e-6, 0, SHARE),
    ):
        state = grazing_state(pair, 0.8, miss)
        run = simulate(pair, 0.8, periods=1, initial_state=state, sensitivities=names)
        assert int(run.sensitivity_status) == code
        reference = np.array(REFERENCES.rows(exact.of_run, own, 0.8, 1, state), float)[5:, :2]
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


@pytest.mark.parametrize(
    ("pair", "tuning", "guess"),
    [
        (DAMPED, 0.9, None),
        (DAMPED, 0.7, None),
        (OTHER, 0.5, None),
        (OTHER, 0.88, (0.096, -2.833)),
        (OTHER, 0.851, (-0.1022, -1.4451)),
    ],
)
def test_orbits_and_multipliers_against_50_digits(pair, tuning, guess):
    orbit = periodic_orbit(pair, tuning, guess=guess)
    found = orbit_sensitivities(orbit, (*RATIOS[:2], *OWN, "tuning"))
    assert int(found.sensitivity_status) == 0
    own = tuple(getattr(pair, name) for name in GearPair.RATIOS)
    start = tuple(round(float(value), 6) for value in orbit.state)
    found = found.assign({f"d_{v}_d_{s}": 0.0 for v in ("state", *PARTS) for s in START})
    values = {name: by_ratios(pair, found, name) for name in ("state", *PARTS)}
    for j, reference in enumerate(REFERENCES.rows(exact.of_orbit, own, tuning, 1, start)):
        real, imaginary = values["multiplier_real"][j], values["multiplier_imaginary"][j]
        row = np.array([*values["state"][j], real[0], imaginary[0], real[1], imaginary[1]])
        reference = np.array(reference, float)
        # An orbit is known to 1e-13, over the slowness of its events, which multipliers feel.
        size = np.maximum(np.abs(reference), LEAST * np.abs(reference).max())
        assert (np.abs(row - reference) <= SHARE * size).all(), (j, row - reference, reference)


@pytest.mark.parametrize(
    ("pair", "start", "to", "contacts"),
    [(OTHER, 0.8, 0.93, ["NB", "NBIB"]), (MATERIAL, 0.79, 0.83, ["NB"])],
)
def test_folds_against_50_digits(pair, start, to, contacts):
    branch = continue_orbit(periodic_orbit(pair, start), to=to)
    folds = np.flatnonzero(branch.label == FOLD)[: len(contacts)]
    assert branch.contacts.values[folds].tolist() == contacts
    own = tuple(getattr(pair, name) for name in GearPair.RATIOS)
    for point in folds:
        found = fold_sensitivities(pair, branch, int(point), (*RATIOS[:2], *OWN))
        found = found.assign({f"d_tuning_d_{name}": 0.0 for name in ("tuning", *START)})
        guess = (*branch.state.values[point], float(branch.tuning[point]))
        start = tuple(round(float(value), 6) for value in guess)
        (reference,) = REFERENCES.rows(exact.of_fold, own, 1, start)
        row, reference = np.array(by_ratios(pair, found, "tuning")[:5]), np.array(reference, float)
        # A fold is a simple zero of det(M - I) along the branch, which locates it to rounding over
        # the rate of that: of 31 folds of random pairs and the paper's the worst was off by 3e-12.
        size = np.maximum(np.abs(reference), LEAST * np.abs(reference).max())
        assert (np.abs(row - reference) <= SHARE * size).all(), (row - reference, reference)


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
    one, two = (orbit_sensitivities(periodic_orbit(DAMPED, 0.9, period=n), names) for n in (1, 2))

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


@pytest.mark.parametrize("name", FOLLOWED)
def test_continuation_has_the_derivatives_by_its_parameters(name):
    value = value_of(OTHER, 0.88, name)
    problem = Shooting(OTHER, 0.88, 2, (name,), (1.0,), LIMIT)
    y = problem.unknowns(np.array([0.096, -2.833]), [value])
    found, difference = problem.slopes(y)[:, 0], problem._difference(y, 2)
    np.testing.assert_allclose(found, difference, rtol=0, atol=1e-6 * abs(found).max())


@pytest.mark.parametrize(
    ("pair", "changed", "part"),
    [
        (DAMPED, {"sensitivities": ("damping",)}, "sensitivities = 'damping' is not allowed"),
        (DAMPED, {"sensitivities": True}, "sensitivities = True is not .* a sequence of names"),
        (DAMPED, {"sensitivities": ("load", "load")}, "names must be all different"),
        (
            OneDegreePair(pair=DAMPED, cubic_damping=1.0),
            {},
            "not allowed for this OneDegreePair by method 'taylor'",
        ),
        (DAMPED, {"method": "taylor"}, "by method 'taylor'"),
    ],
)
def test_wrong_input(pair, changed, part):
    with pytest.raises(ValueError, match=part):
        simulate(pair, 0.9, periods=1, **{"sensitivities": ("load",)} | changed)


def test_a_run_that_cannot_go_on():
    run = simulate(DAMPED, 0.05, periods=2, max_events=2, sensitivities=("load", "tuning"))
    assert int(run.status) == 1
    assert math.isnan(run.d_displacement_max_d_load) and set(PARAMETERS) > {"load", "tuning"}
