"""Compare periodic orbits, branches, special points and loci with closed forms and simulations."""

import math

import numpy as np
import pytest

from gearlib import GearPair, continue_orbit, locus, periodic_orbit, simulate, switch_branch
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.analysis.orbits.special_points import DOUBLING, FOLD, GRAZING
from gearlib.analysis.orbits.tracing import value_of, with_parameter
from gearlib.analysis.tongues import meissner
from tests.paper import PAPER_PAIR

#: Largest error of the tuning of a special point. The search stops at 1e-8, but the points agree to
#: the rounding of an orbit, 1e-12, divided by the slope of the test function, which is above 1e-2.
TUNING_TOLERANCE = 1e-10
#: Damped in contact only.
DAMPED_IN_CONTACT = PAPER_PAIR.replace(material_damping=3953.7)
DAMPED_PAIR = DAMPED_IN_CONTACT.replace(backlash_damping=800.0)


def special_point_values(branch, label):
    """Return the parameter values of the special points of a branch that have a given label."""
    return branch[branch.attrs["parameter"]].values[branch.label.values == label]


def undamped_branch(start, to):
    """Follow the undamped orbit without contact loss from the tuning `start` to the tuning `to`."""
    return continue_orbit(
        periodic_orbit(PAPER_PAIR, start, guess=meissner.orbit_state(PAPER_PAIR, start)), to=to
    )


@pytest.fixture(scope="module")
def rising_branch():
    """Return the branch of period-1 orbits from the tuning 0.52 up to 1.2."""
    return continue_orbit(periodic_orbit(DAMPED_IN_CONTACT, 0.52), to=1.2)


def test_a_search_over_six_periods_reports_the_least_period_two():
    """A search over six mesh periods must report the smallest period of the orbit it finds."""
    pair = GearPair.from_ratios(
        contact_ratio=1.6, stiffness_ratio=0.6, damping=0.02, backlash_ratio=math.inf
    )
    orbit = periodic_orbit(pair, 1.7, guess=(0.7, 0.9), period=6)
    assert orbit.period == 2
    # There is a period-1 orbit nearby, which the search must not return.
    period_1_orbit = periodic_orbit(pair, 1.7, guess=orbit.state)
    assert period_1_orbit.period == 1 and np.abs(period_1_orbit.state - orbit.state).max() > 1e-3


@pytest.mark.parametrize(("start", "to"), [(0.7, 0.82), (1.3, 1.0)])
def test_an_orbit_labelled_grazing_just_touches_the_flank_line(start, to):
    """The minimum displacement of an orbit labelled grazing must be 0, where the flanks touch."""
    branch = undamped_branch(start, to)
    point = int(np.flatnonzero(branch.label == GRAZING)[0])
    tuning, state = float(branch.tuning[point]), tuple(branch.state.values[point])
    run = simulate(PAPER_PAIR, tuning, periods=1, initial_state=state)
    # The minimum changes by at least 1e-2 times the change of the tuning.
    assert float(run.displacement_min) == pytest.approx(0.0, abs=1e-2 * TUNING_TOLERANCE)
    np.testing.assert_allclose(run.final_state, state, rtol=0, atol=1e-11)
    assert periodic_orbit(PAPER_PAIR, tuning, guess=state).grazing


def test_period_doublings_lie_at_the_edges_of_the_tongue():
    """The undamped orbit without contact loss is unstable exactly inside Meissner's tongue 3."""
    branch = undamped_branch(0.64, 0.69)
    tongue = meissner.find_tongue(meissner.equation_of_pair(PAPER_PAIR), order=3)
    edges = tongue.start, tongue.stop
    np.testing.assert_allclose(
        special_point_values(branch, DOUBLING), edges, rtol=0, atol=TUNING_TOLERANCE
    )
    inside = (branch.tuning > edges[0] + 1e-6) & (branch.tuning < edges[1] - 1e-6)
    assert (branch.stable[inside] == 0).all() and branch.stable[0] == 1


def test_a_branch_from_a_period_doubling_repeats_after_two_periods():
    """Orbits on the branch from a period doubling must repeat after two mesh periods, not one."""
    pair = PAPER_PAIR.replace(backlash_damping=3953.7)
    branch = continue_orbit(
        periodic_orbit(pair, 0.65, guess=meissner.orbit_state(pair, 0.65)), to=0.67
    )
    point = int(np.flatnonzero(branch.label == DOUBLING)[1])
    doubled_orbit = switch_branch(pair, branch, point)
    # Without contact loss the motion is linear, so that the tuning is constant along this branch
    # until its orbits graze.
    assert doubled_orbit.period == 2
    assert doubled_orbit.tuning == pytest.approx(float(branch.tuning[point]), abs=TUNING_TOLERANCE)
    doubled_branch = continue_orbit(doubled_orbit, to=0.65)
    assert doubled_branch.contacts.values[-1] == "FDFD" and float(doubled_branch.tuning[-1]) == 0.65
    state = doubled_branch.state.values[-1]
    after_one_period, after_two_periods = (
        simulate(pair, 0.65, periods=periods, initial_state=tuple(state)).final_state
        for periods in (1, 2)
    )
    assert abs(after_two_periods - state).max() < 1e-11
    assert abs(after_one_period - state).max() > 0.01
    with pytest.raises(ValueError, match="labelled period doubling"):
        switch_branch(pair, branch, 0)


def test_a_multiplier_is_one_at_a_fold_and_no_orbit_exists_beyond_it(rising_branch):
    """At a fold a multiplier must be 1, stability must change, and no orbit may exist beyond it."""
    point = int(np.flatnonzero(rising_branch.label == FOLD)[0])
    fold_tuning, state = float(rising_branch.tuning[point]), rising_branch.state.values[point]
    assert abs(rising_branch.multiplier_real.values[point] - 1.0).min() < 1e-7
    stability = [
        periodic_orbit(
            DAMPED_IN_CONTACT, float(rising_branch.tuning[i]), guess=rising_branch.state.values[i]
        ).stable
        for i in (point - 1, point + 1)
    ]
    assert stability == [True, False]
    with pytest.raises(NoOrbit):
        periodic_orbit(DAMPED_IN_CONTACT, fold_tuning + 1e-7, guess=state)


@pytest.mark.parametrize(
    ("name", "end"), [("damping", 0.0), ("backlash_ratio", 2.0), ("contact_ratio", 1.4)]
)
def test_a_branch_over_another_parameter_ends_at_an_orbit_of_the_changed_pair(name, end):
    """The last point of a branch must be an orbit of the pair with the last parameter value."""
    branch = continue_orbit(periodic_orbit(DAMPED_PAIR, 0.95), name, to=end)
    assert float(branch[name][-1]) == end
    assert float(branch[name][0]) == pytest.approx(value_of(DAMPED_PAIR, 0.95, name), rel=1e-12)
    pair, _ = with_parameter(DAMPED_PAIR, 0.95, name, end)
    orbit = periodic_orbit(pair, 0.95, guess=branch.state.values[-1])
    np.testing.assert_allclose(orbit.state, branch.state.values[-1], rtol=0, atol=1e-10)


@pytest.mark.parametrize("label", [FOLD, GRAZING])
def test_a_locus_ends_at_a_special_point_of_the_changed_pair(rising_branch, label):
    """The locus must end where a branch of the changed pair has the special point."""
    # The first fold and the second grazing end at tunings between 0.76 and 0.84.
    number = 1 if label == GRAZING else 0
    point = int(np.flatnonzero(rising_branch.label == label)[number])
    # The damping ratio in free flight rises from 0 to 0.03.
    curve = locus(DAMPED_IN_CONTACT, rising_branch, point, "backlash_damping", to=0.03)
    assert float(curve.backlash_damping[-1]) == 0.03 and curve.attrs["ended"] == "at its goal"
    assert float(curve.tuning[0]) == pytest.approx(
        float(rising_branch.tuning[point]), abs=TUNING_TOLERANCE
    )
    pair, _ = with_parameter(DAMPED_IN_CONTACT, 1.0, "backlash_damping", 0.03)
    branch = continue_orbit(periodic_orbit(pair, 0.76), to=0.84)
    # The defining function of the locus is solved to 1e-10, and the fold is sensitive to it.
    assert abs(special_point_values(branch, label) - float(curve.tuning[-1])).min() < 1e-8
    with pytest.raises(ValueError, match="labelled fold"):
        locus(DAMPED_IN_CONTACT, rising_branch, 0, "damping", to=0.03)
