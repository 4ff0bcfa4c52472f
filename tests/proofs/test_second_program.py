"""The second program on ranges: it confirms what is right and refuses what is not."""

import json
import math

import pytest

import gearlib
from tests.paper import PAPER
from tests.proofs.checker import range_faults

MATERIAL = PAPER.replace(material_damping=3953.7)
DOUBLED = gearlib.GearPair.from_ratios(
    contact_ratio=1.6, stiffness_ratio=0.6, damping=0.02, backlash=math.inf
)


def read(certificate):
    """Return a certificate as a file has it, a copy of its own."""
    assert certificate, certificate
    return json.loads(json.dumps(certificate.as_dict()))


def part(claim, pieces):
    """Return the claim of some of the pieces of a range."""
    return claim | {"start": pieces[0]["start"], "stop": pieces[-1]["stop"], "pieces": pieces}


@pytest.mark.parametrize(
    "pair, start, to, stability, other",
    [
        (MATERIAL, 0.75, 0.755, "stable", "undecided"),
        (PAPER, 0.7, 0.701, "undecided", "stable"),
        (PAPER, 0.66, 0.6601, "unstable", "stable"),
    ],
)
def test_ranges_are_confirmed(pair, start, to, stability, other):
    orbit = gearlib.periodic_orbit(pair, start, guess=(0.5, 0.0))
    claim = read(gearlib.certify_range(orbit, to=to))
    assert claim["stability"] == stability
    assert range_faults(claim) == []
    assert range_faults(part(claim, claim["pieces"][:1]) | {"stability": other}) == ["pieces"]


def changed(claim, at, **values):
    """Return what is found of a claim with other values in one piece."""
    pieces = [dict(piece) for piece in claim["pieces"]]
    pieces[at] |= values
    return range_faults(claim | {"pieces": pieces})


def test_a_range_with_bounces_is_confirmed_and_one_that_is_changed_is_refused():
    whole = read(gearlib.certify_range(gearlib.periodic_orbit(MATERIAL, 0.9), to=0.8999))
    assert whole["pattern"] == [1, 0, 1]
    pieces = whole["pieces"]
    few = part(whole, pieces[:3])
    assert range_faults(few) == []
    assert "cuts" in range_faults(few | {"pieces": [pieces[0], pieces[2]]})
    assert range_faults(few | {"stop": (0.91).hex()}) == ["cuts"]
    assert range_faults(few | {"start": (0.89).hex()}) == ["cuts"]
    backwards = pieces[0] | {"start": pieces[0]["stop"], "stop": pieces[0]["start"]}
    assert range_faults(part(whole, [backwards])) == ["order"]
    two = part(whole, pieces[:2])
    # A box beside the orbit, one that is too wide, one that is too narrow.
    beside = [(float.fromhex(pieces[1]["centre"][0]) + 0.1).hex(), *pieces[1]["centre"][1:]]
    assert "pieces" in changed(two, 1, centre=beside)
    for share in (100.0, 1e-3):
        radii = [(share * float.fromhex(radius)).hex() for radius in pieces[1]["radii"]]
        assert "pieces" in changed(two, 1, radii=radii)
    fewer = [piece | {name: piece[name][:2] for name in ("centre", "radii")} for piece in pieces]
    assert "pieces" in range_faults(part(whole, fewer[:1]) | {"pattern": [1]})


def test_pieces_of_two_branches_are_refused():
    """An orbit of two mesh periods, and the same one looked at a mesh period later."""
    orbit = gearlib.periodic_orbit(DOUBLED, 1.7, period=2, guess=(0.7, 0.9))
    end, _, _ = DOUBLED.propagator(1.7).maps(orbit.state, 1, 10_000)
    later = gearlib.periodic_orbit(DOUBLED, 1.7, period=2, guess=end)
    below, above, other = [
        read(gearlib.certify_range(one, to=to))
        for one, to in ((orbit, 1.69999), (orbit, 1.70001), (later, 1.70001))
    ]
    assert below["pattern"] == other["pattern"]
    joined = below["pieces"][-1:] + above["pieces"][:1]
    assert range_faults(part(below, joined)) == []
    joined = below["pieces"][-1:] + other["pieces"][:1]
    assert range_faults(part(below, joined)) == ["branch"]
