"""Certificates against a second program, closed forms and wrong candidates.

``GEARLIB_CERTIFICATES=10000`` takes so many random orbits in place of a few: ten minutes.
"""

import os
import sys
from dataclasses import replace
from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest

import gearlib
from gearlib.analysis.orbits.shooting import NoOrbit
from tests.independent.certificates import find_contradictions
from tests.independent.systems import describe
from tests.paper import PAPER_PAIR
from tests.proofs.claims import MATERIAL, STOP, assert_wrong_candidates_are_refused, claim_of

COUNT = int(os.environ.get("GEARLIB_CERTIFICATES", "40"))


def contradictions_of(certificate):
    """Return the parts of a certificate, as JSON, that an orbit in 50 digits contradicts."""
    claim = claim_of(certificate)
    if not isinstance(certificate.model, gearlib.GearPair):
        claim["model"] = describe(certificate.model)
    return find_contradictions(claim)


def pair(**ratios):
    """Return a pair with the ratios 1.6 and 0.6 of contact and stiffness, unless changed."""
    return gearlib.GearPair.from_ratios(**{"contact_ratio": 1.6, "stiffness_ratio": 0.6} | ratios)


@cache
def bouncing_orbit():
    """Return the orbit of a pair that loses contact once in a mesh period."""
    return gearlib.periodic_orbit(MATERIAL, 0.815)


#: A pair whose static deflection and eigenfrequency are 1, so that ratios are not rounded.
FORCED = gearlib.OneDegreePair(
    pair=gearlib.GearPair(
        max_stiffness=1.0, stiffness_ratio=0.5, contact_ratio=2.0, reduced_mass=1.0, load=1.0,
        backlash=2.0, material_damping=0.125,
    ),
    excitation=gearlib.Harmonics((0.25,), (0.0, 0.5)),
    deviation=gearlib.Harmonics((0.0, 0.25)),
)  # fmt: skip
FREE = replace(STOP, ground_stiffness=0.0, damping=0.0, lower_damping=0.15, load=0.25)
FAR = replace(STOP, ground_stiffness=0.3, upper_edge=50.0, lower_edge=-50.0)
#: Model, tuning, guess, period and, if known, stability of each orbit.
CASES = {
    "two contacts": (MATERIAL, 0.9, None, 1, "stable"),
    "no contact lost": (MATERIAL, 0.7, None, 1, "stable"),
    "coast-side contact": (pair(damping=0.02, backlash_ratio=1.0), 0.7, None, 1, None),
    "another damping in free flight": (
        PAPER_PAIR.replace(backlash_damping=3953.7), 0.82, None, 1, "stable",
    ),
    "two mesh periods": (pair(damping=0.03, backlash_ratio=4.0), 2.0, None, 2, None),
    "no backlash": (pair(damping=0.05, backlash_ratio=0.0), 0.95, None, 1, None),
    "endless backlash": (pair(damping=0.05), 0.9, None, 1, None),
    "constant stiffness": (pair(damping=0.05, contact_ratio=2.0), 0.9, (1.1, 0.0), 1, "stable"),
    "the lower stiffness alone": (
        pair(damping=0.05, contact_ratio=1.0), 0.9, (1.1, 0.0), 1, "stable",
    ),
    "over-damped": (pair(damping=1.4, backlash_ratio=3.0), 0.8, None, 1, "stable"),
    "undamped, elliptic": (pair(), 1.3, (1.0, 0.0), 1, "undecided"),
    "undamped, in a tongue": (pair(), 2.0, (1.0, 0.0), 1, "unstable"),
    "forced": (FORCED, 0.75, (1.0, 0.0), 1, "stable"),
    "stop": (STOP, 0.5, (1.0, 0.0), 1, "stable"),
    "stop of high speed": (STOP, 0.8, (1.0, 0.0), 1, "stable"),
    "free": (FREE, 0.6, (1.0, 0.0), 1, "stable"),
    "never in contact": (FAR, 0.8, None, 1, "stable"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_orbit_is_proven_and_confirmed_in_50_digits(case):
    """The certificate must contain the orbit found, and no part may contradict 50 digits."""
    model, tuning, guess, period, stability = CASES[case]
    orbit = gearlib.periodic_orbit(model, tuning, guess=guess, period=period)
    proven = gearlib.certify(orbit)
    assert contradictions_of(proven) == []
    assert proven.pattern == orbit.pattern and stability in (proven.stability, None)
    # The residual of the candidate is 1e-12, and no case is close to a fold.
    assert abs(float(proven.displacement) - orbit.state[0]) < 1e-9
    for real, imaginary in proven.multipliers:
        bare = not imaginary.low and not imaginary.high
        words = f"  multiplier    {real}" + ("" if bare else f", i ({imaginary})")
        assert words in repr(proven).splitlines()


def test_constant_stiffness_rests_at_the_static_deflection():
    """Enclosures at constant stiffness must contain the exact rest state, trace and determinant."""
    model = gearlib.GearPair.from_ratios(contact_ratio=2.0, stiffness_ratio=0.5, damping=0.25)
    orbit = gearlib.periodic_orbit(model, 0.5, guess=(1.0, 0.0))
    proven = gearlib.certify(orbit, digits=40)
    # All parameters are exact in binary, so that enclosures must contain these closed forms.
    assert 1 in proven.displacement and 0 in proven.velocity
    assert 1 in proven.displacement_min and 1 in proven.displacement_max
    with mpmath.workdps(60):
        decay = mpmath.exp(-mpmath.pi)
        trace = 2 * decay * mpmath.cos(4 * mpmath.pi * mpmath.sqrt(mpmath.mpf(15) / 16))
        assert Fraction(str(decay**2)) in proven.determinant
        assert Fraction(str(trace)) in proven.trace


@pytest.mark.parametrize("digits", [10, 80])
def test_enclosures_have_the_requested_number_of_digits(digits):
    """Each enclosure must be at most two units of the last requested digit wide."""
    proven = gearlib.certify(bouncing_orbit(), digits=digits)
    names = ("displacement", "velocity", "trace", "determinant")
    for name in (*names, "displacement_min", "displacement_max"):
        enclosure = getattr(proven, name)
        assert enclosure.high - enclosure.low <= 2 * Fraction(10) ** -digits
    # An enclosure is printed in decimal digits; this displacement is about -0.095.
    assert f"{proven.displacement}".startswith("0.0") or "-0.0" in f"{proven.displacement}"


def random_orbit(rng):
    """Return an orbit of a random pair at a random tuning, or None if none was found.

    Some pairs have constant stiffness, no damping, a damping ratio above 1, no or infinite
    backlash.
    """
    ratio, damping = rng.uniform(1.02, 1.98), rng.uniform(0.02, 0.2)
    pair = gearlib.GearPair.from_ratios(
        contact_ratio=float(rng.choice([1.0, 2.0, ratio], p=[0.03, 0.03, 0.94])),
        stiffness_ratio=float(rng.uniform(0.2, 1.0)),
        damping=float(rng.choice([0.0, 0.1 * damping, damping, 1.3], p=[0.1, 0.4, 0.47, 0.03])),
        backlash_damping=float(rng.choice([0.0, rng.uniform(0.0, 0.2)])),
        backlash_ratio=float(rng.choice([0.0, np.inf, rng.uniform(0.1, 8.0)], p=[0.05, 0.1, 0.85])),
    )
    guess = None if rng.random() < 0.3 else tuple(rng.normal(0.0, 1.5, 2))
    tuning = float(rng.uniform(0.3, 2.4))
    for period in rng.permutation([1, 2, 3, 4])[:2]:
        try:
            return gearlib.periodic_orbit(pair, tuning, guess=guess, period=int(period))
        except NoOrbit:
            continue
    return None


@pytest.mark.parametrize("seed", range(COUNT))
def test_random_orbits_are_proven_and_wrong_candidates_refused(seed):
    """Certify random orbits, compare their stability and refuse displaced candidates."""
    rng = np.random.default_rng(seed)
    orbit = random_orbit(rng)
    if orbit is None:
        return
    proven = gearlib.certify(orbit)
    if not proven:
        # The candidate has a smaller period, or the orbit is not isolated.
        assert proven.status in ("period", "fold", "grazing", "contacts", "distance"), proven
        return
    assert proven.stability == "undecided" or (proven.stability == "stable") == orbit.stable
    if seed % 4 == 0:
        assert contradictions_of(proven) == []
    shift = rng.normal(size=2)
    shift *= 10.0 ** rng.uniform(-7.0, -1.0) / np.abs(shift * [1.0, orbit.tuning]).max()
    assert_wrong_candidates_are_refused(orbit, shift)


@pytest.mark.parametrize(
    "change, status",
    [
        ({"state": np.array((-0.0953, -0.3086))}, "distance"),
        ({"tuning": 0.8151}, "distance"),
        ({"model": PAPER_PAIR}, "distance"),
        ({"period": 2}, "contacts"),
        ({"pattern": (1,)}, "contacts"),
        ({"model": gearlib.OneDegreePair(pair=MATERIAL, cubic_damping=1.0)}, "model"),
    ],
)
def test_a_wrong_candidate_is_refused(change, status):
    refused = gearlib.certify(replace(bouncing_orbit(), **change))
    assert not refused and refused.status == status


def test_an_orbit_with_a_smaller_period_is_refused():
    refused = gearlib.certify(replace(bouncing_orbit(), period=3, pattern=(0, *(1, 0) * 3)))
    assert refused.status == "period" and "already repeat after 1 mesh period" in refused.message


def test_an_orbit_that_touches_a_flank_line_is_refused():
    """Undamped motion from rest on the flank line touches it once in every mesh period."""
    orbit = gearlib.periodic_orbit(pair(contact_ratio=2.0), 0.5, guess=(0.3, 0.0))
    # At constant stiffness and nu = 1/2 every undamped motion repeats, and this one touches the
    # line.
    touching = replace(orbit, state=np.array([2.0, 0.0]), pattern=(1,))
    assert gearlib.certify(touching).status == "fold"
    tilted = pair(contact_ratio=2.0, damping=1e-4)
    assert not gearlib.certify(replace(touching, model=tilted))


def test_without_flint_the_message_names_the_package_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(ImportError, match=r"python-flint.*gearlib\[proof\]"):
        gearlib.certify(bouncing_orbit())
