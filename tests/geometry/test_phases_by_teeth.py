"""Phases and friction of trains against teeth placed one by one, under every name, mirrored."""

import dataclasses
import math

import numpy as np
import pytest

import gearlib
from gearlib import Body, GearTrain, Shaft
from gearlib.geometry import Mesh, SpurGear, planetary_set
from tests.geometry.teeth import Flanks, Gear, Machine, distance
from tests.independent import equations
from tests.independent.systems import describe, system_of

WIDTH = 0.02


def drawing_of(gear):
    """Return the `SpurGear` of a `Gear` of the second code."""
    rim = {"outer_diameter": 2.2 * gear.tip} if gear.internal else {}
    return SpurGear(
        teeth=gear.teeth,
        shift=gear.shift,
        internal=gear.internal,
        module=gear.module,
        width=WIDTH,
        **rim,
    )


def random_machine(rng):
    """Return (gears, meshes, shafts, sense): a tree of meshes, driven either way, and shafts."""

    def external():
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
            centre_distance = distance(gears[name], new_gear, rng.uniform(0.0, 0.03))
            _mesh(gears | {new_name: new_gear}, (name, new_name, centre_distance, 0.0))
        except ValueError:
            continue  # such teeth interfere
        gears[new_name] = new_gear
        ends = (name, new_name) if rng.random() < 0.5 else (new_name, name)
        meshes.append((*ends, centre_distance, float(rng.uniform(-3.0, 7.0))))
    return gears, meshes, shafts, int(rng.choice([1, -1]))


def _mesh(gears, mesh):
    names = sorted(mesh[:2], key=lambda name: gears[name].internal)
    return Mesh(*(drawing_of(gears[name]) for name in names), mesh[2])


def train_of(machine, rng):
    """Return the train of a `Machine`, whose gears are called pinion and wheel at random."""
    gears, meshes = machine.gears, []
    for i, mesh in enumerate(machine.meshes):
        driver, driven, apart, ahead = mesh
        inner = next((name for name in mesh[:2] if gears[name].internal), None)
        way = 1 if machine.speed[driver] > 0 else -1
        pinion = driver if rng.random() < 0.5 else driven
        begin = pinion
        if inner:
            begin, pinion = inner, (driven if inner == driver else driver)
            # A ring gear is pressed backwards by what drives it.
            way = way if inner == driver else -way
        wheel = driven if pinion == driver else driver
        drawing = Mesh(drawing_of(gears[pinion]), drawing_of(gears[wheel]), apart)
        said = rng.random() < 0.5 or (i == 0 and pinion != driver)
        meshes.append(
            gearlib.Mesh.from_geometry(
                drawing,
                pinion,
                wheel,
                name=f"mesh {i}",
                position=ahead if begin == driver else ahead + math.pi,
                direction=way,
                driving=driver if said else None,
            )
        )
    bodies = [Body.from_gear(drawing_of(gear), name) for name, gear in gears.items()]
    shafts = [
        Shaft(bodies=(one, other), stiffness=1e6, keying=angle or None)
        for one, other, angle in machine.shafts
    ]
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


def phase_difference(phases, others, period=1.0):
    """Return the largest difference of phases, as a fraction of their period."""
    differences = (np.asarray(phases, float) - np.asarray(others, float)) / period
    return np.abs(differences - np.round(differences)).max()


def assert_same_phases(train, machine):
    """Assert that phases and speeds of a train are those of the `Machine`."""
    names = [f"mesh {i}" for i in range(len(machine.meshes))]
    drive, coast = ([machine.phase(mesh, back) for mesh in machine.meshes] for back in (0, 1))
    assert phase_difference([train.phases[name] for name in names], drive) < 1e-9
    assert phase_difference([train.inverse_phases[name] for name in names], coast) < 1e-9
    pitch = [machine.pitch_phase(mesh) for mesh in machine.meshes]
    assert phase_difference([train.pitch_phases[name] for name in names], pitch, math.tau) < 1e-9
    for name, speed in machine.speed.items():
        assert float(train.speeds[name]) * math.tau == pytest.approx(speed, rel=1e-12)


def assert_friction_opposes_sliding(train, machine, contacts, rng):
    """Assert that friction, as `tests.independent` has it, opposes the sliding of the teeth.

    On the coast side the model keeps the line of action of the drive side.
    """
    meshes = [dataclasses.replace(m, friction=(0.05, 0.08), backlash=1e-5) for m in train.meshes]
    supported = {"mass": 1.0, "support_stiffness": 1e8}
    bodies = [dataclasses.replace(body, **supported) for body in train.bodies]
    assembled = system_of(describe(train.replace(meshes=meshes, bodies=bodies)), 0.9)
    for mesh, contact in zip(contacts, assembled.contacts, strict=True):
        driver = mesh[0]
        rows = np.array(assembled.fixed(driver))
        for side, code in zip(contact["sides"], (1, -1), strict=True):
            flanks = Flanks(machine, mesh, code < 0)
            begin, pitch, end = machine.passes(mesh, code < 0)
            # The pair of teeth that is nearest to the pitch point tells the way.
            for at in rng.uniform(max(begin, pitch - 0.5), min(end, pitch + 0.5), 6):
                turn = at * math.copysign(machine.gears[driver].pitch, machine.speed[driver])
                slip = flanks.slip(flanks.point(0, machine.middles[driver] + turn))
                way = equations.sense(1, side["turns"], math.tau * at)
                # Pressed by a distance of the sign of its code: force on the driver, over C d.
                x, y = -code * side["friction"] * way * (rows @ contact["across"])
                least = 0.999 * math.hypot(x, y) * abs(slip) if code > 0 else 0.0
                assert math.hypot(x, y) == pytest.approx(abs(side["friction"]), rel=1e-9)
                assert x * slip.real + y * slip.imag <= -least


@pytest.mark.parametrize("seed", range(30))
def test_phases_are_those_of_teeth_placed_one_by_one(seed):
    rng = np.random.default_rng(seed)
    gears, meshes, shafts, sense = random_machine(rng)
    machine = Machine(gears, meshes, shafts, sense)
    train = train_of(machine, rng)
    assert_same_phases(train, machine)
    assert_friction_opposes_sliding(train, machine, machine.meshes, rng)
    lines = [dataclasses.replace(m, position=None, line_of_action=m.line) for m in train.meshes]
    assert train.replace(meshes=lines).phases == pytest.approx(train.phases, abs=1e-12)
    # One machine, one result: by other names, in a mirror, and driven backwards by the same flanks.
    assert train_of(machine, rng).phases == pytest.approx(train.phases, abs=1e-12)
    mirrored = Machine(
        gears,
        [(*mesh[:3], -mesh[3]) for mesh in meshes],
        [(*shaft[:2], -shaft[2]) for shaft in shafts],
        -sense,
    )
    assert train_of(mirrored, rng).phases == pytest.approx(train.phases, abs=1e-12)
    turned = math.copysign(1.0, machine.speed[meshes[0][1]])
    swapped = [(b, a, gap, ahead + math.pi) for a, b, gap, ahead in meshes]
    reverse = train_of(Machine(gears, swapped, shafts, -turned), rng)
    for found, backwards in (
        (train.phases, reverse.phases),
        (train.inverse_phases, reverse.inverse_phases),
    ):
        assert phase_difference(list(found.values()), [-g for g in backwards.values()]) < 1e-9


SETS = {
    "nominal": ((27, 36, 99), (0.0, 0.0, 0.0), 3, None),
    "odd planet": ((28, 35, 98), (0.0, 0.0, 0.0), 3, None),
    "shifted": ((24, 37, 99), (0.3, 0.25, -0.55), 3, None),
    "fewer teeth": ((25, 36, 99), (0.0, 0.3, -0.11), 4, None),
    "unequal": ((27, 36, 99), (0.0, 0.0, 0.0), 3, (0.3, 0.3 + math.tau * 40 / 126, 4.0893)),
}


@pytest.mark.parametrize("driving", ["sun", "ring"])
@pytest.mark.parametrize("name", SETS)
def test_planetary_set_driven_by_sun_or_ring(name, driving):
    teeth, shifts, planets, positions = SETS[name]
    if positions:
        step = math.tau / (teeth[0] + teeth[2])
        positions = [positions[0] + step * round((p - positions[0]) / step) for p in positions]
    pairs = zip(("sun", "planet", "ring"), teeth, shifts, (False, False, True), strict=True)
    kinds = {who: Gear(z, x, internal=inner) for who, z, x, inner in pairs}
    gap = distance(kinds["sun"], kinds["planet"])
    train = planetary_set(
        *(drawing_of(gear) for gear in kinds.values()),
        planets=planets,
        positions=positions,
        centre_distance=gap,
        torque=100.0,
        driving=driving,
    )
    positions = positions or [math.tau * i / planets for i in range(planets)]
    gears, meshes = {who: kinds[who] for who in ("sun", "ring")}, []
    for i, psi in enumerate(positions):
        planet = f"planet {i + 1}"
        gears[planet] = kinds["planet"]
        meshes += [("sun", planet, gap, psi), (planet, "ring", gap, psi + math.pi)]
    meshes.sort(key=lambda mesh: mesh[0] != "sun")
    if driving == "ring":
        meshes = [(b, a, gap, ahead + math.pi) for a, b, gap, ahead in meshes]
    machine = Machine(gears, meshes)
    assert train.speeds["carrier"] == 0
    numbered = dict(zip(train.mesh_names, meshes, strict=True))
    for mesh, contact in numbered.items():
        for coast, found in ((False, train.phases), (True, train.inverse_phases)):
            assert phase_difference(found[mesh], machine.phase(contact, coast)) < 1e-9, mesh
        assert (
            phase_difference(train.pitch_phases[mesh], machine.pitch_phase(contact), math.tau)
            < 1e-9
        )
    assert_friction_opposes_sliding(
        train, machine, list(numbered.values()), np.random.default_rng(1)
    )
    # Parker: z_s psi / 2 pi and -z_r psi / 2 pi, the other way round in time.
    way = 1 if driving == "sun" else -1
    for i, psi in enumerate(positions):
        turned = (psi - positions[0]) / math.tau
        assert phase_difference(train.phases[f"sun {i + 1}"], way * teeth[0] * turned) < 1e-9
        ring = train.phases[f"ring {i + 1}"] - train.phases["ring 1"]
        assert phase_difference(ring, -way * teeth[2] * turned) < 1e-9


def keyed(teeth, places=(0.0, 0.0), sense=1, keying=None, **more):
    """Return two stages with a shaft, the lines of centres at these angles."""
    bodies = [
        Body(name=name, teeth=z, inertia=1e-3, base_radius=2e-3 * z)
        for name, z in zip("abcd", teeth, strict=True)
    ]
    flank = dict(max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.6)
    meshes = [
        gearlib.Mesh(
            pinion=pinion, wheel=wheel, position=place, direction=way * sense, **flank, **more
        )
        for pinion, wheel, place, way in (("a", "b", places[0], 1), ("c", "d", places[1], -1))
    ]
    shaft = Shaft(bodies=("b", "c"), stiffness=1e6, keying=keying)
    return GearTrain(bodies=bodies, meshes=meshes, shafts=[shaft])


def test_keyed_teeth_are_in_line():
    """By hand: a tooth of 36 whose flank is at the mesh lies 18 - 1/4 pitches from angle 0.

    The one of 24 in line with it lies 24/36 as many of its own pitches away, and its flank is at
    the mesh when the tooth has come to 1/4: after 24/36 (18 - 1/4) - 1/4 periods of that mesh.
    """
    right = (24 / 36 * (18 - 0.25) - 0.25) % 1.0
    for sense in (1, -1):
        assert keyed((24, 36, 24, 36), sense=sense).phases["c-d"] == pytest.approx(right, abs=1e-12)
    # Keyed by an angle the second gear is so much ahead; it turns clockwise and drives.
    ahead = keyed((24, 36, 24, 36), keying=0.1).phases["c-d"]
    assert phase_difference(ahead, right + 24 * 0.1 / math.tau) < 1e-12
    # By a pitch of either gear the teeth are in line again.
    for pitch, whole in ((math.tau / 24, 1.0), (math.tau / 36, 1.0 / 3.0)):
        assert (
            phase_difference(keyed((24, 36, 24, 36), keying=pitch).phases["c-d"], right, whole)
            < 1e-12
        )
    assert loop().phases["second 1"] == pytest.approx(right, abs=1e-12)
    # Through a body without teeth angles add up, from whichever end they are given.
    train = keyed((24, 36, 24, 36))
    shafts = [
        Shaft(bodies=("b", "flywheel"), stiffness=1e6, keying=0.3),
        Shaft(bodies=("c", "flywheel"), stiffness=1e6, keying=0.2),
    ]
    flywheel = Body(name="flywheel", inertia=1e-2, base_radius=0.1)
    joined = train.replace(bodies=(*train.bodies, flywheel), shafts=shafts)
    assert joined.phases["c-d"] == pytest.approx(ahead, abs=1e-12)


def test_of_two_teeth_equally_near_a_mirror_image_takes_the_same():
    """Two teeth of the second gear are as near to the line of centres at the start."""
    gears, places, pitch = (24, 36, 20, 40), (0.3, 1.1), 1.5 * math.pi
    one = keyed(gears, places, pitch_phase=pitch)
    other = keyed(gears, [-place for place in places], sense=-1, pitch_phase=pitch)
    assert other.phases == pytest.approx(one.phases, abs=1e-12)
    # It is the one half a pitch to the counterclockwise side, where the drive-side flanks are.
    turned = 36 * (0.3 + math.pi) / math.tau + 0.5
    away = 20 * 1.1 / math.tau - turned * 20 / 36 + 0.25
    assert phase_difference(one.phases["c-d"], -away - pitch / math.tau) < 1e-12


def loop(keyings=(None, None), second=math.tau / 3, teeth=(24, 36, 24, 36)):
    """Return a reducer of two branches."""
    train = gearlib.split_power_reducer(
        gearlib.GearPair(
            max_stiffness=4e8,
            stiffness_ratio=0.6,
            contact_ratio=1.6,
            reduced_mass=3.0,
            load=3e3,
            backlash=4e-5,
        ),
        branches=2,
        teeth=teeth,
    )
    places = {"1": 0.0, "2": second}
    meshes = [
        dataclasses.replace(
            mesh, position=places[mesh.name[-1]] + (math.pi if "second" in mesh.name else 0.0)
        )
        for mesh in train.meshes
    ]
    shafts = [
        dataclasses.replace(shaft, keying=keying)
        for shaft, keying in zip(train.shafts, keyings, strict=True)
    ]
    return train.replace(meshes=meshes, shafts=shafts)


def test_keying_in_a_loop_has_to_agree_with_the_positions():
    assert loop().phases == loop((0.0, 0.0)).phases
    # Branches at other angles need another angle in one of them.
    second = math.tau / 3 + 0.05
    free = loop(second=second)
    with pytest.raises(ValueError, match="keying of shaft satellite 2 a-satel") as refusal:
        loop((0.0, 0.0), second)
    text = str(refusal.value)
    assert "\n" not in text and ". " not in text.replace("0.", "0")
    asked = float(text.split("must be ")[1].split(",")[0])
    assert loop((0.0, asked), second).phases == pytest.approx(free.phases, abs=1e-7)
    # Asked for in the second branch, it is the first that gives way.
    assert loop((None, 0.0), second).phases != free.phases


def test_a_phase_that_is_given_parts_the_train():
    """Beyond a mesh whose phase is given no tooth is known; a given start shifts all."""
    flank = dict(max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.6)
    bodies = [Body(name=name, teeth=24, inertia=1e-3, base_radius=0.045) for name in "abcd"]
    meshes = [
        gearlib.Mesh(pinion=a, wheel=b, position=0.3 * i * i, direction=(-1) ** i, **flank)
        for i, (a, b) in enumerate(("ab", "bc", "cd"))
    ]
    train = GearTrain(bodies=bodies, meshes=meshes)

    def given(**phases):
        with_phases = [dataclasses.replace(m, phase=phases.get(m.pinion)) for m in meshes]
        return list(train.replace(meshes=with_phases).phases.values())

    free = given()
    assert 0.0 not in free[1:]
    assert given(a=0.2) == pytest.approx([(g + 0.2) % 1.0 for g in free], abs=1e-12)
    assert given(b=0.35) == pytest.approx([0.0, 0.35, 0.0], abs=1e-12)
    assert given(a=0.2, b=0.35, c=1.6) == pytest.approx([0.2, 0.35, 0.6], abs=1e-12)
    # Without a thickness the coast side has the phase of the drive side, unless it is given.
    coast = train.replace(meshes=[dataclasses.replace(meshes[0], inverse_phase=1.25), *meshes[1:]])
    assert coast.inverse_phases == train.phases | {"a-b": 0.25}


def test_driving_gear_of_one_mesh_decides_for_all():
    train = keyed((24, 36, 20, 40), pitch_phase=0.7)
    assert {name: train.pitch_phases[name] for name in train.mesh_names} == {"a-b": 0.7, "c-d": 0.7}
    back = [dataclasses.replace(mesh, driving=mesh.wheel) for mesh in train.meshes]
    backwards = train.replace(meshes=back)
    assert backwards.speeds == {name: -speed for name, speed in train.speeds.items()}
    assert backwards.pitch_phases == {"a-b": -0.7, "c-d": -0.7}
    # One mesh is enough, and it is believed whichever it is.
    for one in (0, 1):
        meshes = [back[i] if i == one else mesh for i, mesh in enumerate(train.meshes)]
        assert train.replace(meshes=meshes).phases == backwards.phases
    against = [back[0], dataclasses.replace(train.meshes[1], driving="c")]
    with pytest.raises(
        ValueError, match="driving of mesh c-d = 'c' is not allowed: it must be 'd'"
    ):
        train.replace(meshes=against)
    with pytest.raises(
        ValueError, match="driving of mesh c-d = 'a' is not allowed: it must be one"
    ):
        dataclasses.replace(train.meshes[1], driving="a")


def test_train_turned_as_a_whole_moves_alike():
    """Run-out of a planet goes by its pin, as its teeth and its misplaced axis do."""

    def planets(turn):
        train = gearlib.planetary(
            positions=[turn + math.tau * i / 3 for i in range(3)], stiffness_ratio=(0.7, 0.7)
        )
        bodies = [
            dataclasses.replace(
                body,
                eccentricity=3e-6,
                eccentricity_phase=0.4 + (0.0 if body.carrier else turn),
                offset=(2e-6, 1e-6) if body.carrier else (0.0, 0.0),
            )
            if body.name in ("sun", "planet 2")
            else body
            for body in train.bodies
        ]
        return train.replace(bodies=bodies)

    plain, turned = planets(0.0), planets(1.3)
    assert turned.phases == pytest.approx(plain.phases, abs=1e-12)
    for one, other in zip(plain.excitation, turned.excitation, strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-20)
    runs = [gearlib.simulate(train, 0.9, periods=12, record_periods=2) for train in (plain, turned)]
    np.testing.assert_allclose(
        runs[1].dynamic_force.values, runs[0].dynamic_force.values, rtol=0, atol=1e-9
    )
