"""Compare certificates of trains with a second program, and refuse wrong orbits of trains."""

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
from tests.proofs.claims import assert_wrong_orbits_are_refused, json_claim
from tests.properties.known_models import ALL_EXCITATIONS, gears_on_bearings

LIGHTLY_DAMPED_PAIR = PAPER_PAIR.replace(material_damping=1500.0)
GEAR = {"teeth": 18, "base_radius": 0.036, "inertia": 4e-3}
MESH_PARAMETERS = dict(max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.6, backlash=15e-6)
DAMPED_MESH_PARAMETERS = MESH_PARAMETERS | {"material_damping": 1500.0, "backlash_damping": 200.0}


def chain():
    """Return a train of two meshes and a shaft, in which the meshes have every feature."""
    mesh_force = 3000.0  # N
    torque = mesh_force * GEAR["base_radius"]
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
    coast_deviation = gearlib.Harmonics((), (4e-7,))
    meshes = [
        gearlib.Mesh(coast_deviation=coast_deviation, **first, **DAMPED_MESH_PARAMETERS),
        gearlib.Mesh(**second, **MESH_PARAMETERS),
    ]
    shafts = [gearlib.Shaft(bodies=("left", "right"), stiffness=4e5, damping=1.0)]
    return gearlib.GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


def branches():
    """Return a gear that drives two equal gears in phase, so that contact events coincide."""
    bodies = [gearlib.Body(name="centre", torque=200.0, **GEAR)]
    bodies += [gearlib.Body(name=name, torque=100.0, **GEAR) for name in ("left", "right")]
    meshes = [
        gearlib.Mesh(
            pinion="centre", wheel=name, position=position, phase=0.0, **DAMPED_MESH_PARAMETERS
        )
        for name, position in (("left", 0.0), ("right", 2.0))
    ]
    return gearlib.GearTrain(bodies=bodies, meshes=meshes)


#: Gears whose coast sides move with the bearings and come into contact.
BEARINGS = gears_on_bearings(
    1e9, 600.0, 300.0, backlash=12e-6, **ALL_EXCITATIONS | {"teeth": (1, 1)}
)
#: Model, tuning, number of contact events and stability of each orbit.
CASES = {
    "idler": (gearlib.idler(LIGHTLY_DAMPED_PAIR), 0.6, 4, "stable"),
    "parametric resonance": (gearlib.idler(LIGHTLY_DAMPED_PAIR), 1.0, 0, "unstable"),
    "chain": (chain(), 0.8, 8, "stable"),
    "branches": (branches(), 1.5, 8, "stable"),
    "bearings": (BEARINGS, 1.0, 4, "stable"),
}


@cache
def orbit_of(case):
    """Return the periodic orbit of a case."""
    model, tuning, _, stability = CASES[case]
    # Near an unstable orbit, motions are chaotic, so that a simulated guess would depend on
    # rounding.
    guess = model.start_state("static") if stability == "unstable" else None
    return gearlib.periodic_orbit(model, tuning, guess=guess)


@pytest.mark.parametrize("case", CASES)
def test_orbit_in_50_digits_lies_in_its_enclosures(case):
    """The enclosures must contain the true orbit, which a second program computes in 50 digits."""
    _, _, event_count, stability = CASES[case]
    proven = gearlib.certify(orbit_of(case), digits=20)
    motion = Motion(json_claim(proven))
    assert (len(proven.events), proven.stability) == (event_count, stability)
    independent_orbit = motion.orbit()
    assert motion.find_contradictions(independent_orbit) == []
    # The comparison itself must notice wrong enclosures.
    motion.claim["multipliers"][0][0] = ["2", "2.1"]
    motion.claim["displacement"][motion.free_coordinates[0]] = ["7", "7.1"]
    assert motion.find_contradictions(independent_orbit) == ["displacement", "multiplier"]


@pytest.mark.parametrize("case", ["idler", "parametric resonance", "chain", "branches"])
def test_wrong_orbits_are_refused(case):
    """An orbit with another state or tuning does not exist, so that it must not be certified."""
    orbit = orbit_of(case)
    velocity_change = np.repeat([0.0, 1e-6], orbit.state.size // 2)
    assert_wrong_orbits_are_refused(orbit, velocity_change)
    refusal = gearlib.certify(replace(orbit, tuning=orbit.tuning * (1.0 + 1e-5)), digits=10)
    assert not refusal and refusal.status in ("distance", "contacts")


def test_orbits_that_cannot_be_proven_are_refused(monkeypatch):
    """The status must state the reason: wrong period, rotating frame or too many events."""
    train = gearlib.two_stage(LIGHTLY_DAMPED_PAIR)
    orbit = gearlib.periodic_orbit(train, 1.0, period=train.repeats)
    assert gearlib.certify(replace(orbit, period=1)).status in ("period", "contacts")
    turning_train = gearlib.planetary(turning=True, gyroscopic=True)
    refusal = gearlib.certify(replace(orbit, model=turning_train))
    assert refusal.status == "model" and "frame" in refusal.message
    monkeypatch.setattr("gearlib.analysis.proofs.path.MAX_ARCS", 10)
    refusal = gearlib.certify(orbit)
    assert refusal.status == "together" and "too many" in refusal.message


@pytest.mark.parametrize("tuning", [0.6, 0.651837])
def test_contact_loss_that_the_orbit_ignores_is_noticed(tuning):
    """An orbit with permanent contact must be refused if its mesh deflection becomes negative.

    At the two tunings the deflection falls to -2 and -0.001 static deflections. The smaller value
    occurs within an arc and not at its ends.
    """
    with precision(128):
        dynamics = ArcDynamics(gearlib.idler(LIGHTLY_DAMPED_PAIR), tuning)
        path = Path(dynamics, [1, 1], [], 1)
        start = dynamics.initial_state(orbit_of("parametric resonance").state)
        box = krawczyk.enclose_zero(path.equations, *krawczyk.refine_zero(path.equations, start))
        _, _, arcs, ends = path.equations(box)
        with pytest.raises(ProofFailed) as error:
            check_contacts(path, arcs, ends, box[dynamics.state_count :])
        assert error.value.args[0] == "grazing"
