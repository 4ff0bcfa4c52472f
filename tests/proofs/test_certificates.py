"""Compare certificates with a second program and closed forms, and refuse wrong orbits.

``GEARLIB_CERTIFICATES=10000`` tests 10,000 random orbits instead of 40, which takes ten minutes.
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
from tests.proofs.claims import (
    PAIR_DAMPED_IN_CONTACT,
    STOP_OSCILLATOR,
    assert_wrong_orbits_are_refused,
    json_claim,
)

RANDOM_ORBIT_COUNT = int(os.environ.get("GEARLIB_CERTIFICATES", "40"))


def contradictions_of(certificate):
    """Return the names of the parts of a certificate that an independent orbit contradicts.

    The independent orbit is computed with 50 digits from the JSON claim alone.
    """
    claim = json_claim(certificate)
    if not isinstance(certificate.model, gearlib.GearPair):
        claim["model"] = describe(certificate.model)
    return find_contradictions(claim)


def pair_from_ratios(**ratios):
    """Return a `GearPair` with contact ratio 1.6 and stiffness ratio 0.6 unless given."""
    default_ratios = {"contact_ratio": 1.6, "stiffness_ratio": 0.6}
    return gearlib.GearPair.from_ratios(**default_ratios | ratios)


@cache
def bouncing_orbit():
    """Return an orbit of the paper's pair that loses contact once in a mesh period."""
    return gearlib.periodic_orbit(PAIR_DAMPED_IN_CONTACT, 0.815)


#: A pair whose static deflection and eigenfrequency are 1, so that no ratio is rounded.
FORCED_PAIR = gearlib.OneDegreePair(
    pair=gearlib.GearPair(
        max_stiffness=1.0, stiffness_ratio=0.5, contact_ratio=2.0, reduced_mass=1.0, load=1.0,
        backlash=2.0, material_damping=0.125,
    ),
    excitation=gearlib.Harmonics((0.25,), (0.0, 0.5)),
    deviation=gearlib.Harmonics((0.0, 0.25)),
)  # fmt: skip
UNGROUNDED_STOP = replace(
    STOP_OSCILLATOR, ground_stiffness=0.0, damping=0.0, lower_damping=0.15, load=0.25
)
DISTANT_STOPS = replace(STOP_OSCILLATOR, ground_stiffness=0.3, upper_edge=50.0, lower_edge=-50.0)
#: Model, tuning, guess, period and stability of each orbit; None if the stability is not known.
CASES = {
    "two contacts": (PAIR_DAMPED_IN_CONTACT, 0.9, None, 1, "stable"),
    "no contact lost": (PAIR_DAMPED_IN_CONTACT, 0.7, None, 1, "stable"),
    "coast-side contact": (pair_from_ratios(damping=0.02, backlash_ratio=1.0), 0.7, None, 1, None),
    "another damping in free flight": (
        PAPER_PAIR.replace(backlash_damping=3953.7), 0.82, None, 1, "stable",
    ),
    "two mesh periods": (pair_from_ratios(damping=0.03, backlash_ratio=4.0), 2.0, None, 2, None),
    "no backlash": (pair_from_ratios(damping=0.05, backlash_ratio=0.0), 0.95, None, 1, None),
    "endless backlash": (pair_from_ratios(damping=0.05), 0.9, None, 1, None),
    "constant stiffness": (
        pair_from_ratios(damping=0.05, contact_ratio=2.0), 0.9, (1.1, 0.0), 1, "stable",
    ),
    "the lower stiffness alone": (
        pair_from_ratios(damping=0.05, contact_ratio=1.0), 0.9, (1.1, 0.0), 1, "stable",
    ),
    "over-damped": (pair_from_ratios(damping=1.4, backlash_ratio=3.0), 0.8, None, 1, "stable"),
    "undamped, elliptic": (pair_from_ratios(), 1.3, (1.0, 0.0), 1, "undecided"),
    "undamped, in a tongue": (pair_from_ratios(), 2.0, (1.0, 0.0), 1, "unstable"),
    "forced": (FORCED_PAIR, 0.75, (1.0, 0.0), 1, "stable"),
    "stop": (STOP_OSCILLATOR, 0.5, (1.0, 0.0), 1, "stable"),
    "stop of high speed": (STOP_OSCILLATOR, 0.8, (1.0, 0.0), 1, "stable"),
    "free": (UNGROUNDED_STOP, 0.6, (1.0, 0.0), 1, "stable"),
    "never in contact": (DISTANT_STOPS, 0.8, None, 1, "stable"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_certificate_agrees_with_the_orbit_and_with_50_digits(case):
    """The enclosures must contain the orbit that was found and an independent one of 50 digits."""
    model, tuning, guess, period, stability = CASES[case]
    orbit = gearlib.periodic_orbit(model, tuning, guess=guess, period=period)
    proven = gearlib.certify(orbit)
    assert contradictions_of(proven) == []
    assert proven.pattern == orbit.pattern and stability in (proven.stability, None)
    # The residual of the candidate is 1e-12, and no case is close to a fold.
    assert abs(float(proven.displacement) - orbit.state[0]) < 1e-9
    for real, imaginary in proven.multipliers:
        is_real = imaginary.low == imaginary.high == 0
        imaginary_text = "" if is_real else f", i ({imaginary})"
        assert f"  multiplier    {real}{imaginary_text}" in repr(proven).splitlines()


def test_constant_stiffness_rests_at_the_static_deflection():
    """At constant stiffness the enclosures must contain the closed forms of a damped oscillator."""
    model = gearlib.GearPair.from_ratios(contact_ratio=2.0, stiffness_ratio=0.5, damping=0.25)
    orbit = gearlib.periodic_orbit(model, 0.5, guess=(1.0, 0.0))
    proven = gearlib.certify(orbit, digits=40)
    # All parameters are binary fractions, so that no parameter is rounded.
    assert 1 in proven.displacement and 0 in proven.velocity
    assert 1 in proven.displacement_min and 1 in proven.displacement_max
    with mpmath.workdps(60):
        # At tuning 1/2 a mesh period has the length 4 pi in units of the eigenfrequency, in which
        # the motion decays by exp(-4 pi / 4) and oscillates with the frequency sqrt(1 - 1/16).
        decay = mpmath.exp(-mpmath.pi)
        trace = 2 * decay * mpmath.cos(4 * mpmath.pi * mpmath.sqrt(mpmath.mpf(15) / 16))
        assert Fraction(str(decay**2)) in proven.determinant
        assert Fraction(str(trace)) in proven.trace


@pytest.mark.parametrize("digits", [10, 80])
def test_enclosures_have_the_requested_number_of_digits(digits):
    """The width of each enclosure must be at most two units of the last requested digit."""
    proven = gearlib.certify(bouncing_orbit(), digits=digits)
    names = ("displacement", "velocity", "trace", "determinant")
    for name in (*names, "displacement_min", "displacement_max"):
        enclosure = getattr(proven, name)
        assert enclosure.high - enclosure.low <= 2 * Fraction(10) ** -digits
    # The displacement is about -0.095 and is printed in decimal digits.
    assert "-0.0" in f"{proven.displacement}"


def random_orbit(rng):
    """Return an orbit of a random pair at a random tuning, or None if none was found.

    Some pairs have constant stiffness, no damping, a damping ratio above 1, or a backlash that is
    zero or infinite.
    """
    contact_ratio, damping = rng.uniform(1.02, 1.98), rng.uniform(0.02, 0.2)
    pair = gearlib.GearPair.from_ratios(
        contact_ratio=float(rng.choice([1.0, 2.0, contact_ratio], p=[0.03, 0.03, 0.94])),
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


@pytest.mark.parametrize("seed", range(RANDOM_ORBIT_COUNT))
def test_random_orbits_are_certified_and_wrong_orbits_are_refused(seed):
    """Certified stability must match the multipliers, and changed orbits must be refused."""
    rng = np.random.default_rng(seed)
    orbit = random_orbit(rng)
    if orbit is None:
        return
    proven = gearlib.certify(orbit)
    if not proven:
        # The orbit has a smaller period, is not isolated or almost grazes.
        assert proven.status in ("period", "fold", "grazing", "contacts", "distance"), proven
        return
    assert proven.stability == "undecided" or (proven.stability == "stable") == orbit.stable
    if seed % 4 == 0:  # the comparison with 50 digits takes long
        assert contradictions_of(proven) == []
    state_change = rng.normal(size=2)
    state_change /= np.abs(state_change * [1.0, orbit.tuning]).max()
    state_change *= 10.0 ** rng.uniform(-7.0, -1.0)
    assert_wrong_orbits_are_refused(orbit, state_change)


@pytest.mark.parametrize(
    "change, status",
    [
        ({"state": np.array((-0.0953, -0.3086))}, "distance"),
        ({"tuning": 0.8151}, "distance"),
        ({"model": PAPER_PAIR}, "distance"),
        ({"period": 2}, "contacts"),
        ({"pattern": (1,)}, "contacts"),
        ({"model": gearlib.OneDegreePair(pair=PAIR_DAMPED_IN_CONTACT, cubic_damping=1.0)}, "model"),
    ],
)
def test_a_wrong_orbit_is_refused_with_the_reason(change, status):
    refusal = gearlib.certify(replace(bouncing_orbit(), **change))
    assert not refusal and refusal.status == status


def test_an_orbit_with_a_smaller_period_is_refused():
    # The orbit gains and loses contact once in each mesh period and then repeats.
    refusal = gearlib.certify(replace(bouncing_orbit(), period=3, pattern=(0, *(1, 0) * 3)))
    assert refusal.status == "period" and "already repeat after 1 mesh period" in refusal.message


def test_an_orbit_that_touches_a_flank_line_is_refused():
    """An orbit that touches the flank line in each mesh period must not be certified."""
    orbit = gearlib.periodic_orbit(pair_from_ratios(contact_ratio=2.0), 0.5, guess=(0.3, 0.0))
    # At constant stiffness and a tuning of 1/2 every undamped motion is periodic, and the motion
    # from rest at twice the static deflection just touches the flank line x = 0.
    touching_orbit = replace(orbit, state=np.array([2.0, 0.0]), pattern=(1,))
    assert gearlib.certify(touching_orbit).status == "fold"
    damped_pair = pair_from_ratios(contact_ratio=2.0, damping=1e-4)
    assert not gearlib.certify(replace(touching_orbit, model=damped_pair))


def test_without_flint_the_message_names_the_package_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(ImportError, match=r"python-flint.*gearlib\[proof\]"):
        gearlib.certify(bouncing_orbit())
