"""Certificates of trains against a second program, wrong candidates, and the proofs of a pair."""

import json
import math
from dataclasses import replace
from fractions import Fraction
from functools import cache
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest

import gearlib
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.analysis.proofs import krawczyk
from gearlib.analysis.proofs.arc_laws import ArcDynamics
from gearlib.analysis.proofs.balls import precision
from gearlib.analysis.proofs.certificate_files import ProofFailed
from gearlib.analysis.proofs.models_in_balls import ball_model
from gearlib.analysis.proofs.orbits import MAX_DISTANCE, Proof, listed_contacts
from gearlib.analysis.proofs.path import Path
from gearlib.analysis.proofs.signs import check_contacts, contact_bounds
from tests.independent.certificates import Motion
from tests.paper import PAPER
from tests.properties.known_models import EVERYTHING, gears
from tests.trains.random_trains import random_problem

LIGHT = PAPER.replace(material_damping=1500.0)


def chain():
    """Two meshes and a shaft, with all that a mesh may have; every mesh period is alike."""
    share = {"teeth": 18, "base_radius": 0.036, "inertia": 4e-3}
    torque = 3000.0 * 0.036
    bodies = [
        gearlib.Body(name="in", torque=torque, **share),
        gearlib.Body(
            name="left", mass=3.0, support_stiffness=(2e8, math.inf), support_damping=300.0, **share
        ),
        gearlib.Body(name="right", offset=(3e-6, 2e-6), **share),
        gearlib.Body(name="out", torque=-torque, **share),
    ]
    values = dict(max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.6, backlash=15e-6)
    meshes = [
        # Its wheel drives.
        gearlib.Mesh(
            name="in-left",
            pinion="left",
            wheel="in",
            driving="in",
            position=0.4 - math.pi,
            friction=(0.06, 0.04),
            pitch_phase=-0.7,
            tooth_thickness=(0.53, 0.46),
            material_damping=1500.0,
            backlash_damping=200.0,
            deviation=gearlib.Harmonics((1e-6, 5e-7), (3e-7,)),
            inverse_deviation=gearlib.Harmonics((), (4e-7,)),
            **values,
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
            **values,
        ),
    ]
    shafts = [gearlib.Shaft(bodies=("left", "right"), stiffness=4e5, damping=1.0)]
    return gearlib.GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


def branches():
    """One gear drives two that are alike, in phase: all they do they do at once."""
    share = {"teeth": 18, "base_radius": 0.036, "inertia": 4e-3}
    bodies = [gearlib.Body(name="centre", torque=200.0, **share)]
    bodies += [gearlib.Body(name=name, torque=100.0, **share) for name in ("left", "right")]
    meshes = [
        gearlib.Mesh(
            pinion="centre",
            wheel=name,
            position=position,
            phase=0.0,
            max_stiffness=4e8,
            stiffness_ratio=0.6,
            contact_ratio=1.6,
            backlash=15e-6,
            material_damping=1500.0,
            backlash_damping=200.0,
        )
        for name, position in (("left", 0.0), ("right", 2.0))
    ]
    return gearlib.GearTrain(bodies=bodies, meshes=meshes)


def moving():
    """The chain with a coast side that moves with the axes of its gears, and is met."""
    train = chain()
    mesh = replace(train.meshes[0], moving_backlash=True, backlash=8e-6)
    return train.replace(meshes=[mesh, *train.meshes[1:]])


#: Model, tuning, contacts gained and lost, the stability that is known.
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
def found(case):
    model, tuning, _, stability = CASES[case]
    # Beside an unstable orbit motions are chaotic: from where one begins rounding would decide.
    guess = model.start_state("static") if stability == "unstable" else None
    return gearlib.periodic_orbit(model, tuning, guess=guess)


def claim(certificate):
    return json.loads(json.dumps(certificate.as_dict()))


@pytest.mark.parametrize("case", CASES)
def test_a_second_program_finds_the_orbit_in_its_box(case):
    _, _, contacts, stability = CASES[case]
    orbit = found(case)
    proven = gearlib.certify(orbit, digits=20)
    assert proven, proven
    assert contacts in (len(proven.events), None) and stability in (proven.stability, None)
    motion = Motion(claim(proven))
    other = motion.orbit()
    assert motion.faults(other) == []
    # And it sees what is wrong.
    motion.claim["multipliers"][0][0] = ["2", "2.1"]
    motion.claim["displacement"][motion.kept[0]] = ["7", "7.1"]
    assert motion.faults(other) == ["displacement", "multiplier"]


def test_planets_in_phase_part_one_after_the_other():
    """Positions as floats are not quite symmetric: by 1e-16, in an order that is proven."""
    train = gearlib.planetary(planets=2, teeth=(28, 98), stiffness_ratio=(0.7, 0.7))
    orbit = gearlib.periodic_orbit(train, 1.0)
    proven = gearlib.certify(orbit)
    assert proven and len(proven.events) == 4 and len(proven.multipliers) == 28
    phases = [float(event.phase) for event in proven.events]
    assert np.ptp(phases[:2]) < 1e-14 and np.ptp(phases[2:]) < 1e-14
    motion = Motion(claim(proven))
    end, events = motion.run(motion.middle)
    # From within 1e-32 of the orbit.
    assert max(abs(end - motion.middle)) < 1e-29
    for one, event in zip(events, proven.events, strict=True):
        own = proven.meshes[one.contact], one.before, one.after
        assert own == (event.mesh, event.before, event.after)
        assert abs(one.phase - mpmath.mpf(str(event.phase.low))) < 1e-29


def test_excitation_in_balls_is_that_of_the_kernels():
    train = gearlib.planetary(driving="ring", stiffness_ratio=(0.7, 0.7))
    run_out = {"eccentricity": 2e-6, "eccentricity_phase": 0.7, "offset": (1e-6, 3e-6)}
    bodies = [replace(body, **run_out) if body.teeth else body for body in train.bodies]
    flank = {"friction": (0.05, 0.05), "pitch_phase": 0.4, "tooth_thickness": (0.52, 0.47)}
    train = train.replace(bodies=bodies, meshes=[replace(m, **flank) for m in train.meshes])
    frequencies, waves, constants = train.excitation
    for j, mesh in enumerate(ball_model(train, 1.0).meshes):
        for side in (0, 1):
            found = [mesh.waves.get(Fraction(f).limit_denominator(10**6)) for f in frequencies]
            found = [value for row in found for value in (row[side] if row else (0.0, 0.0))]
            np.testing.assert_allclose(np.array(found, float), waves[side, j], rtol=0, atol=1e-20)
            gap = constants[side, j] + (0.0 if side else train.meshes[j].backlash)
            assert float(mesh.constants[side]) == pytest.approx(gap, rel=0, abs=1e-20)
        phases = train.inverse_phases[mesh.name], train.phases[mesh.name]
        assert tuple(map(float, mesh.timing.phases)) == phases
        assert float(mesh.timing.pitches[1]) * math.tau == pytest.approx(-0.4, abs=1e-15)


def small_random_orbit(seed):
    """Return an orbit of a random train of a few coordinates, or None."""
    train, tuning, state = random_problem(np.random.default_rng(seed))
    if train.size > 16 or train.repeats > 3 or train.gyroscopic:
        return None
    try:
        return gearlib.periodic_orbit(train, tuning, guess=state, period=train.repeats)
    except NoOrbit:
        return None


def test_random_trains():
    for seed in (112, 113, 203, 237, 295):
        orbit = small_random_orbit(seed)
        found = gearlib.certify(orbit)
        assert found and found.events, found
        assert (found.stability == "stable") == orbit.stable and found.moved < 1e-11
        for real, imaginary in found.multipliers:
            # Of multiple ones floats have half of the digits.
            near = np.abs(orbit.multipliers - complex(float(real), float(imaginary))).min()
            assert near < 1e-7


def wrong(orbit):
    """Yield (statuses, candidate that no orbit is near to)."""
    away = np.zeros(orbit.state.size)
    for place in range(orbit.state.size // 2 - 1, orbit.state.size, 2):
        away[place] = 1e-6
        yield ("distance", "contacts"), replace(orbit, state=orbit.state + away)
    yield ("period", "contacts"), replace(orbit, period=2 * orbit.period)
    doubled = (*orbit.pattern, *orbit.pattern[1:])
    if len(orbit.pattern) > len(orbit.pair.mesh_names):
        yield ("period",), replace(orbit, period=2 * orbit.period, pattern=doubled)
        yield ("contacts",), replace(orbit, pattern=orbit.pattern[:-2])
        yield ("contacts",), replace(orbit, pattern=(*orbit.pattern, 0, 1))
    yield ("distance", "contacts"), replace(orbit, tuning=orbit.tuning * (1.0 + 1e-5))


def changed(orbit):
    """Yield candidates with a parameter of the train that is not theirs."""
    train = orbit.pair
    for name in ("max_stiffness", "material_damping", "contact_ratio", "backlash"):
        mesh = train.meshes[0]
        meshes = [replace(mesh, **{name: getattr(mesh, name) * (1.0 - 1e-5)}), *train.meshes[1:]]
        yield replace(orbit, pair=train.replace(meshes=meshes))
    body = train.bodies[0]
    bodies = [replace(body, inertia=body.inertia * (1.0 + 1e-5)), *train.bodies[1:]]
    yield replace(orbit, pair=train.replace(bodies=bodies))


@pytest.mark.parametrize("case", ["idler", "parametric resonance", "chain", "branches"])
def test_wrong_candidates_are_refused(case):
    orbit = found(case)
    for statuses, candidate in wrong(orbit):
        refused = gearlib.certify(candidate, digits=10)
        assert not refused and refused.status in statuses, refused
    for candidate in changed(orbit):
        refused = gearlib.certify(candidate, digits=10)
        # Where no coast side is met the backlash says nothing.
        if refused:
            assert candidate.pair.meshes[0].backlash != orbit.pair.meshes[0].backlash
            assert refused.moved <= MAX_DISTANCE and -1 not in orbit.pattern
        else:
            assert refused.status in ("distance", "contacts"), refused


def test_contacts_that_coincide_are_in_one_enclosure():
    proven = gearlib.certify(found("branches"))
    phases = [event.phase for event in proven.events]
    assert phases[::2] == phases[1::2] and len(set(phases[::2])) == 4
    meshes = [event.mesh for event in proven.events]
    assert all(set(meshes[i : i + 2]) == set(proven.meshes) for i in range(0, 8, 2))


def test_what_is_beyond_the_proof_is_refused_by_name(monkeypatch):
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
        laws = ArcDynamics(gearlib.idler(LIGHT), tuning)
        path = Path(laws, [1, 1], [], 1)
        start = laws.initial_state(found("parametric resonance").state)
        box = krawczyk.enclose(path.equations, *krawczyk.polish(path.equations, start))
        with pytest.raises(ProofFailed) as error:
            check(path, box)
        assert error.value.args[0] == "grazing"


@pytest.mark.parametrize("backlash, status", [(1.49, None), (1.48, "grazing"), (1.0, "grazing")])
def test_contacts_that_are_not_listed_are_seen_where_others_coincide(backlash, status):
    """Without a coast side the flanks part by 1.4808; with one further off nothing changes."""
    train, open_ = branches(), {"backlash": math.inf}
    free = train.replace(meshes=[replace(mesh, **open_) for mesh in train.meshes])
    orbit = gearlib.periodic_orbit(free, 1.5, guess=gearlib.periodic_orbit(train, 1.4).state)
    codes, events = listed_contacts(orbit)
    closed = {"backlash": backlash * train.static_deflection}
    train = train.replace(meshes=[replace(mesh, **closed) for mesh in train.meshes])
    with precision(164):
        if status is None:
            assert len(Proof(replace(orbit, pair=train), codes, events).phases) == 4
            return
        with pytest.raises(ProofFailed) as error:
            Proof(replace(orbit, pair=train), codes, events)
        assert error.value.args[0] == status


def test_slow_contacts_at_once_are_proven():
    meshes = [replace(mesh, material_damping=4500.0) for mesh in branches().meshes]
    proven = gearlib.certify(gearlib.periodic_orbit(branches().replace(meshes=meshes), 1.5))
    assert proven and len(proven.events) == 4, proven


def test_play_that_closes_is_looked_for():
    """Where it changes, both flanks have to be where they belong."""
    for model, coast, counts in (
        (chain(), "coast", (2, 2, 2)),
        (moving(), "coast", (2, 2, 2)),
        (branches(), "coast", (2, 1, 1)),
        (branches(), None, (1, 1, 0)),
    ):
        rows = [[coast, "drive"]] * len(model.meshes)
        laws = SimpleNamespace(model=ball_model(model, 1.0), distances=rows)
        for code, count in zip((0, 1, -1), counts, strict=True):
            found = contact_bounds(laws, [code] * len(rows))
            assert sum(bound.mesh == 0 for bound in found) == count, (code, found)


def test_of_which_meshes_the_play_changes():
    """Where bearings open it, or the two flanks deviate unlike each other."""
    one, other = gearlib.Harmonics((1e-6,)), gearlib.Harmonics((0.0, 1e-6))
    for moving, coast, changes in ((False, one, False), (False, other, True), (True, one, True)):
        six = gears(
            1e9,
            600.0,
            moving_backlash=moving,
            deviation=one,
            inverse_deviation=coast,
        )
        assert ball_model(six, 1.0).meshes[0].clearance_varies == changes
    for inverse, changes in ((one, False), (other, True)):
        train = branches()
        mesh = replace(train.meshes[0], deviation=one, inverse_deviation=inverse)
        train = train.replace(meshes=[mesh, *train.meshes[1:]])
        found = [mesh.clearance_varies for mesh in ball_model(train, 1.0).meshes]
        assert found == [changes, False]


@pytest.mark.parametrize("ratio, low", [(1.0, True), (2.0, False)])
def test_a_stiffness_that_never_switches(ratio, low):
    train = branches()
    meshes = [replace(mesh, contact_ratio=ratio) for mesh in train.meshes]
    (segment,) = ball_model(train.replace(meshes=meshes), 1.0).segments
    levels = [level for sides in segment.conditions for level, _ in sides]
    assert segment.phase == 0 and levels == [int(low)] * 4
