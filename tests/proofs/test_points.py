"""Folds, period doublings, grazings, tongues and where motions tend to: against other programs."""

import json
import re
from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest

import gearlib
from gearlib.analysis import tongues
from gearlib.analysis.orbits.special_points import LABELS
from tests.paper import PAPER
from tests.proofs.checker import faults
from tests.proofs.tongues import tongue_faults
from tests.references import map_of_contact

MATERIAL = PAPER.replace(material_damping=3953.7)


@cache
def branch(damped):
    """From mesh without loss of contact over the first bounces; undamped, over a tongue."""
    pair, start, stop, step = (MATERIAL, 0.79, 0.83, 0.2) if damped else (PAPER, 0.64, 0.81, 0.05)
    orbit = gearlib.periodic_orbit(pair, start, guess=(0.5, 0.0))
    return pair, gearlib.continue_orbit(orbit, to=stop, step=step, max_height=6.0)


def points(label):
    """Return (pair, branch, point) of the points of a label."""
    for damped in (True, False):
        pair, found = branch(damped)
        for point in np.flatnonzero(found.label.values == LABELS.index(label)):
            yield pair, found, int(point)


@pytest.mark.parametrize("label, count", [("fold", 1), ("period doubling", 2), ("grazing", 2)])
def test_a_special_point_is_proven_and_a_second_program_agrees(label, count):
    given = list(points(label))
    assert len(given) >= count
    prove = gearlib.certify_grazing if label == "grazing" else gearlib.certify_fold
    for pair, found, point in given:
        proven = prove(pair, found, point)
        assert proven and proven.kind == label, proven
        claim = json.loads(json.dumps(proven.as_dict()))
        assert faults(claim) == []
        low, high = proven.interval
        assert faults(claim | {"interval": [2 * low - high, high]}, 1e-3) == ["uniqueness"]
        assert faults(claim | {"radius": 0.3}) == ["uniqueness"]
        # Located on the branch to half of the digits at least.
        assert abs(float(proven.tuning) - float(found.tuning[point])) < 1e-8
        assert proven.interval[0] < float(proven.tuning) < proven.interval[1]
        assert (proven.touch is not None) == (label == "grazing")


def test_a_point_of_another_label_is_no_candidate():
    pair, found, point = next(points("fold"))
    with pytest.raises(ValueError, match="it must be a grazing"):
        gearlib.certify_grazing(pair, found, point)
    with pytest.raises(ValueError, match="it must be a fold or period doubling"):
        gearlib.certify_fold(pair, found, 0)


@pytest.mark.parametrize("label", ["fold", "grazing"])
def test_a_point_that_is_moved_is_refused(label):
    pair, found, point = next(points(label))
    moved = found.copy(deep=True)
    moved["tuning"][point] += 1e-5
    prove = gearlib.certify_grazing if label == "grazing" else gearlib.certify_fold
    refused = prove(pair, moved, point)
    assert not refused and refused.status in ("distance", "contacts", "grazing", "fold")


def test_two_touches_at_once_are_refused():
    """Undamped orbits are symmetric: the doubled one touches twice, at opposite phases."""
    pair, found = branch(False)
    doubling = int(np.flatnonzero(found.label.values == LABELS.index("period doubling"))[1])
    start = gearlib.switch_branch(pair, found, doubling)
    double = gearlib.continue_orbit(start, to=0.7, limits=(0.6, 0.7), max_points=60)
    grazing = int(np.flatnonzero(double.label.values == LABELS.index("grazing"))[0])
    refused = gearlib.certify_grazing(pair, double, grazing)
    assert not refused and refused.status == "grazing"


def trace(pair, nu):
    """Return the trace of the map of one mesh period without damping, in the digits of mpmath."""
    matrix = map_of_contact(pair.contact_ratio, pair.stiffness_ratio, 0, nu)
    return matrix[0, 0] + matrix[1, 1]


def test_edges_of_tongues_in_closed_form():
    proven = gearlib.certify_tongues(PAPER, start=0.6, stop=1.5, digits=35)
    assert [one.order for one in proven] == [2, 3]
    with mpmath.workdps(50):
        for one in proven:
            for edge in (one.start, one.stop):
                low, high = (mpmath.mpf(str(end)) for end in (edge.low, edge.high))
                values = [trace(PAPER, end) - 2 * one.multiplier for end in (low, high)]
                assert values[0] * values[1] < 0 and high - low < mpmath.mpf(10) ** -34
            middle = (float(one.start) + float(one.stop)) / 2
            assert abs(trace(PAPER, middle)) > 2
            claim = json.loads(json.dumps(one.as_dict()))
            assert tongue_faults(claim) == []
            wide = claim | {"stop_interval": [claim["start_interval"][0] - 0.5, 1.5]}
            assert "uniqueness" in tongue_faults(wide)
            # The edge of another tongue, and an edge a little off.
            assert "growth" in tongue_faults(claim | {"stop": ["1.4", "1.4"], "multiplier": 1})
            assert tongue_faults(
                claim | {"start": [claim["start"][0][:-3], claim["start"][0][:-2]]}
            )


def test_damped_tongues_are_narrower_and_closed_ones_are_left_out():
    (free,) = gearlib.certify_tongues(PAPER, start=0.9, stop=1.1)
    (damped,) = gearlib.certify_tongues(PAPER.replace(material_damping=500.0), start=0.9, stop=1.1)
    assert free.start.high < damped.start.low < damped.stop.high < free.stop.low
    assert gearlib.certify_tongues(MATERIAL, start=0.9, stop=1.1) == []


def test_a_tongue_holds_one_gap_only(monkeypatch):
    """From the lower edge of order 4 to the upper one of order 2 there is stable motion between."""
    found = {one.order: one for one in tongues.find(PAPER, 0.45, 1.1)}
    joined = found[2]._replace(start=found[4].start)
    monkeypatch.setattr(tongues, "find", lambda *_: [joined])
    (refused,) = gearlib.certify_tongues(PAPER)
    assert not refused and refused.status == "tongue"


def test_a_range_of_tunings_that_is_none():
    with pytest.raises(ValueError, match="stop = 0.3 is not allowed: it must be > start = 0.5"):
        gearlib.certify_tongues(PAPER, start=0.5, stop=0.3)


def test_tongues_of_other_models():
    """Harmonics turn with the tuning; without them the laws are those of any tuning."""
    forced = gearlib.OneDegreePair(pair=PAPER, excitation=gearlib.Harmonics((100.0,)))
    (refused,) = gearlib.certify_tongues(forced, start=0.64, stop=0.7)
    assert not refused and refused.status == "model" and "harmonics" in refused.message
    (proven,) = gearlib.certify_tongues(gearlib.OneDegreePair(pair=PAPER), start=0.64, stop=0.7)
    (wanted,) = gearlib.certify_tongues(PAPER, start=0.64, stop=0.7)
    assert abs(float(proven.start) - float(wanted.start)) < 1e-14


def test_what_a_motion_does_not_reach():
    large = gearlib.periodic_orbit(MATERIAL, 0.815, guess=(0.8, -3.4))
    small = gearlib.periodic_orbit(MATERIAL, 0.815)
    assert abs(large.state[0] - small.state[0]) > 0.3
    assert gearlib.certify(large).stability == "stable"
    assert gearlib.certify_motion(large, periods=100).status == "arrival"
    assert gearlib.certify_motion(large, large.state + 1e-3).periods < 40
    unstable = gearlib.periodic_orbit(PAPER, 0.66, guess=(0.5, 0.0))
    assert gearlib.certify_motion(unstable).status == "trap"


def refused_at(refusal):
    """Return up to which tuning a range is proven, from the sentence of its refusal."""
    return float(re.search(r"to ([\d.]+) it is proven", refusal.message).group(1))


@pytest.mark.parametrize(
    "pair, start, to, guess, status, at",
    [
        (MATERIAL, 0.6, 0.803, (0.5, 0.0), "grazing", 0.8020519930),
        (MATERIAL, 0.815, 0.817, None, "fold", 0.8160450454),
        (PAPER, 0.64, 0.66, (0.5, 0.0), "stability", 0.6556243338),
    ],
)
def test_a_range_ends_where_the_orbit_does(pair, start, to, guess, status, at):
    """At the special points of the tests above."""
    orbit = gearlib.periodic_orbit(pair, start, guess=guess)
    refused = gearlib.certify_range(orbit, to=to)
    # Pieces end at a billionth of the range; next to a fold the orbit moves like a root.
    assert refused.status == status and at - 2e-7 < refused_at(refused) < at + 1e-9
    proven = gearlib.certify_range(orbit, to=at - 1e-5)
    assert proven and (proven.start, proven.stop) == (start, at - 1e-5)
    assert proven.pattern == orbit.pattern
    for tuning in np.linspace(start, at - 1e-5, 7):
        orbit = gearlib.periodic_orbit(pair, tuning, guess=orbit.state)
        one = gearlib.certify(orbit)
        assert (one.pattern, one.stability) == (proven.pattern, proven.stability)


def test_a_range_with_bounces_downwards():
    orbit = gearlib.periodic_orbit(MATERIAL, 0.9)
    proven = gearlib.certify_range(orbit, to=0.88)
    assert (proven.start, proven.stop, proven.stability) == (0.88, 0.9, "stable")
    assert proven.pattern == (1, 0, 1) and "Proven" in repr(proven)
    assert json.loads(json.dumps(proven.as_dict()))["start"] == (0.88).hex()


def test_ranges_that_are_no_ranges():
    orbit = gearlib.periodic_orbit(MATERIAL, 0.7)
    with pytest.raises(ValueError, match="another tuning"):
        gearlib.certify_range(orbit, to=0.7)
    # At constant stiffness the mesh rests, whatever the tuning.
    resting = gearlib.GearPair.from_ratios(contact_ratio=2.0, stiffness_ratio=0.6, damping=0.05)
    assert gearlib.certify_range(gearlib.periodic_orbit(resting, 0.6), to=0.9).pattern == (1,)
    moved = replace(orbit, state=orbit.state + 1e-6)
    assert gearlib.certify_range(moved, to=0.71).status == "distance"
    other = gearlib.OneDegreePair(pair=MATERIAL, deviation=gearlib.Harmonics((1e-9,)))
    refused = gearlib.certify_range(gearlib.periodic_orbit(other, 0.7), to=0.71)
    assert refused.status == "model"
