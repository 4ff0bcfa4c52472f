"""Certificates of trains against a second program, wrong candidates, and the proofs of a pair."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import gearlib
from gearlib.analysis.proofs import krawczyk
from gearlib.analysis.proofs.arc_laws import ArcDynamics
from gearlib.analysis.proofs.balls import precision
from gearlib.analysis.proofs.certificate_files import ProofFailed
from gearlib.analysis.proofs.path import Path
from gearlib.analysis.proofs.signs import check_contacts
from tests.independent.certificates import Motion
from tests.paper import PAPER_PAIR
from tests.proofs.claims import assert_wrong_candidates_are_refused, claim_of
from tests.properties.known_models import ALL_EXCITATIONS, gears_on_bearings

LIGHT = PAPER_PAIR.replace(material_damping=1500.0)
GEAR = {"teeth": 18, "base_radius": 0.036, "inertia": 4e-3}
FLANK = dict(max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.6, backlash=15e-6)
DAMPED_FLANK = FLANK | {"material_damping": 1500.0, "backlash_damping": 200.0}


def chain():
    """Return a train of two meshes and a shaft with every feature of a mesh."""
    torque = 3000.0 * 0.036
    support = {"mass": 3.0, "support_stiffness": (2e8, math.inf), "support_damping": 300.0}
    bodies = [
        gearlib.Body(name="in", torque=torque, **GEAR),
        gearlib.Body(name="left", **support, **GEAR),
        gearlib.Body(name="right", offset=(3e-6, 2e-6), **GEAR),
        gearlib.Body(name="out", torque=-torque, **GEAR),
    ]
    # The wheel drives the first mesh.
    first = {"name": "in-left", "pinion": "left", "wheel": "in", "driving": "in"}
    first |= {"friction": (0.06, 0.04), "pitch_phase": -0.7, "tooth_thickness": (0.53, 0.46)}
    first |= {"deviation": gearlib.Harmonics((1e-6, 5e-7), (3e-7,)), "position": 0.4 - math.pi}
    second = {"pinion": "right", "wheel": "out", "direction": -1, "position": 2.0, "error": 1e-6}
    second |= {"phase": 0.3, "coast_phase": 0.55, "material_damping": 1200.0}
    inverse = gearlib.Harmonics((), (4e-7,))
    meshes = [
        gearlib.Mesh(coast_deviation=inverse, **first, **DAMPED_FLANK),
        gearlib.Mesh(**second, **FLANK),
    ]
    shafts = [gearlib.Shaft(bodies=("left", "right"), stiffness=4e5, damping=1.0)]
    return gearlib.GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


def branches():
    """Return a gear that drives two equal gears in phase, so that their contacts coincide."""
    bodies = [gearlib.Body(name="centre", torque=200.0, **GEAR)]
    bodies += [gearlib.Body(name=name, torque=100.0, **GEAR) for name in ("left", "right")]
    meshes = [
        gearlib.Mesh(pinion="centre", wheel=name, position=position, phase=0.0, **DAMPED_FLANK)
        for name, position in (("left", 0.0), ("right", 2.0))
    ]
    return gearlib.GearTrain(bodies=bodies, meshes=meshes)


#: Gears whose coast sides move with the bearings and come into contact.
BEARINGS = gears_on_bearings(
    1e9, 600.0, 300.0, backlash=12e-6, **ALL_EXCITATIONS | {"teeth": (1, 1)}
)
#: Model, tuning, number of contact events and stability of each orbit.
CASES = {
    "idler": (gearlib.idler(LIGHT), 0.6, 4, "stable"),
    "parametric resonance": (gearlib.idler(LIGHT), 1.0, 0, "unstable"),
    "chain": (chain(), 0.8, 8, "stable"),
    "branches": (branches(), 1.5, 8, "stable"),
    "bearings": (BEARINGS, 1.0, 4, "stable"),
}


@cache
def orbit_of(case):
    """Return the periodic orbit of a case."""
    model, tuning, _, stability = CASES[case]
    # Motions near an unstable orbit are chaotic, so that rounding would decide on a simulated
    # guess.
    guess = model.start_state("static") if stability == "unstable" else None
    return gearlib.periodic_orbit(model, tuning, guess=guess)


@pytest.mark.parametrize("case", CASES)
def test_orbit_in_50_digits_lies_in_its_enclosures(case):
    """An independent orbit in 50 digits must lie in the enclosures; wrong ones must be noticed."""
    _, _, contacts, stability = CASES[case]
    proven = gearlib.certify(orbit_of(case), digits=20)
    motion = Motion(claim_of(proven))
    assert (contacts, stability) == (len(proven.events), proven.stability)
    other = motion.orbit()
    assert motion.find_contradictions(other) == []
    # The check must notice wrong enclosures.
    motion.claim["multipliers"][0][0] = ["2", "2.1"]
    motion.claim["displacement"][motion.free_coordinates[0]] = ["7", "7.1"]
    assert motion.find_contradictions(other) == ["displacement", "multiplier"]


@pytest.mark.parametrize("case", ["idler", "parametric resonance", "chain", "branches"])
def test_wrong_candidates_are_refused(case):
    """A displaced state or tuning must not be certified as an orbit."""
    orbit = orbit_of(case)
    assert_wrong_candidates_are_refused(orbit, np.repeat([0.0, 1e-6], orbit.state.size // 2))
    refused = gearlib.certify(replace(orbit, tuning=orbit.tuning * (1.0 + 1e-5)), digits=10)
    assert not refused and refused.status in ("distance", "contacts")


def test_orbits_that_cannot_be_proven_are_refused(monkeypatch):
    """A refusal must state its reason: wrong period, rotating frame or too many events."""
    two = gearlib.two_stage(LIGHT)
    orbit = gearlib.periodic_orbit(two, 1.0, period=two.repeats)
    assert gearlib.certify(replace(orbit, period=1)).status in ("period", "contacts")
    turning = gearlib.planetary(turning=True, gyroscopic=True)
    refused = gearlib.certify(replace(orbit, model=turning))
    assert refused.status == "model" and "frame" in refused.message
    monkeypatch.setattr("gearlib.analysis.proofs.path.MAX_ARCS", 10)
    refused = gearlib.certify(orbit)
    assert refused.status == "together" and "too many" in refused.message


@pytest.mark.parametrize("tuning", [0.6, 0.651837])
def test_unlisted_contacts_are_noticed(tuning):
    """An orbit computed without contact loss dips below flank lines, by 2 and by 1e-3.

    The smaller dip lies within an arc, at whose ends nothing of it is seen.
    """
    with precision(128):
        dynamics = ArcDynamics(gearlib.idler(LIGHT), tuning)
        path = Path(dynamics, [1, 1], [], 1)
        start = dynamics.initial_state(orbit_of("parametric resonance").state)
        box = krawczyk.enclose_zero(path.equations, *krawczyk.refine_zero(path.equations, start))
        _, _, arcs, ends = path.equations(box)
        with pytest.raises(ProofFailed) as error:
            check_contacts(path, arcs, ends, box[dynamics.state_count :])
        assert error.value.args[0] == "grazing"
