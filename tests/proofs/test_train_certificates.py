"""Certificates of trains against a second program, wrong candidates, and the proofs of a pair."""

import json
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
from gearlib.analysis.proofs.orbits import MAX_DISTANCE
from gearlib.analysis.proofs.path import Path
from gearlib.analysis.proofs.signs import check_contacts
from tests.independent.certificates import Motion
from tests.paper import PAPER
from tests.properties.known_models import EVERYTHING, gears

LIGHT = PAPER.replace(material_damping=1500.0)
GEAR = {"teeth": 18, "base_radius": 0.036, "inertia": 4e-3}
FLANK = dict(max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.6, backlash=15e-6)
DAMPED_FLANK = FLANK | {"material_damping": 1500.0, "backlash_damping": 200.0}


def chain():
    """Return a train of two meshes and a shaft, with all that a mesh may have."""
    torque = 3000.0 * 0.036
    support = {"mass": 3.0, "support_stiffness": (2e8, math.inf), "support_damping": 300.0}
    bodies = [
        gearlib.Body(name="in", torque=torque, **GEAR),
        gearlib.Body(name="left", **support, **GEAR),
        gearlib.Body(name="right", offset=(3e-6, 2e-6), **GEAR),
        gearlib.Body(name="out", torque=-torque, **GEAR),
    ]
    meshes = [
        # The wheel drives.
        gearlib.Mesh(
            name="in-left",
            pinion="left",
            wheel="in",
            driving="in",
            position=0.4 - math.pi,
            friction=(0.06, 0.04),
            pitch_phase=-0.7,
            tooth_thickness=(0.53, 0.46),
            deviation=gearlib.Harmonics((1e-6, 5e-7), (3e-7,)),
            inverse_deviation=gearlib.Harmonics((), (4e-7,)),
            **DAMPED_FLANK,
        ),
        gearlib.Mesh(
            pinion="right",
            wheel="out",
            direction=-1,
            position=2.0,
            phase=0.3,
            inverse_phase=0.55,
            material_damping=1200.0,
            error=1e-6,
            **FLANK,
        ),
    ]
    shafts = [gearlib.Shaft(bodies=("left", "right"), stiffness=4e5, damping=1.0)]
    return gearlib.GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


def branches():
    """Return a gear that drives two equal gears in phase, whose contacts coincide."""
    bodies = [gearlib.Body(name="centre", torque=200.0, **GEAR)]
    bodies += [gearlib.Body(name=name, torque=100.0, **GEAR) for name in ("left", "right")]
    meshes = [
        gearlib.Mesh(pinion="centre", wheel=name, position=position, phase=0.0, **DAMPED_FLANK)
        for name, position in (("left", 0.0), ("right", 2.0))
    ]
    return gearlib.GearTrain(bodies=bodies, meshes=meshes)


def moving():
    """Return the chain with a coast side that moves with the axes, and comes into contact."""
    train = chain()
    mesh = replace(train.meshes[0], moving_backlash=True, backlash=8e-6)
    return train.replace(meshes=[mesh, *train.meshes[1:]])


#: Name -> model, tuning, number of contact events, the stability; None where not known.
CASES = {
    "idler": (gearlib.idler(LIGHT), 0.6, 4, "stable"),
    "parametric resonance": (gearlib.idler(LIGHT), 1.0, 0, "unstable"),
    "chain": (chain(), 0.8, 8, "stable"),
    "coast side that moves": (moving(), 0.8, None, None),
    "branches": (branches(), 1.5, 8, "stable"),
    "bearings": (
        gears(1e9, 600.0, 300.0, backlash=12e-6, **EVERYTHING | {"teeth": (1, 1)}),
        1.0,
        4,
        "stable",
    ),
}


@cache
def orbit_of(case):
    model, tuning, _, stability = CASES[case]
    # Beside an unstable orbit motions are chaotic: from where one begins rounding would decide.
    guess = model.start_state("static") if stability == "unstable" else None
    return gearlib.periodic_orbit(model, tuning, guess=guess)


def claim_of(certificate):
    """Return a certificate as its JSON file has it."""
    return json.loads(json.dumps(certificate.as_dict()))


@pytest.mark.parametrize("case", CASES)
def test_orbit_in_50_digits_lies_in_its_enclosures(case):
    _, _, contacts, stability = CASES[case]
    orbit = orbit_of(case)
    proven = gearlib.certify(orbit, digits=20)
    assert proven, proven
    assert contacts in (len(proven.events), None) and stability in (proven.stability, None)
    motion = Motion(claim_of(proven))
    other = motion.orbit()
    assert motion.faults(other) == []
    # Wrong enclosures are noticed.
    motion.claim["multipliers"][0][0] = ["2", "2.1"]
    motion.claim["displacement"][motion.kept[0]] = ["7", "7.1"]
    assert motion.faults(other) == ["displacement", "multiplier"]


def candidates_without_orbit(orbit):
    """Yield (allowed statuses of the refusal, candidate that no orbit is near to)."""
    shift = np.zeros(orbit.state.size)
    for place in range(orbit.state.size // 2 - 1, orbit.state.size, 2):
        shift[place] = 1e-6
        yield ("distance", "contacts"), replace(orbit, state=orbit.state + shift)
    yield ("period", "contacts"), replace(orbit, period=2 * orbit.period)
    doubled = (*orbit.pattern, *orbit.pattern[1:])
    if len(orbit.pattern) > len(orbit.pair.mesh_names):
        yield ("period",), replace(orbit, period=2 * orbit.period, pattern=doubled)
        yield ("contacts",), replace(orbit, pattern=orbit.pattern[:-2])
        yield ("contacts",), replace(orbit, pattern=(*orbit.pattern, 0, 1))
    yield ("distance", "contacts"), replace(orbit, tuning=orbit.tuning * (1.0 + 1e-5))


def candidates_of_another_train(orbit):
    """Yield candidates with a parameter of the train that differs by 1e-5."""
    train = orbit.pair
    for name in ("max_stiffness", "material_damping", "contact_ratio", "backlash"):
        mesh = train.meshes[0]
        meshes = [replace(mesh, **{name: getattr(mesh, name) * (1.0 - 1e-5)}), *train.meshes[1:]]
        yield replace(orbit, pair=train.replace(meshes=meshes))
    body = train.bodies[0]
    bodies = [replace(body, inertia=body.inertia * (1.0 + 1e-5)), *train.bodies[1:]]
    yield replace(orbit, pair=train.replace(bodies=bodies))


@pytest.mark.parametrize("case", ["idler", "parametric resonance", "chain", "branches"])
def test_wrong_candidates_are_refused_unless_an_orbit_is_near(case):
    orbit = orbit_of(case)
    for statuses, candidate in candidates_without_orbit(orbit):
        refused = gearlib.certify(candidate, digits=10)
        assert not refused and refused.status in statuses, refused
    for candidate in candidates_of_another_train(orbit):
        certificate = gearlib.certify(candidate, digits=10)
        if certificate:
            # An orbit that meets no coast side does not depend on the backlash.
            assert candidate.pair.meshes[0].backlash != orbit.pair.meshes[0].backlash
            assert certificate.moved <= MAX_DISTANCE and -1 not in orbit.pattern
        else:
            assert certificate.status in ("distance", "contacts"), certificate


def test_orbits_that_cannot_be_proven_are_refused(monkeypatch):
    two = gearlib.two_stage(LIGHT)
    orbit = gearlib.periodic_orbit(two, 1.0, period=two.repeats)
    assert gearlib.certify(replace(orbit, period=1)).status in ("period", "contacts")
    turning = gearlib.planetary(turning=True, gyroscopic=True)
    refused = gearlib.certify(replace(orbit, pair=turning))
    assert refused.status == "model" and "frame" in refused.message
    monkeypatch.setattr("gearlib.analysis.proofs.path.MAX_ARCS", 10)
    refused = gearlib.certify(orbit)
    assert refused.status == "together" and "too many" in refused.message


def check(path, unknowns):
    """Prove the contacts of a path."""
    _, _, arcs, ends = path.equations(unknowns)
    check_contacts(path, arcs, ends, unknowns[path.dynamics.state_count :])


@pytest.mark.parametrize("tuning", [0.6, 0.651837])
def test_contacts_that_are_not_listed_are_seen(tuning):
    """The orbit of the equations without loss of contact dips below the flank lines, by 2 and 1e-3.

    The lower dip lies within a piece, at whose ends nothing is seen of it.
    """
    with precision(128):
        dynamics = ArcDynamics(gearlib.idler(LIGHT), tuning)
        path = Path(dynamics, [1, 1], [], 1)
        start = dynamics.initial_state(orbit_of("parametric resonance").state)
        box = krawczyk.enclose(path.equations, *krawczyk.polish(path.equations, start))
        with pytest.raises(ProofFailed) as error:
            check(path, box)
        assert error.value.args[0] == "grazing"
