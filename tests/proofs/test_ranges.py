"""Certified ranges of tunings: where they end, and which ones are refused."""

import re
from dataclasses import replace

import numpy as np
import pytest

import gearlib
from tests.independent.certificates import find_contradictions
from tests.paper import PAPER_PAIR
from tests.proofs.claims import PAIR_DAMPED_IN_CONTACT, json_claim


@pytest.mark.parametrize(
    "pair, start, to, guess, status, special_tuning",
    [
        (PAIR_DAMPED_IN_CONTACT, 0.6, 0.803, (0.5, 0.0), "grazing", 0.8020519930),
        (PAIR_DAMPED_IN_CONTACT, 0.815, 0.817, None, "fold", 0.8160450454),
        (PAPER_PAIR, 0.64, 0.66, (0.5, 0.0), "stability", 0.6556243338),
    ],
)
def test_a_proven_range_ends_at_a_grazing_a_fold_or_a_tongue_edge(
    pair, start, to, guess, status, special_tuning
):
    """A range must be proven up to the special tuning, where the orbit changes its character."""
    orbit = gearlib.periodic_orbit(pair, start, guess=guess)
    refusal = gearlib.certify_range(orbit, to=to)
    proven_to = float(re.search(r"to ([\d.]+); beyond it", refusal.message).group(1))
    # Near a fold the orbit changes like a square root, so that the proof ends 2e-7 below it.
    assert refusal.status == status and special_tuning - 2e-7 < proven_to < special_tuning + 1e-9
    proven = gearlib.certify_range(orbit, to=special_tuning - 1e-5)
    assert (proven.start, proven.stop) == (start, special_tuning - 1e-5)
    for tuning in np.linspace(start, special_tuning - 1e-5, 3):
        orbit = gearlib.periodic_orbit(pair, tuning, guess=orbit.state)
        certificate = gearlib.certify(orbit)
        assert (certificate.pattern, certificate.stability) == (proven.pattern, proven.stability)


def test_a_range_towards_lower_tuning_has_ascending_ends():
    """A range that is certified downwards must list its lower end first."""
    proven = gearlib.certify_range(gearlib.periodic_orbit(PAIR_DAMPED_IN_CONTACT, 0.9), to=0.895)
    assert (proven.start, proven.stop, proven.stability) == (0.895, 0.9, "stable")
    assert proven.pattern == (1, 0, 1) and "Proven" in repr(proven)
    assert json_claim(proven)["start"] == (0.895).hex()


def test_a_range_without_length_orbit_or_proof_is_refused():
    """A range is refused if it is empty, starts from a wrong state or has an unsupported model."""
    orbit = gearlib.periodic_orbit(PAIR_DAMPED_IN_CONTACT, 0.7)
    with pytest.raises(ValueError, match="different from the tuning"):
        gearlib.certify_range(orbit, to=0.7)
    wrong_orbit = replace(orbit, state=orbit.state + 1e-6)
    assert gearlib.certify_range(wrong_orbit, to=0.71).status == "distance"
    deviating = gearlib.OneDegreePair(
        pair=PAIR_DAMPED_IN_CONTACT, deviation=gearlib.Harmonics((1e-9,))
    )
    refusal = gearlib.certify_range(gearlib.periodic_orbit(deviating, 0.7), to=0.71)
    assert refusal.status == "model"


def test_a_range_of_a_mesh_at_rest_is_proven():
    """At constant stiffness the mesh stays in its static state without events at any tuning."""
    resting = gearlib.GearPair.from_ratios(contact_ratio=2.0, stiffness_ratio=0.6, damping=0.05)
    assert gearlib.certify_range(gearlib.periodic_orbit(resting, 0.6), to=0.9).pattern == (1,)


@pytest.mark.parametrize(
    "pair, start, to, stability",
    [
        (PAIR_DAMPED_IN_CONTACT, 0.75, 0.755, "stable"),
        (PAPER_PAIR, 0.7, 0.701, "undecided"),
        (PAPER_PAIR, 0.66, 0.6601, "unstable"),
    ],
)
def test_orbits_in_50_digits_lie_in_the_proven_range(pair, start, to, stability):
    """Independent orbits of 50 digits must not contradict a claim about all tunings of a range."""
    orbit = gearlib.periodic_orbit(pair, start, guess=(0.5, 0.0))
    claim = json_claim(gearlib.certify_range(orbit, to=to))
    assert claim["stability"] == stability
    # The check is limited to the last two pieces of the range to save time.
    pieces = claim["pieces"][-2:]
    limited_range = {"start": pieces[0]["start"], "stop": pieces[-1]["stop"], "pieces": pieces}
    assert find_contradictions(claim | limited_range) == []


def test_a_range_of_a_train_is_proven():
    orbit = gearlib.periodic_orbit(gearlib.idler(PAPER_PAIR.replace(material_damping=1500.0)), 0.7)
    proven = gearlib.certify_range(orbit, to=0.701)
    assert proven and proven.stability == "stable" and proven.train.contacts == (1, 1)
