"""Certificates against a second program, wrong candidates, and what is known in closed form.

``GEARLIB_CERTIFICATES=10000`` takes so many random orbits in place of a few: ten minutes.
"""

import json
import os
import sys
from dataclasses import replace
from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest
from flint import arb

import gearlib
from gearlib.analysis.proofs.balls import digits_of
from gearlib.analysis.proofs.orbits import MAX_DISTANCE
from tests.independent.certificates import faults
from tests.paper import PAPER
from tests.proofs.candidates import extrema_apart, mostly_wrong, never_right, random_orbit

COUNT = int(os.environ.get("GEARLIB_CERTIFICATES", "40"))
MATERIAL = PAPER.replace(material_damping=3953.7)


def checked(certificate):
    """Return the faults of the JSON of a certificate."""
    return faults(json.loads(json.dumps(certificate.as_dict())))


def pair(**ratios):
    return gearlib.GearPair.from_ratios(**{"contact_ratio": 1.6, "stiffness_ratio": 0.6} | ratios)


@cache
def bouncing():
    return gearlib.periodic_orbit(MATERIAL, 0.815)


#: What is special, model, tuning, guess, period, the stability that is known.
CASES = {
    "two contacts": (MATERIAL, 0.9, None, 1, "stable"),
    "no contact lost": (MATERIAL, 0.7, None, 1, "stable"),
    "inverse mesh": (pair(damping=0.02, backlash=1.0), 0.7, None, 1, None),
    "another damping in the backlash": (
        PAPER.replace(backlash_damping=3953.7), 0.82, None, 1, "stable",
    ),
    "two mesh periods": (pair(damping=0.03, backlash=4.0), 2.0, None, 2, None),
    "no backlash": (pair(damping=0.05, backlash=0.0), 0.95, None, 1, None),
    "endless backlash": (pair(damping=0.05), 0.9, None, 1, None),
    "constant stiffness": (pair(damping=0.05, contact_ratio=2.0), 0.9, (1.1, 0.0), 1, "stable"),
    "the lower stiffness alone": (
        pair(damping=0.05, contact_ratio=1.0), 0.9, (1.1, 0.0), 1, "stable",
    ),
    "over-damped": (pair(damping=1.4, backlash=3.0), 0.8, None, 1, "stable"),
    "undamped, elliptic": (pair(), 1.3, (1.0, 0.0), 1, "undecided"),
    "undamped, in a tongue": (pair(), 2.0, (1.0, 0.0), 1, "unstable"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_an_orbit_is_proven_and_a_second_program_agrees(case):
    model, tuning, guess, period, stability = CASES[case]
    orbit = gearlib.periodic_orbit(model, tuning, guess=guess, period=period)
    found = gearlib.certify(orbit)
    assert found, found
    assert checked(found) == []
    assert found.pattern == orbit.pattern
    assert stability in (found.stability, None)
    # The candidate's residual is 1e-12; no case is near a fold.
    assert abs(float(found.displacement) - orbit.state[0]) < 1e-9
    assert extrema_apart(found, orbit) < 1e-9
    for one, (real, imaginary) in zip(orbit.multipliers, found.multipliers, strict=True):
        assert min(abs(one - float(real) - s * 1j * float(imaginary)) for s in (1, -1)) < 1e-7
        bare = not imaginary.low and not imaginary.high
        words = f"  multiplier    {real}" + ("" if bare else f", i ({imaginary})")
        assert words in repr(found).splitlines()


def test_constant_stiffness_rests_at_the_static_deflection():
    model = gearlib.GearPair.from_ratios(contact_ratio=2.0, stiffness_ratio=0.5, damping=0.25)
    orbit = gearlib.periodic_orbit(model, 0.5, guess=(1.0, 0.0))
    found = gearlib.certify(orbit, digits=40)
    # Exact numbers in binary: x = 1, trace and determinant in closed form.
    assert 1 in found.displacement and 0 in found.velocity
    assert 1 in found.displacement_min and 1 in found.displacement_max
    with mpmath.workdps(60):
        decay = mpmath.exp(-mpmath.pi)
        trace = 2 * decay * mpmath.cos(4 * mpmath.pi * mpmath.sqrt(mpmath.mpf(15) / 16))
        assert Fraction(str(decay**2)) in found.determinant
        assert Fraction(str(trace)) in found.trace


@pytest.mark.parametrize("digits", [10, 80])
def test_as_many_digits_as_asked_for(digits):
    found = gearlib.certify(bouncing(), digits=digits)
    extremes = found.displacement_min, found.displacement_max
    for enclosure in (
        found.displacement,
        found.velocity,
        found.trace,
        found.determinant,
        *extremes,
    ):
        assert enclosure.high - enclosure.low <= 2 * Fraction(10) ** -digits
    assert f"{found.displacement}".startswith("0.0") or "-0.0" in f"{found.displacement}"


@pytest.mark.parametrize("seed", range(COUNT))
def test_random_orbits_and_wrong_candidates(seed):
    orbit = random_orbit(seed)
    if orbit is None:
        return
    found = gearlib.certify(orbit)
    if not found:
        # The candidate repeats earlier, or is not an isolated one.
        assert found.status in ("period", "fold", "grazing", "contacts", "distance"), found
        return
    assert found.stability == "undecided" or (found.stability == "stable") == orbit.stable
    if seed % 4 == 0:
        assert checked(found) == []
    for statuses, candidate in never_right(orbit, np.random.default_rng(seed)):
        refused = gearlib.certify(candidate)
        assert not refused and refused.status in statuses, refused
    for candidate in mostly_wrong(orbit):
        other = gearlib.certify(candidate)
        if other:
            # Proven all the same: then a true orbit lies that close, and the second program knows.
            assert other.moved <= MAX_DISTANCE and other.pattern == candidate.pattern
            assert abs(float(other.displacement) - candidate.state[0]) <= 1.01 * MAX_DISTANCE
            assert seed % 4 or checked(other) == []


def test_most_random_orbits_are_proven():
    """So that the test above is not about nothing."""
    orbits = [random_orbit(seed) for seed in range(40)]
    proven = [found for found in map(gearlib.certify, filter(None, orbits)) if found]
    assert len(proven) >= 30
    assert sum(len(found.pattern) > 1 for found in proven) >= 8
    assert sum(found.period > 1 for found in proven) >= 3


@pytest.mark.parametrize(
    "change, status",
    [
        ({"state": (-0.0953, -0.3086)}, "distance"),
        ({"tuning": 0.8151}, "distance"),
        ({"pair": PAPER}, "distance"),
        ({"period": 2}, "contacts"),
        ({"period": 2, "pattern": (0, 1, 0, 1, 0)}, "period"),
        ({"pattern": (1,)}, "contacts"),
        ({"pair": gearlib.OneDegreePair(pair=MATERIAL, cubic_damping=1.0)}, "model"),
    ],
)
def test_a_wrong_candidate_is_refused(change, status):
    orbit = bouncing()
    change = change | ({"state": np.array(change["state"])} if "state" in change else {})
    refused = gearlib.certify(replace(orbit, **change))
    assert not refused and refused.status == status


def test_an_orbit_that_touches_is_refused():
    """Undamped, from rest on the flank line: x = 0 and x' = 0 once in every mesh period."""
    orbit = gearlib.periodic_orbit(pair(contact_ratio=2.0), 0.5, guess=(0.3, 0.0))
    # Constant stiffness c = 1 without damping, nu = 1/2: every motion repeats, this one touches.
    touching = replace(orbit, state=np.array([2.0, 0.0]), pattern=(1,))
    refused = gearlib.certify(touching)
    assert refused.status == "fold"
    tilted = pair(contact_ratio=2.0, damping=1e-4)
    assert not gearlib.certify(replace(touching, pair=tilted))


@pytest.mark.parametrize(
    "name",
    ["phase", "displacement", "pattern", "stability", "multipliers", "displacement_max"],
)
def test_the_second_program_sees_what_is_wrong(name):
    claim = gearlib.certify(bouncing()).as_dict()
    if name == "phase":
        low, high = claim["events"][0]["phase"]
        claim["events"][0]["phase"] = [low.replace("6", "7", 1), high.replace("6", "7", 1)]
    elif name == "displacement":
        claim["displacement"] = [end[:-6] + "123456" for end in claim["displacement"]]
    elif name == "pattern":
        claim["events"], claim["pattern"] = [], [0]
    elif name == "stability":
        claim["stability"] = "unstable"
    elif name == "multipliers":
        # Another pair with the same trace, within the unit circle too.
        for _, imaginary in claim["multipliers"]:
            imaginary[:] = [end.replace("29", "30", 1) for end in imaginary]
        assert faults(claim) == ["multiplier"]
    else:
        claim[name] = [end[:-20] + "1234" for end in claim[name]]
        assert faults(claim) == ["displacement_max"]
    assert faults(claim) != []


def test_the_second_program_sees_an_orbit_that_repeats_earlier():
    claim = gearlib.certify(gearlib.periodic_orbit(MATERIAL, 0.7)).as_dict()
    assert faults(claim) == []
    assert "period" in faults(claim | {"period": 2})


def test_without_flint_the_message_says_what_to_install(monkeypatch):
    orbit = bouncing()
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(ImportError, match=r"python-flint.*gearlib\[proof\]"):
        gearlib.certify(orbit)


def test_exact_numbers_have_as_many_digits_as_anyone_asks_for():
    assert digits_of(arb(0)) >= 300 and digits_of(arb(1)) >= 300
    assert digits_of(arb(1, 1e-30)) in (29, 30) and digits_of(arb(1e9, 1e-30)) in (38, 39)
