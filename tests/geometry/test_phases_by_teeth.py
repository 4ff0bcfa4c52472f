"""Phases of trains against teeth placed one by one, under every name, mirrored and reversed."""

import dataclasses
import math

import numpy as np
import pytest

import gearlib
from gearlib import Body, GearTrain, Shaft
from gearlib.geometry import Mesh, SpurGear, planetary_set
from tests.geometry.teeth import Gear, Machine, distance

WIDTH = 0.02


def drawn(gear):
    """Return the drawing of one of the gears of the second code."""
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
    """Return (gears, meshes, shafts, sense): a tree of meshes and shafts, each driven either way."""

    def external():
        return Gear(int(rng.integers(19, 46)), float(rng.choice([0.0, rng.uniform(0.0, 0.5)])))

    gears, meshes, shafts = {"g0": external()}, [], []
    count = int(rng.integers(2, 6))
    while len(meshes) < count:
        one = str(rng.choice(list(gears)))
        other, new = f"g{len(gears)}", external()
        if meshes and rng.random() < 0.35:
            gears[other] = new
            angle = float(rng.choice([0.0, rng.uniform(-3.0, 3.0)]))
            shafts.append((*rng.permutation([one, other]).tolist(), angle))
            continue
        if gears[one].internal:
            new = Gear(int(rng.integers(19, gears[one].teeth - 35)), 0.0)
        elif rng.random() < 0.3:
            teeth = max(gears[one].teeth + int(rng.integers(36, 60)), 70)
            new = Gear(teeth, -gears[one].shift, internal=True)
        ends = one, other
        try:
            gap = distance(gears[one], new, rng.uniform(0.0, 0.03))
            _mesh(gears | {other: new}, (one, other, gap, 0.0))
        except ValueError:
            continue  # such teeth interfere
        gears[other] = new
        ends = ends if rng.random() < 0.5 else ends[::-1]
        meshes.append((*ends, gap, float(rng.uniform(-3.0, 7.0))))
    return gears, meshes, shafts, int(rng.choice([1, -1]))


def _mesh(gears, mesh):
    ends = sorted(mesh[:2], key=lambda name: gears[name].internal)
    return Mesh(*(drawn(gears[name]) for name in ends), mesh[2])


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
        drawing = Mesh(drawn(gears[pinion]), drawn(gears[wheel]), apart)
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
    bodies = [Body.from_gear(drawn(gear), name) for name, gear in gears.items()]
    shafts = [
        Shaft(bodies=(one, other), stiffness=1e6, keying=angle or None)
        for one, other, angle in machine.shafts
    ]
    return GearTrain(bodies=bodies, meshes=meshes, shafts=shafts)


def apart(one, other, whole=1.0):
    """Return the largest difference of phases, in their periods."""
    away = np.asarray(one, float) / whole - np.asarray(other, float) / whole
    return np.abs(away - np.round(away)).max()


def check(train, machine):
    names = [f"mesh {i}" for i in range(len(machine.meshes))]
    drive, coast = ([machine.phase(mesh, back) for mesh in machine.meshes] for back in (0, 1))
    assert apart([train.phases[name] for name in names], drive) < 1e-9
    assert apart([train.inverse_phases[name] for name in names], coast) < 1e-9
    pitch = [machine.pitch_phase(mesh) for mesh in machine.meshes]
    assert apart([train.pitch_phases[name] for name in names], pitch, math.tau) < 1e-9
    for name, speed in machine.speed.items():
        assert float(train.speeds[name]) * math.tau == pytest.approx(speed, rel=1e-12)


@pytest.mark.parametrize("seed", range(60))
def test_phases_are_those_of_teeth_placed_one_by_one(seed):
    rng = np.random.default_rng(seed)
    gears, meshes, shafts, sense = random_machine(rng)
    machine = Machine(gears, meshes, shafts, sense)
    train = train_of(machine, rng)
    check(train, machine)
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
        assert apart(list(found.values()), [-g for g in backwards.values()]) < 1e-9
