"""Phases and friction of trains, compared with the positions of their teeth."""

import dataclasses
import math

import numpy as np
import pytest

import gearlib
from gearlib import Body, GearTrain, Shaft
from gearlib.geometry import GearStage, SpurGear, planetary_set
from tests.geometry.teeth import MODULE, FlankContact, Gear, PlacedGears, axis_distance
from tests.independent import equations
from tests.independent.systems import describe, system_of


def to_spur_gear(gear):
    """Return the `SpurGear` of gearlib for a `Gear` of `tests/geometry/teeth.py`."""
    rim = {"outer_diameter": 2.2 * gear.tip} if gear.internal else {}
    values = {name: getattr(gear, name) for name in ("teeth", "shift", "internal")}
    return SpurGear(module=MODULE, width=0.02, **values, **rim)


def to_gear_stage(gears, mesh):
    """Return the `GearStage` of a mesh of `PlacedGears`, with a ring gear as the wheel."""
    names = sorted(mesh[:2], key=lambda name: gears[name].internal)
    return GearStage(*(to_spur_gear(gears[name]) for name in names), mesh[2])


def random_placement(rng):
    """Return (gears, meshes, shafts, rotation_direction) of a random tree of meshes and shafts."""

    def external():
        """Return a random external gear."""
        return Gear(int(rng.integers(19, 46)), float(rng.choice([0.0, rng.uniform(0.0, 0.5)])))

    gears, meshes, shafts = {"g0": external()}, [], []
    mesh_count = int(rng.integers(2, 6))
    while len(meshes) < mesh_count:
        name = str(rng.choice(list(gears)))
        new_name, new_gear = f"g{len(gears)}", external()
        if meshes and rng.random() < 0.35:
            gears[new_name] = new_gear
            keying = float(rng.choice([0.0, rng.uniform(-3.0, 3.0)]))
            shafts.append((*rng.permutation([name, new_name]).tolist(), keying))
            continue
        if gears[name].internal:
            new_gear = Gear(int(rng.integers(19, gears[name].teeth - 35)), 0.0)
        elif rng.random() < 0.3:
            teeth = max(gears[name].teeth + int(rng.integers(36, 60)), 70)
            new_gear = Gear(teeth, -gears[name].shift, internal=True)
        try:
            centre_distance = axis_distance(gears[name], new_gear, rng.uniform(0.0, 0.03))
            to_gear_stage(gears | {new_name: new_gear}, (name, new_name, centre_distance))
        except ValueError:
            # Teeth of these gears would interfere.
            continue
        gears[new_name] = new_gear
        ends = (name, new_name) if rng.random() < 0.5 else (new_name, name)
        meshes.append((*ends, centre_distance, float(rng.uniform(-3.0, 7.0))))
    return gears, meshes, shafts, int(rng.choice([1, -1]))


def build_train(placed_gears, rng):
    """Return the train of `PlacedGears`, with pinion and wheel named at random."""
    gears, meshes = placed_gears.gears, []
    for i, (driver, driven, centre_distance, angle) in enumerate(placed_gears.meshes):
        ring = next((name for name in (driver, driven) if gears[name].internal), None)
        direction = 1 if placed_gears.speed[driver] > 0 else -1
        pinion = driver if rng.random() < 0.5 else driven
        # The position of the mesh is seen from the axis of this gear.
        centre = pinion
        if ring:
            centre, pinion = ring, (driven if ring == driver else driver)
            # A ring gear is pressed in the opposite direction by its driver.
            direction = direction if ring == driver else -direction
        wheel = driven if pinion == driver else driver
        # By default the pinion of the first mesh drives.
        names_driver = rng.random() < 0.5 or (i == 0 and pinion != driver)
        fields = {"name": f"mesh {i}", "direction": direction}
        fields["position"] = angle if centre == driver else angle + math.pi
        fields["driving"] = driver if names_driver else None
        stage = to_gear_stage(gears, (pinion, wheel, centre_distance))
        meshes.append(gearlib.Mesh.from_geometry(stage, pinion, wheel, model="rectangle", **fields))
    bodies = [Body.from_gear(to_spur_gear(gear), name) for name, gear in gears.items()]
    shafts = [
        Shaft(bodies=(first, second), stiffness=1e6, keying=angle or None)
        for first, second, angle in placed_gears.shafts
    ]
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


def phase_difference(phases, expected_phases, period=1.0):
    """Return the largest phase difference modulo `period`, as a fraction of the period."""
    differences = (np.asarray(phases, float) - np.asarray(expected_phases, float)) / period
    return np.abs(differences - np.round(differences)).max()


def assert_same_phases(train, placed_gears):
    """Assert that a train has the phases and speeds of its `PlacedGears`, mesh by mesh."""
    drive, coast = (
        [placed_gears.phase(mesh, side) for mesh in placed_gears.meshes] for side in (0, 1)
    )
    assert phase_difference([*train.phases.values()], drive) < 1e-9
    assert phase_difference([*train.coast_phases.values()], coast) < 1e-9
    pitch = [placed_gears.pitch_phase(mesh) for mesh in placed_gears.meshes]
    assert phase_difference([*train.pitch_phases.values()], pitch, math.tau) < 1e-9
    for name, speed in placed_gears.speed.items():
        assert float(train.speeds.in_frame[name]) * math.tau == pytest.approx(speed, rel=1e-12)


def assert_friction_opposes_sliding(train, placed_gears, rng):
    """Assert that friction in the system of `tests.independent` opposes the sliding of teeth.

    Each contact of this system has a `friction_row`, along which friction acts on its bodies. Its
    sides have the coefficient `friction` and the phase `sliding_reversal` at which the sliding
    direction changes.
    """
    meshes = [dataclasses.replace(m, friction=(0.05, 0.08), backlash=1e-5) for m in train.meshes]
    supported = {"mass": 1.0, "support_stiffness": 1e8}
    bodies = [dataclasses.replace(body, **supported) for body in train.bodies]
    assembled = system_of(describe(train.replace(meshes=meshes, bodies=bodies)), 0.9)
    for mesh, contact in zip(placed_gears.meshes, assembled.contacts, strict=True):
        driver = mesh[0]
        rows = np.array(assembled.centre_rows(driver))
        for side, code in zip(contact["sides"], (1, -1), strict=True):
            flanks = FlankContact(placed_gears, mesh, code < 0)
            begin, pitch, end = placed_gears.contact_times(mesh, code < 0)
            # The tooth pair that is nearest to the pitch point decides on the sign.
            for time in rng.uniform(max(begin, pitch - 0.5), min(end, pitch + 0.5), 6):
                rotation = time * math.copysign(
                    placed_gears.gears[driver].pitch, placed_gears.speed[driver]
                )
                sliding_velocity = flanks.sliding_velocity(
                    flanks.point(0, placed_gears.tooth_angles[driver] + rotation)
                )
                direction = equations.sliding_direction(
                    1, side["sliding_reversal"], math.tau * time
                )
                # This is the friction force on the driver, divided by the normal force.
                x, y = -code * side["friction"] * direction * (rows @ contact["friction_row"])
                # The model uses the line of action of the drive side on the coast side, too.
                minimum_power = (
                    0.999 * math.hypot(x, y) * abs(sliding_velocity) if code > 0 else 0.0
                )
                assert math.hypot(x, y) == pytest.approx(abs(side["friction"]), rel=1e-9)
                assert x * sliding_velocity.real + y * sliding_velocity.imag <= -minimum_power


def exchange_gears(meshes):
    """Return the meshes of `PlacedGears` with driving and driven gears exchanged."""
    return [(b, a, distance, angle + math.pi) for a, b, distance, angle in meshes]


@pytest.mark.parametrize("seed", range(20))
def test_mesh_phases_match_teeth_placed_one_by_one(seed):
    """Compare phases and friction of random trains, mirrored and reversed, with their teeth."""
    rng = np.random.default_rng(seed)
    gears, meshes, shafts, rotation_direction = random_placement(rng)
    placed_gears = PlacedGears(gears, meshes, shafts, rotation_direction)
    train = build_train(placed_gears, rng)
    assert_same_phases(train, placed_gears)
    assert_friction_opposes_sliding(train, placed_gears, rng)
    meshes_with_lines = [
        dataclasses.replace(m, position=None, line_of_action=m.line) for m in train.meshes
    ]
    assert train.replace(meshes=meshes_with_lines).phases == pytest.approx(train.phases, abs=1e-12)
    # Names of pinion and wheel and reflection in a mirror must not change the phases.
    assert build_train(placed_gears, rng).phases == pytest.approx(train.phases, abs=1e-12)
    mirrored_meshes = [(*mesh[:3], -mesh[3]) for mesh in meshes]
    mirrored_shafts = [(*shaft[:2], -shaft[2]) for shaft in shafts]
    mirrored = PlacedGears(gears, mirrored_meshes, mirrored_shafts, -rotation_direction)
    assert build_train(mirrored, rng).phases == pytest.approx(train.phases, abs=1e-12)
    # If the train runs backwards on the same flanks, phases have the opposite sign.
    driven_direction = math.copysign(1.0, placed_gears.speed[meshes[0][1]])
    reverse = build_train(
        PlacedGears(gears, exchange_gears(meshes), shafts, -driven_direction), rng
    )
    for name in ("phases", "coast_phases"):
        phases = list(getattr(train, name).values())
        reverse_phases = list(getattr(reverse, name).values())
        assert phase_difference(phases, [-phase for phase in reverse_phases]) < 1e-9


#: Teeth and shifts of sun, planet and ring, and angles of the planets.
PLANETARY_SETS = {
    "nominal": ((27, 36, 99), (0.0, 0.0, 0.0), [math.tau * i / 3 for i in range(3)]),
    "odd planet": ((28, 35, 98), (0.0, 0.0, 0.0), [math.tau * i / 3 for i in range(3)]),
    "shifted": ((24, 37, 99), (0.3, 0.25, -0.55), [math.tau * i / 3 for i in range(3)]),
    "fewer teeth": ((25, 36, 99), (0.0, 0.3, -0.11), [math.tau * i / 4 for i in range(4)]),
    "unequal": ((27, 36, 99), (0.0, 0.0, 0.0), [0.3 + math.tau * i / 126 for i in (0, 40, 76)]),
}


@pytest.mark.parametrize("driving", ["sun", "ring"])
@pytest.mark.parametrize("name", PLANETARY_SETS)
def test_phases_of_a_planetary_set_match_its_teeth_for_sun_and_ring_drive(name, driving):
    """Compare phases and friction of planetary sets with teeth placed one by one."""
    teeth, shifts, positions = PLANETARY_SETS[name]
    sun, planet, ring = map(Gear, teeth, shifts, (False, False, True))
    distance = axis_distance(sun, planet)
    train = planetary_set(
        *map(to_spur_gear, (sun, planet, ring)),
        planets=len(positions),
        positions=positions if name == "unequal" else None,
        centre_distance=distance,
        torque=100.0,
        driving=driving,
    )
    pins = {f"planet {i}": psi for i, psi in enumerate(positions, 1)}
    gears = {"sun": sun, "ring": ring} | dict.fromkeys(pins, planet)
    meshes = [("sun", name, distance, psi) for name, psi in pins.items()]
    meshes += [(name, "ring", distance, psi + math.pi) for name, psi in pins.items()]
    placed_gears = PlacedGears(gears, exchange_gears(meshes) if driving == "ring" else meshes)
    assert train.speeds.in_frame["carrier"] == 0
    assert_same_phases(train, placed_gears)
    assert_friction_opposes_sliding(train, placed_gears, np.random.default_rng(1))


MESH_VALUES = {"max_stiffness": 4e8, "stiffness_ratio": 0.6, "contact_ratio": 1.6}


def build_two_stage_train(
    teeth, angles=(0.0, 0.0), rotation_direction=1, keying=None, **mesh_fields
):
    """Return the train of meshes a-b and c-d, with wheel b and pinion c keyed to one shaft.

    `angles` are the directions of the lines of centres. If `rotation_direction` is 1, gear a
    rotates counterclockwise. `keying` is the angle by which c is ahead of b.
    """
    bodies = [
        Body(name=name, teeth=z, inertia=1e-3, base_radius=2e-3 * z)
        for name, z in zip("abcd", teeth, strict=True)
    ]
    mesh_fields |= MESH_VALUES
    meshes = [
        gearlib.Mesh(
            pinion="a", wheel="b", position=angles[0], direction=rotation_direction, **mesh_fields
        ),
        gearlib.Mesh(
            pinion="c", wheel="d", position=angles[1], direction=-rotation_direction, **mesh_fields
        ),
    ]
    shaft = Shaft(bodies=("b", "c"), stiffness=1e6, keying=keying)
    return GearTrain(bodies=bodies, meshes=meshes, shafts=[shaft])


def test_keyings_add_up_through_a_body_without_teeth():
    """Keying angles over two shafts must add up to the phases of a single shaft."""
    train = build_two_stage_train((24, 36, 24, 36), keying=0.1)
    # Keyings may be given from either end of a shaft: 0.3 - 0.2 = 0.1.
    shafts = [
        Shaft(bodies=("b", "flywheel"), stiffness=1e6, keying=0.3),
        Shaft(bodies=("c", "flywheel"), stiffness=1e6, keying=0.2),
    ]
    flywheel = Body(name="flywheel", inertia=1e-2, base_radius=0.1)
    joined = train.replace(bodies=(*train.bodies, flywheel), shafts=shafts)
    assert joined.phases == pytest.approx(train.phases, abs=1e-12)


def test_mirrored_trains_choose_the_mirrored_tooth_in_a_tie():
    """If two teeth are equally near to the line of centres, the one with its drive flank counts."""
    teeth, angles, pitch_phase = (24, 36, 20, 40), (0.3, 1.1), 1.5 * math.pi
    train = build_two_stage_train(teeth, angles, pitch_phase=pitch_phase)
    mirrored = build_two_stage_train(
        teeth, [-x for x in angles], rotation_direction=-1, pitch_phase=pitch_phase
    )
    assert mirrored.phases == pytest.approx(train.phases, abs=1e-12)
    # The tooth half a pitch to the counterclockwise side, with its drive flanks, counts.
    teeth_passed = 36 * (0.3 + math.pi) / math.tau + 0.5
    pitches_behind = 20 * 1.1 / math.tau - teeth_passed * 20 / 36 + 0.25
    expected = -pitches_behind - pitch_phase / math.tau
    assert phase_difference(train.phases["c-d"], expected) < 1e-12


def test_a_keying_that_contradicts_a_closed_loop_is_refused():
    """Keyings of 0 on both shafts contradict each other at this angle between two branches."""
    pair = gearlib.GearPair(**MESH_VALUES, reduced_mass=3.0, load=3e3, backlash=4e-5)
    train = gearlib.split_power_reducer(pair, branches=2, teeth=(24, 36, 24, 36))
    angles = (0.0, math.tau / 3 + 0.05, math.pi, math.pi + math.tau / 3 + 0.05)
    meshes = [
        dataclasses.replace(mesh, position=angle)
        for mesh, angle in zip(train.meshes, angles, strict=True)
    ]

    def phases(*keyings):
        """Return the phases of the train with given keyings of its shafts."""
        shafts = [
            dataclasses.replace(shaft, keying=keying)
            for shaft, keying in zip(train.shafts, keyings, strict=True)
        ]
        return train.replace(meshes=meshes, shafts=shafts).phases

    with pytest.raises(ValueError, match="keying of shaft satellite 2 a-satel") as refusal:
        phases(0.0, 0.0)
    required_keying = float(str(refusal.value).split("must be ")[1].split(" plus")[0])
    assert phases(0.0, required_keying) == pytest.approx(phases(None, None), abs=1e-7)
    # A keying of the second shaft alone determines the phases of the first branch.
    assert phases(None, 0.0) != phases(None, None)


def test_a_prescribed_mesh_phase_decouples_both_sides_of_the_mesh():
    """Teeth behind a mesh of prescribed phase are unknown; a phase of the first mesh shifts all."""
    bodies = [Body(name=name, teeth=24, inertia=1e-3, base_radius=0.045) for name in "abcd"]
    meshes = [
        gearlib.Mesh(pinion=a, wheel=b, position=0.3 * i * i, direction=(-1) ** i, **MESH_VALUES)
        for i, (a, b) in enumerate(("ab", "bc", "cd"))
    ]
    train = GearTrain(bodies=bodies, meshes=meshes)

    def phases_of(**phases):
        """Return the phases of the train with phases prescribed by name of the pinion."""
        with_phases = [dataclasses.replace(m, phase=phases.get(m.pinion)) for m in meshes]
        return list(train.replace(meshes=with_phases).phases.values())

    free = phases_of()
    assert 0.0 not in free[1:]
    assert phases_of(a=0.2) == pytest.approx([(g + 0.2) % 1.0 for g in free], abs=1e-12)
    assert phases_of(b=0.35) == pytest.approx([0.0, 0.35, 0.0], abs=1e-12)
    assert phases_of(a=0.2, b=0.35, c=1.6) == pytest.approx([0.2, 0.35, 0.6], abs=1e-12)
    # Without tooth thicknesses both sides have equal phases unless one is prescribed.
    coast = train.replace(meshes=[dataclasses.replace(meshes[0], coast_phase=1.25), *meshes[1:]])
    assert coast.coast_phases == train.phases | {"a-b": 0.25}


def test_the_driving_gear_of_one_mesh_sets_all_directions():
    """If the wheel of any mesh drives, all speeds and pitch phases change their sign."""
    train = build_two_stage_train((24, 36, 20, 40), pitch_phase=0.7)
    first, second = (dataclasses.replace(mesh, driving=mesh.wheel) for mesh in train.meshes)
    backwards = train.replace(meshes=[first, second])
    in_frame = train.speeds.in_frame
    assert backwards.speeds.in_frame == {name: -speed for name, speed in in_frame.items()}
    assert backwards.pitch_phases == {"a-b": -0.7, "c-d": -0.7}
    # It is enough to name the driving gear of the second mesh.
    assert train.replace(meshes=[train.meshes[0], second]).phases == backwards.phases
    refusal = "driving of mesh c-d = '{}' is not allowed: it must be {}"
    with pytest.raises(ValueError, match=refusal.format("c", "'d'")):
        train.replace(meshes=[first, dataclasses.replace(second, driving="c")])
    with pytest.raises(ValueError, match=refusal.format("a", "one")):
        dataclasses.replace(second, driving="a")
