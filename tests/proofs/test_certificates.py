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

import gearlib
from gearlib.analysis.proofs.orbits import MAX_DISTANCE
from tests.independent.certificates import faults
from tests.paper import PAPER
from tests.proofs.candidates import (
    candidates_of_another_pair,
    candidates_without_orbit,
    difference_of_extrema,
    random_orbit,
)

COUNT = int(os.environ.get("GEARLIB_CERTIFICATES", "40"))
MATERIAL = PAPER.replace(material_damping=3953.7)


def faults_of(certificate):
    """Return the claims of a certificate, as JSON, that an orbit in 50 digits contradicts."""
    return faults(json.loads(json.dumps(certificate.as_dict())))


def pair(**ratios):
    return gearlib.GearPair.from_ratios(**{"contact_ratio": 1.6, "stiffness_ratio": 0.6} | ratios)


@cache
def bouncing():
    return gearlib.periodic_orbit(MATERIAL, 0.815)


#: Name -> model, tuning, guess, period, the stability where it is known.
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
def test_orbit_is_proven_and_confirmed_in_50_digits(case):
    model, tuning, guess, period, stability = CASES[case]
    orbit = gearlib.periodic_orbit(model, tuning, guess=guess, period=period)
    proven = gearlib.certify(orbit)
    assert proven, proven
    assert faults_of(proven) == []
    assert proven.pattern == orbit.pattern
    assert stability in (proven.stability, None)
    # The candidate's residual is 1e-12; no case is near a fold.
    assert abs(float(proven.displacement) - orbit.state[0]) < 1e-9
    assert difference_of_extrema(proven, orbit) < 1e-9
    for multiplier, (real, imaginary) in zip(orbit.multipliers, proven.multipliers, strict=True):
        assert (
            min(abs(multiplier - float(real) - s * 1j * float(imaginary)) for s in (1, -1)) < 1e-7
        )
        bare = not imaginary.low and not imaginary.high
        words = f"  multiplier    {real}" + ("" if bare else f", i ({imaginary})")
        assert words in repr(proven).splitlines()


def test_constant_stiffness_rests_at_the_static_deflection():
    model = gearlib.GearPair.from_ratios(contact_ratio=2.0, stiffness_ratio=0.5, damping=0.25)
    orbit = gearlib.periodic_orbit(model, 0.5, guess=(1.0, 0.0))
    proven = gearlib.certify(orbit, digits=40)
    # Exact numbers in binary: x = 1, trace and determinant in closed form.
    assert 1 in proven.displacement and 0 in proven.velocity
    assert 1 in proven.displacement_min and 1 in proven.displacement_max
    with mpmath.workdps(60):
        decay = mpmath.exp(-mpmath.pi)
        trace = 2 * decay * mpmath.cos(4 * mpmath.pi * mpmath.sqrt(mpmath.mpf(15) / 16))
        assert Fraction(str(decay**2)) in proven.determinant
        assert Fraction(str(trace)) in proven.trace


@pytest.mark.parametrize("digits", [10, 80])
def test_enclosures_have_the_digits_that_are_asked_for(digits):
    proven = gearlib.certify(bouncing(), digits=digits)
    names = ("displacement", "velocity", "trace", "determinant")
    for name in (*names, "displacement_min", "displacement_max"):
        enclosure = getattr(proven, name)
        assert enclosure.high - enclosure.low <= 2 * Fraction(10) ** -digits
    # The text of an enclosure is its decimal digits: this displacement is about -0.095.
    assert f"{proven.displacement}".startswith("0.0") or "-0.0" in f"{proven.displacement}"


@pytest.mark.parametrize("seed", range(COUNT))
def test_random_orbits_and_wrong_candidates(seed):
    orbit = random_orbit(seed)
    if orbit is None:
        return
    proven = gearlib.certify(orbit)
    if not proven:
        # The candidate repeats earlier, or is not an isolated one.
        assert proven.status in ("period", "fold", "grazing", "contacts", "distance"), proven
        return
    assert proven.stability == "undecided" or (proven.stability == "stable") == orbit.stable
    if seed % 4 == 0:
        assert faults_of(proven) == []
    for statuses, candidate in candidates_without_orbit(orbit, np.random.default_rng(seed)):
        refused = gearlib.certify(candidate)
        assert not refused and refused.status in statuses, refused
    for candidate in candidates_of_another_pair(orbit):
        other = gearlib.certify(candidate)
        if other:
            # An orbit may lie that close to the candidate, which 50 digits confirm.
            assert other.moved <= MAX_DISTANCE and other.pattern == candidate.pattern
            assert abs(float(other.displacement) - candidate.state[0]) <= 1.01 * MAX_DISTANCE
            if seed % 4 == 0:
                assert faults_of(other) == []


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
def test_wrong_candidate_is_refused(change, status):
    orbit = bouncing()
    change = change | ({"state": np.array(change["state"])} if "state" in change else {})
    refused = gearlib.certify(replace(orbit, **change))
    assert not refused and refused.status == status


def test_orbit_that_touches_the_flank_line_is_refused():
    """Undamped, from rest on the flank line: x = 0 and x' = 0 once in every mesh period."""
    orbit = gearlib.periodic_orbit(pair(contact_ratio=2.0), 0.5, guess=(0.3, 0.0))
    # Constant stiffness c = 1 without damping, nu = 1/2: every motion repeats, this one touches.
    touching = replace(orbit, state=np.array([2.0, 0.0]), pattern=(1,))
    refused = gearlib.certify(touching)
    assert refused.status == "fold"
    tilted = pair(contact_ratio=2.0, damping=1e-4)
    assert not gearlib.certify(replace(touching, pair=tilted))


def test_without_flint_the_message_says_what_to_install(monkeypatch):
    orbit = bouncing()
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(ImportError, match=r"python-flint.*gearlib\[proof\]"):
        gearlib.certify(orbit)
