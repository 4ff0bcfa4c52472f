"""Random gear trains of 2 to 6 meshes, with tunings and start states."""

import math
from dataclasses import replace

import numpy as np

import gearlib
from gearlib import Body, Harmonics, Mesh, Shaft


def random_problem(rng):
    """Return (train, tuning, state) of a random train that runs near a resonance.

    The train is a chain with shafts, a planetary train or a reducer, with 2 to 6 meshes.
    """
    train_makers = {"chain": chain_train, "planetary": planetary_train, "reducer": reducer_train}
    train = train_makers[rng.choice([*train_makers])](rng)
    squared_frequencies, mode_shapes = train.linear_modes
    lowest_frequency, highest_frequency = (
        math.sqrt(squared_frequencies[0]),
        math.sqrt(squared_frequencies[-1]),
    )
    speed = math.exp(
        rng.uniform(
            math.log(max(lowest_frequency, highest_frequency / 12.0)),
            math.log(1.2 * highest_frequency),
        )
    )
    state = train.start_state("static")
    if rng.random() < 0.7:
        spread = rng.choice([1.0, 3.0, 8.0])
        # Each mode changes the flank distances by about `spread` static deflections.
        mesh_deflections = np.abs(train.structure.mesh_jacobian @ mode_shapes).max(axis=0)
        scaled_shapes = mode_shapes / np.maximum(mesh_deflections, 1e-3)
        state[: train.size // 2] += scaled_shapes @ rng.normal(
            0.0, spread / math.sqrt(train.size // 2), squared_frequencies.size
        )
    return train, float(speed / train.reference_angular_frequency), state


def jamming_problem(rng):
    """Return (train, tuning, state) of a random train with little backlash, which may jam.

    Backlashes are 0 to 5 um, deviations of both flanks are of the same size, and some gears are
    eccentric.
    """
    train, tuning, state = random_problem(rng)
    meshes = []
    for mesh in train.meshes:
        backlash = float(rng.choice([0.0, 1e-7, 1e-6, 5e-6]))
        amplitude = max(backlash, 2e-7) * rng.choice([0.1, 0.3, 0.6, 1.0, 3.0])
        drive_deviation, other_deviation = (
            Harmonics(tuple(amplitude * rng.uniform(-1.0, 1.0, 2)), (amplitude * rng.normal(),))
            for _ in range(2)
        )
        flanks = {
            "deviation": drive_deviation,
            "coast_deviation": (drive_deviation, other_deviation)[rng.integers(2)],
        }
        meshes.append(replace(mesh, backlash=backlash, **flanks))
    bodies = [
        replace(body, eccentricity=float(rng.choice([0.0, 1e-6])), eccentricity_phase=1.0)
        if body.teeth
        else body
        for body in train.bodies
    ]
    train = train.replace(meshes=meshes, bodies=bodies)
    return train, tuning, train.start_state("static") if rng.random() < 0.5 else state


def symmetric_problem(rng):
    """Return (train, tuning, state) of a planetary train whose planets move in phase.

    In a third of the problems one planet starts 1e-12 static deflections away from the others, so
    that their events are separated by about the same amount.
    """
    planets, stiffness_ratio = int(rng.choice([2, 3])), rng.uniform(0.6, 0.9)
    train = gearlib.planetary(
        planets=planets,
        teeth=(30, 90) if planets == 2 else (27, 99),
        stiffness_ratio=(stiffness_ratio, stiffness_ratio),
        contact_ratio=tuple(rng.uniform(1.2, 1.8, 2)),
        backlash=float(rng.choice([10e-6, 60e-6])),
    )
    tuning, state, displacements = float(rng.uniform(0.8, 1.3)), train.start_state("static"), {}
    for i, (body, axis) in enumerate(train.structure.coordinates):
        # In a symmetric state central axes do not move, and all planets have equal displacements.
        name = "planet" if body.startswith("planet") else body
        if name == "planet" or axis == "u":
            state[i] += displacements.setdefault((name, axis), rng.normal(0.0, 2.0))
    if rng.random() < 1.0 / 3.0:
        state[[body for body, _ in train.structure.coordinates].index("planet 1")] += 1e-12
    return train, tuning, state


def _random_pair(rng):
    """Return a random pair with the stiffness and load of a train."""
    return gearlib.GearPair(
        max_stiffness=rng.uniform(3e8, 6e8),
        stiffness_ratio=rng.uniform(0.55, 0.95),
        contact_ratio=rng.uniform(1.2, 1.9),
        reduced_mass=rng.uniform(1.0, 4.0),
        load=rng.uniform(1000.0, 4000.0),
        backlash=30e-6,
    )


def _random_flanks(rng):
    """Return random values of backlash, damping, friction and deviations of a `Mesh`."""
    damping = rng.choice([0.0, 500.0, 3000.0], size=2)
    values = dict(
        friction=(0.0, 0.0) if rng.random() < 0.7 else tuple(rng.uniform(0.0, 0.08, 2)),
        backlash=float(rng.choice([5e-6, 20e-6, 60e-6, math.inf])),
        material_damping=float(damping.max()),
        backlash_damping=float(damping.min()),
        pitch_phase=rng.uniform(0.0, 6.0),
    )
    if rng.random() < 0.4:
        values["deviation"] = Harmonics(tuple(rng.normal(0.0, 1e-6, 2)), (1e-6,))
        if rng.random() < 0.5:
            values["coast_deviation"] = Harmonics((), tuple(rng.normal(0.0, 1e-6, 2)))
    if rng.random() < 0.3:
        values["coast_phase"] = rng.uniform()
    if rng.random() < 0.3:
        values["error"] = rng.normal(0.0, 2e-6)
    return values


def _with_random_flanks(rng, train):
    """Return a train with random flanks, either the same or different ones for each mesh."""
    common = _random_flanks(rng) if rng.random() < 0.4 else None
    meshes = [replace(mesh, **(common or _random_flanks(rng))) for mesh in train.meshes]
    bodies = list(train.bodies)
    if rng.random() < 0.3:
        i = next(i for i, body in enumerate(bodies) if body.teeth)
        bodies[i] = replace(bodies[i], eccentricity=2e-6, eccentricity_phase=rng.uniform(0.0, 6.0))
    return train.replace(meshes=meshes, bodies=bodies)


def chain_train(rng):
    """Return a random chain of gears with 2 to 6 meshes, some on shafts with two gears."""
    count, pair, elastic = int(rng.integers(2, 7)), _random_pair(rng), rng.random() < 0.6
    stiffness = ("max_stiffness", "stiffness_ratio", "contact_ratio")
    stiffness = {name: getattr(pair, name) for name in stiffness}
    bodies, meshes, shafts, force = [], [], [], pair.load

    def add_gear(*teeth):
        """Append and return a gear; two gears of 24 teeth have the reduced mass of the pair."""
        tooth_count, support = int(rng.choice(teeth)), {}
        radius = 0.002 * tooth_count
        effective_mass = 2.0 * pair.reduced_mass * (tooth_count / 24.0) ** 2
        if elastic and rng.random() < 0.7:
            k = tuple(rng.uniform(1e8, 1e9, 2))
            support = {"mass": 2.0 * effective_mass, "support_stiffness": k}
            support["support_damping"] = tuple(1e-6 * value for value in k)
        name, inertia = f"gear {len(bodies) + 1}", effective_mass * radius**2
        bodies.append(
            Body(name=name, teeth=tooth_count, base_radius=radius, inertia=inertia, **support)
        )
        return bodies[-1]

    driving_gear = add_gear(18, 24)
    bodies[0] = replace(driving_gear, torque=force * driving_gear.base_radius)
    for i in range(count):
        driven_gear = add_gear(18, 24, 36)
        # The direction changes from each mesh to the next.
        line_of_centres = {"position": rng.uniform(0.0, math.tau), "direction": (-1) ** i}
        meshes.append(
            Mesh(pinion=driving_gear.name, wheel=driven_gear.name, **line_of_centres, **stiffness)
        )
        driving_gear = driven_gear
        if rng.random() < 0.4 and len(meshes) < count:
            driving_gear = add_gear(18, 24)
            shaft = {"stiffness": rng.uniform(3e5, 2e6), "damping": 1.0}
            shaft["bending_stiffness"] = rng.choice([0.0, 1e8])
            shafts.append(Shaft(bodies=(driven_gear.name, driving_gear.name), **shaft))
            force *= driven_gear.base_radius / driving_gear.base_radius
    # The load acts against the rotation of the last gear.
    bodies[-1] = replace(driving_gear, torque=-((-1) ** count) * force * driving_gear.base_radius)
    train = gearlib.GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)
    return _with_random_flanks(rng, train)


def _random_pin_errors(rng, count, probability_of_none):
    """Return position errors of `count` pins, 5 um on the first one, or None at random."""
    if rng.random() < probability_of_none:
        return None
    return [(0.0, 5e-6)] + [(0.0, 0.0)] * (count - 1)


def planetary_train(rng):
    """Return a random planetary train with 2 or 3 planets."""
    planets = int(rng.choice([2, 3]))
    teeth = [(27, 99), (28, 98), (30, 90)][rng.integers(3)]
    kappa, turning = rng.uniform(0.6, 0.95), bool(rng.random() < 0.3)
    train = gearlib.planetary(
        planets=planets,
        teeth=teeth,
        stiffness_ratio=(kappa, kappa),
        contact_ratio=tuple(rng.uniform(1.2, 1.8, 2)),
        turning=turning,
        gyroscopic=turning,
        sun_base_radius=0.0387 * teeth[0] / 27.0,
        pin_errors=_random_pin_errors(rng, planets, 0.7),
    )
    return _with_random_flanks(rng, train)


def reducer_train(rng):
    """Return a random split-power reducer with 2 or 3 branches."""
    branches = int(rng.choice([2, 3]))
    train = gearlib.split_power_reducer(
        _random_pair(rng),
        branches=branches,
        internal=bool(rng.random() < 0.5),
        support_stiffness=math.inf if rng.random() < 0.3 else 10.0 ** rng.uniform(8.3, 9.3),
        pin_errors=_random_pin_errors(rng, branches, 0.5),
    )
    return _with_random_flanks(rng, train)


def chain_with_everything(rng):
    """Return gears a, b, c and a ring gear d in a row, with all features and elastic supports.

    The first mesh, and with it the load, has a random direction.
    """
    elastic = {"support_stiffness": (3e8, 5e8), "support_damping": (300.0, 500.0)}
    bodies = [
        Body(
            name=name,
            teeth=z,
            inertia=2.0 * (0.002 * z) ** 2,
            base_radius=0.002 * z,
            mass=rng.uniform(2.0, 6.0),
            eccentricity=1e-6,
            eccentricity_phase=rng.uniform(0.0, 6.0),
            offset=tuple(rng.normal(0.0, 1e-6, 2)),
            **elastic,
        )
        for name, z in zip("abcd", (18, 24, 18, 72), strict=True)
    ]
    meshes = [
        Mesh(
            pinion=pinion,
            wheel=wheel,
            internal=wheel == "d",
            max_stiffness=rng.uniform(2e8, 5e8),
            stiffness_ratio=rng.uniform(0.6, 0.9),
            contact_ratio=rng.uniform(1.2, 1.8),
            position=rng.uniform(0.0, 6.0),
            pressure_angle=rng.uniform(0.2, 0.5),
            direction=int(rng.choice([1, -1])),
            phase=rng.uniform(),
            coast_phase=rng.uniform(),
            backlash=rng.uniform(3e-6, 12e-6),
            material_damping=rng.uniform(500.0, 3000.0),
            backlash_damping=rng.uniform(100.0, 500.0),
            deviation=Harmonics(tuple(rng.normal(0.0, 1e-6, 2)), (1e-6,)),
            coast_deviation=Harmonics((), tuple(rng.normal(0.0, 1e-6, 2))),
            error=rng.normal(0.0, 2e-6),
            friction=tuple(rng.uniform(0.02, 0.1, 2)),
            pitch_phase=rng.uniform(0.0, 6.0),
            tooth_thickness=tuple(rng.uniform(0.35, 0.6, 2)),
        )
        for pinion, wheel in ("ab", "bc", "cd")
    ]
    # The direction changes after each external mesh; an internal mesh keeps it.
    sign = meshes[0].direction
    meshes[1:] = [replace(mesh, direction=-sign) for mesh in meshes[1:]]
    # Gear d rotates in the sense of gear a with the same tooth force, which balances the torques.
    force = rng.uniform(500.0, 3000.0) * sign
    for i, torque_sign in ((0, 1.0), (3, -1.0)):
        bodies[i] = replace(bodies[i], torque=torque_sign * force * bodies[i].base_radius)
    return gearlib.GearTrain(bodies=bodies, meshes=meshes, reference="a-b")
