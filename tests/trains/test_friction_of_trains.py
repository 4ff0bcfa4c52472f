"""Friction opposes the sliding of flanks, in every mesh; a machine has one motion.

The sliding is that of `tests.trains.sliding`, from base circles and speeds. A mirror image, other
names and another order, and external meshes told from their other gear describe one machine: with
all properties of a mesh at work they have the same motion.
"""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import gearlib
from gearlib.analysis.proofs.train_numbers import parts_of
from tests.properties.changes import exchanged, mirrored, renamed
from tests.trains.against_scipy import matrix
from tests.trains.random_trains import planetary_train
from tests.trains.reference import Reference
from tests.trains.sliding import past, sliding
from tests.trains.test_train_system import six_degrees

ELASTIC = dict(support_stiffness=(3e8, 5e8), support_damping=(300.0, 500.0))


def a_mesh(rng, pinion, wheel, **more):
    """Return a mesh with everything that a mesh has, each of its own size."""
    values = dict(
        max_stiffness=rng.uniform(2e8, 5e8),
        stiffness_ratio=rng.uniform(0.6, 0.9),
        contact_ratio=rng.uniform(1.2, 1.8),
        position=rng.uniform(0.0, 6.0),
        pressure_angle=rng.uniform(0.2, 0.5),
        direction=int(rng.choice([1, -1])),
        phase=rng.uniform(),
        inverse_phase=rng.uniform(),
        backlash=rng.uniform(3e-6, 12e-6),
        material_damping=rng.uniform(500.0, 3000.0),
        backlash_damping=rng.uniform(100.0, 500.0),
        deviation=gearlib.Harmonics(tuple(rng.normal(0.0, 1e-6, 2)), (1e-6,)),
        inverse_deviation=gearlib.Harmonics((), tuple(rng.normal(0.0, 1e-6, 2))),
        error=rng.normal(0.0, 2e-6),
        friction=tuple(rng.uniform(0.02, 0.1, 2)),
        pitch_phase=rng.uniform(0.0, 6.0),
        tooth_thickness=tuple(rng.uniform(0.35, 0.6, 2)),
    )
    return gearlib.Mesh(pinion=pinion, wheel=wheel, **(values | more))


def chain(rng):
    """Return three gears and a ring gear in a row, on elastic axes, driven either way."""
    teeth, bodies = (18, 24, 18, 72), []
    for i, z in enumerate(teeth):
        bodies.append(
            gearlib.Body(
                name="abcd"[i],
                teeth=z,
                inertia=2.0 * (0.002 * z) ** 2,
                base_radius=0.002 * z,
                mass=rng.uniform(2.0, 6.0),
                **ELASTIC,
                eccentricity=1e-6,
                eccentricity_phase=rng.uniform(0.0, 6.0),
                offset=tuple(rng.normal(0.0, 1e-6, 2)),
            )
        )
    first = a_mesh(rng, "a", "b")
    # Seen from b its flanks that touch a and c face the same way round.
    second = a_mesh(rng, "b", "c", direction=-first.direction)
    # c pushes the ring gear, which would touch the same flanks by turning back.
    third = a_mesh(rng, "c", "d", internal=True, direction=-first.direction)
    force = rng.uniform(500.0, 3000.0) * first.direction
    # d turns as a does, at as many pitches.
    bodies[0] = replace(bodies[0], torque=force * bodies[0].base_radius)
    bodies[3] = replace(bodies[3], torque=-force * bodies[3].base_radius)
    return gearlib.GearTrain(bodies=bodies, meshes=[first, second, third], reference="a-b")


def trains(rng):
    """Yield trains with friction of all kinds of meshes."""
    yield chain(rng)
    carried = planetary_train(rng)
    meshes = [
        replace(
            mesh,
            friction=(0.05, 0.08),
            pitch_phase=rng.uniform(0.0, 6.0),
            backlash=10e-6,
            tooth_thickness=tuple(rng.uniform(0.35, 0.6, 2)),
            phase=rng.uniform(),
        )
        for mesh in carried.meshes
    ]
    yield carried.replace(meshes=meshes)
    six, pair = six_degrees(rng)
    free = [replace(body, **ELASTIC) for body in pair.bodies]
    yield pair.replace(bodies=free)


def frictions(train, tuning, system, segment, j, code, z):
    """Return (friction on the pinion along x and y, normal force) as the model has them."""
    n, mesh = train.size // 2, train.meshes[j]
    d = system.effect[code + 1, segment, j]
    grip = system.grip[j, d] @ z
    elastic = system.stiffness[code + 1, segment, j] * ((system.near, system.far)[code < 0][j] @ z)
    mass = train.structure.mass * (train.reference_angular_frequency**2 / train.stiffness_scale)
    force = mass @ system.push[j, d, 1, n : 2 * n] * grip[1]
    at = [train.structure.coordinates.index((mesh.pinion, axis)) for axis in "xy"]
    body = train.by_name[mesh.pinion]
    angle = body.angle if body.carrier else 0.0
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return turn @ force[at], abs(elastic)


@pytest.mark.parametrize("seed", range(8))
def test_friction_takes_power_out_at_every_sample(seed):
    rng, seen = np.random.default_rng(seed), 0
    for train in trains(rng):
        system = train.system(0.9)
        size = system.near.shape[1]
        for segment in rng.integers(system.starts.size - 1, size=30):
            for tau in rng.uniform(*system.starts[segment : segment + 2], 2):
                for j, mesh in enumerate(train.meshes):
                    for code in (1, -1):
                        if code < 0 and math.isinf(mesh.backlash):
                            continue
                        z = rng.normal(size=size)
                        distance = (system.far if code < 0 else system.near)[j]
                        if distance @ z * code < 0.0:
                            z = -z
                        force, normal = frictions(train, 0.9, system, segment, j, code, z)
                        mu = mesh.friction[0 if code > 0 else 1]
                        assert np.hypot(*force) == pytest.approx(mu * normal, rel=1e-9)
                        away = past(train, mesh, tau)[1 if code > 0 else 0]
                        _, speed = sliding(train, mesh, code > 0, away)
                        # On the coast side the model keeps the line of action of the drive side.
                        least = 0.0 if code < 0 else 0.999 * np.hypot(*force) * np.hypot(*speed)
                        assert force @ speed <= -least
                        seen += 1
    assert seen > 100


def final(train, state, periods):
    run = gearlib.simulate(
        train, 0.9, periods=periods, record_periods=periods, initial_state=tuple(state)
    )
    assert run.status == 0
    return run


@pytest.mark.parametrize("describe", [mirrored, renamed, exchanged])
def test_one_machine_has_one_motion(describe):
    met = set()
    for seed in range(3):
        rng = np.random.default_rng(seed)
        for train in list(trains(rng))[:2]:
            other, key_of = describe(train)
            keys, others = train.structure.coordinates, other.structure.coordinates
            found = [key_of(key) for key in keys]
            order = [others.index(key) for key, _ in found]
            order += [len(keys) + i for i in order]
            signs = np.tile([sign for _, sign in found], 2)
            state = train.start_state("static")
            state[: len(keys)] += rng.normal(0.0, 0.3, len(keys))
            moved = np.empty_like(state)
            moved[order] = signs * state
            one, two = final(train, state, 6), final(other, moved, 6)
            met |= set(one.event_to.values.tolist())
            assert one.event.size == two.event.size
            np.testing.assert_allclose(
                signs * two.final_state.values[order], one.final_state.values, rtol=0, atol=1e-9
            )
            without = [replace(mesh, friction=(0.0, 0.0)) for mesh in train.meshes]
            free = final(train.replace(meshes=without), state, 6)
            assert np.abs(free.final_state.values - one.final_state.values).max() > 1e-3
    assert met == {-1, 0, 1}


def test_friction_of_the_six_degree_pair_opposes_the_same_sliding():
    """Gear 3 turns counterclockwise, y is the line of action and z a quarter turn from it."""
    seen = set()
    for seed in range(8):
        six, train = six_degrees(np.random.default_rng(seed))
        (mesh,), system = train.meshes, six.system(0.9)
        m = 2 + len(six.flexible())
        for segment, tau in enumerate((system.starts[:-1] + system.starts[1:]) / 2.0):
            for code in (1, -1):
                if code < 0 and math.isinf(mesh.backlash):
                    continue
                away = past(train, mesh, tau)[1 if code > 0 else 0]
                _, speed = sliding(train, mesh, code > 0, away)
                # Gear 3 turned into its flank, all else at rest: across it only friction acts.
                forces = code * matrix(system, [code], segment)[m : 2 * m, 0]
                for k, i in enumerate(six.flexible()):
                    if i in (1, 3):
                        assert forces[2 + k] * speed[1] * (1.0 if i == 1 else -1.0) < 0.0
                        seen.add((i, code))
    assert len(seen) == 4


def test_a_second_code_has_the_same_motion():
    for seed in range(2):
        train = chain(np.random.default_rng(seed))
        start = train.start_state("static")
        end, events = Reference(train, 0.9).run(start, 3)
        run = final(train, start, 3)
        assert run.event.size == len(events)
        scale = np.repeat([1.0, 0.9], train.size // 2)
        np.testing.assert_allclose(run.final_state.values * scale, end, rtol=0, atol=1e-9)


def test_proofs_know_the_same_friction():
    pytest.importorskip("flint")
    for seed in range(4):
        train = chain(np.random.default_rng(seed))
        starts, sense = train.segments.starts, train.segments.sense
        for j, mesh in enumerate(parts_of(train).meshes):
            across = [float(value) for value in mesh.across]
            np.testing.assert_allclose(across, train.structure.across[j], rtol=0, atol=1e-14)
            for segment in range(0, starts.size - 1, 5):
                middle = Fraction((starts[segment] + starts[segment + 1]) / (4.0 * math.pi))
                found = [mesh.sense(side, middle * mesh.rate) for side in (0, 1)]
                assert found == sense[:, segment, j].tolist()
