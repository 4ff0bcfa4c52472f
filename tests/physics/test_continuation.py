"""Branches of orbits, their special points and loci, against closed forms and other ways."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from gearlib import (
    continue_orbit,
    locus,
    periodic_orbit,
    simulate,
    switch_branch,
)
from gearlib.analysis.orbits.followed_parameters import value_of, with_parameter
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.analysis.orbits.special_points import DOUBLING, END, FOLD, GRAZING
from gearlib.analysis.tongues import meissner
from gearlib.engines.pair.stiffness import levels, segment_lengths
from tests.paper import PAPER as FREE
from tests.physics.test_periodic_orbits import DAMPED

#: The places asked for are 1e-8; what is found agrees to the rounding of an orbit, 1e-12, over the
#: slope of the test function, which is above 1e-2 in all cases here.
PLACE = 1e-10
MATERIAL = FREE.replace(material_damping=3953.7)


def places(branch, label):
    return branch[branch.attrs["parameter"]].values[branch.label.values == label]


@pytest.fixture(scope="module")
def up():
    return continue_orbit(periodic_orbit(MATERIAL, 0.52), to=1.2)


@pytest.fixture(scope="module")
def down():
    return continue_orbit(periodic_orbit(MATERIAL, 1.2), to=0.52)


def lowest(nu):
    """Return the smallest displacement of the undamped orbit that never loses contact."""
    top = meissner.orbit(FREE, nu)
    # By symmetry it turns in the middle of both stretches: at phase 0 and at pi.
    (high, low), (half_high, whole_low) = levels(1.569, 0.5879), segment_lengths(1.569)
    edge = meissner.state_after(top, high, 0.0, nu, half_high)
    return min(top[0], meissner.state_after(edge, low, 0.0, nu, 0.5 * whole_low)[0])


def over_doubling(nu):
    """Return the trace of the period map of the motion without loss, over its value at -1, -1."""
    return float(np.trace(meissner.period_map(FREE, nu)[0])) + 2.0


@pytest.mark.parametrize(
    ("start", "to", "bracket"), [(0.7, 0.82, (0.75, 0.82)), (1.3, 1, (1, 1.3))]
)
def test_grazing_in_closed_form(start, to, bracket):
    branch = continue_orbit(periodic_orbit(FREE, start, guess=meissner.orbit(FREE, start)), to=to)
    assert places(branch, GRAZING)[0] == pytest.approx(
        brentq(lowest, *bracket, xtol=1e-14), abs=PLACE
    )


def test_doublings_are_the_edges_of_the_tongue():
    start = periodic_orbit(FREE, 0.64, guess=meissner.orbit(FREE, 0.64))
    branch = continue_orbit(start, to=0.69)
    edges = [brentq(over_doubling, 0.66, outside, xtol=1e-14) for outside in (0.64, 0.69)]
    np.testing.assert_allclose(places(branch, DOUBLING), edges, rtol=0, atol=PLACE)
    inside = (branch.tuning > edges[0] + 1e-6) & (branch.tuning < edges[1] - 1e-6)
    assert (branch.stable[inside] == 0).all() and branch.stable[0] == 1


def test_a_doubled_branch():
    free = FREE.replace(backlash_damping=3953.7)
    branch = continue_orbit(periodic_orbit(free, 0.65, guess=meissner.orbit(free, 0.65)), to=0.67)
    point = int(np.flatnonzero(branch.label == DOUBLING)[1])
    doubled = switch_branch(free, branch, point)
    assert doubled.period == 2
    # Born in a linear motion, it stands across the tuning until it grazes.
    assert doubled.tuning == pytest.approx(float(branch.tuning[point]), abs=PLACE)
    curve = continue_orbit(doubled, to=0.65)
    assert curve.contacts.values[-1] == "NBNB" and float(curve.tuning[-1]) == 0.65
    end = curve.state.values[-1]
    once = simulate(free, 0.65, periods=1, initial_state=tuple(end)).final_state.values
    twice = simulate(free, 0.65, periods=2, initial_state=tuple(end)).final_state.values
    assert abs(twice - end).max() < 1e-11 and abs(once - end).max() > 0.01
    with pytest.raises(ValueError, match="labelled period doubling"):
        switch_branch(free, branch, 0)


def test_a_fold_is_where_two_orbits_merge(up):
    fold = places(up, FOLD)[0]
    at = int(np.flatnonzero(up.label == FOLD)[0])
    assert abs(up.multiplier_real.values[at] - 1.0).min() < 1e-7
    # Their distance goes like the root of that to the fold, and beyond there is no orbit.
    apart = []
    for distance in (1e-8, 4e-8):
        orbits = []
        for side in (-1, 1):
            guess = up.state.values[at + side]
            near = up.state.values[at]
            share = 2.0 * math.sqrt(distance) / max(abs(guess - near).max(), 1e-9)
            start = near + min(share, 1.0) * (guess - near)
            orbits.append(periodic_orbit(MATERIAL, fold - distance, guess=start))
        apart.append(abs(orbits[0].state - orbits[1].state).max())
        assert {orbit.stable for orbit in orbits} == {True, False}
    assert apart[1] / apart[0] == pytest.approx(2.0, rel=1e-3)
    with pytest.raises(NoOrbit):
        periodic_orbit(MATERIAL, fold + 1e-7, guess=up.state.values[at])


@pytest.mark.parametrize(
    ("name", "to"),
    [
        ("damping", 0.0),
        ("backlash_damping", 0.0),
        ("backlash", 2.0),
        ("contact_ratio", 1.4),
        ("stiffness_ratio", 0.55),
    ],
)
def test_other_parameters(name, to):
    branch = continue_orbit(periodic_orbit(DAMPED, 0.95), name, to=to)
    assert float(branch[name][-1]) == to
    assert float(branch[name][0]) == pytest.approx(value_of(DAMPED, 0.95, name), rel=1e-12)
    pair, _ = with_parameter(DAMPED, 0.95, name, to)
    found = periodic_orbit(pair, 0.95, guess=branch.state.values[-1])
    np.testing.assert_allclose(found.state, branch.state.values[-1], rtol=0, atol=1e-10)
    assert pair.mean_stiffness == pytest.approx(DAMPED.mean_stiffness, rel=1e-14)


# From the rim of its range too: without damping in the backlash.
@pytest.mark.parametrize("name, to", [("damping", 0.03), ("backlash_damping", 0.03)])
def test_loci(up, name, to):
    fold = int(np.flatnonzero(up.label == FOLD)[0])
    graze = int(np.flatnonzero(up.label == GRAZING)[1])
    # Each point of a locus is the labelled point of a branch at that damping.
    for point, label in ((fold, FOLD), (graze, GRAZING)):
        curve = locus(MATERIAL, up, point, name, to=to)
        assert float(curve[name][-1]) == to and curve.attrs["ended"] == "at its goal"
        assert float(curve.tuning[0]) == pytest.approx(float(up.tuning[point]), abs=PLACE)
        pair, _ = with_parameter(MATERIAL, 1.0, name, to)
        branch = continue_orbit(periodic_orbit(pair, 0.76), to=0.84)
        # The locus of folds solves its defining function to 1e-10.
        found = abs(places(branch, label) - float(curve.tuning[-1])).min()
        assert found < 1e-8
    with pytest.raises(ValueError, match="labelled fold"):
        locus(MATERIAL, up, 0, "damping", to=0.03)


@pytest.mark.parametrize("end", [0, 1])
def test_a_locus_ends_behind_its_limits_and_not_on_them(up, end):
    fold = int(np.flatnonzero(up.label == FOLD)[0])
    to = (0.0, 0.1)[end]
    free = locus(MATERIAL, up, fold, "damping", to=to)
    beyond = free.tuning.values[1:] - free.tuning.values[0]
    # The tuning goes one way, to the limit that is set at its third point.
    side = int(beyond[0] > 0.0)
    assert free.point.size > 5 and (np.diff(free.tuning[:5]) > 0.0).all() == bool(side)
    limits = [-np.inf, np.inf]
    limits[side] = float(free.tuning[2])
    curve = locus(MATERIAL, up, fold, "damping", to=to, limits=tuple(limits))
    assert curve.attrs["ended"] == "at a limit" and curve.point.size == 4
    np.testing.assert_array_equal(curve.tuning, free.tuning[:4])


def test_where_no_single_curve_goes_on():
    # Undamped, with all stiffness switches in flight, the mesh does not feel its phase.
    branch = continue_orbit(periodic_orbit(FREE, 1.2, guess=meissner.orbit(FREE, 1.2)), to=0.9)
    assert branch.label[-1] == END and float(branch.tuning[-1]) == pytest.approx(0.927, abs=1e-4)


@pytest.mark.parametrize(
    "stop", [{"limits": (0.81, 0.85)}, {"limits": (0.8, 0.85), "max_height": 3.0}]
)
def test_a_branch_that_turns_round_ends_at_its_limits(stop):
    pair = FREE.replace(material_damping=3953.7)
    run = simulate(pair, 0.812, periods=300, record_periods=1)
    # Of small bounces: it folds back at 0.816, and again at 0.808.
    orbit = periodic_orbit(pair, 0.812, guess=run.final_state.values)
    branch = continue_orbit(orbit, to=0.85, **stop)
    assert FOLD in branch.label and branch.label[-1] == END
    assert not (branch.label[:-1] == END).any()
    if "max_height" not in stop:
        assert float(branch.tuning[-1]) == pytest.approx(0.81, abs=1e-12)
    else:
        assert branch.orbit_height[-1] > 3.0 >= branch.orbit_height[:-1].max()
