"""Schematics of trains: circles and meshes against plane kinematics, marks of contact."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import gearlib
from gearlib.figures import schematic
from tests.trains import random_trains

PAIR = gearlib.GearPair(
    max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.6, reduced_mass=3.0, load=3e3,
    backlash=40e-6,
)  # fmt: skip
TRAINS = {
    "planetary": gearlib.planetary(),
    "turning": gearlib.planetary(turning=True, planets=4, teeth=(28, 100)),
    "reducer": gearlib.split_power_reducer(PAIR),
    "ring at the output": gearlib.split_power_reducer(PAIR, internal=True),
    "idler": gearlib.idler(PAIR, angle=2.0),
    "two stages": gearlib.two_stage(PAIR, modules=(0.003, 0.005)),
    **{f"chain {n}": random_trains.chain_train(np.random.default_rng(n)) for n in range(2)},
}


def axes_of(train, mesh):
    """Return the axes of pinion and wheel in m, seen from the pitch point."""
    angle = mesh.centre_line_angle
    direction = np.array([math.cos(angle), math.sin(angle)])
    pinion, wheel = (
        train.by_name[name].base_radius / math.cos(mesh.pressure_angle) * direction
        for name in (mesh.pinion, mesh.wheel)
    )
    # The axes lie on both sides of the pitch point, those of a planet and a ring gear on one side.
    return -pinion, -wheel if mesh.internal else wheel


def draw(train, **instant):
    axes = Figure().add_subplot()
    schematic.draw(axes, train.layout(), **instant)
    return axes


def dots(axes):
    """Return the marks of meshes: lines of one point."""
    return [line for line in axes.lines if len(line.get_xdata()) == 1]


@pytest.mark.parametrize("name", TRAINS)
@pytest.mark.parametrize("phase", [0.0, 7.0])
def test_pitch_circles_touch_at_the_pitch_points(name, phase):
    train = TRAINS[name]
    axes, matched_circles = draw(train, phase=phase), []
    hubs = [patch for patch in axes.patches if patch.get_fill()]
    circles = [patch for patch in axes.patches if isinstance(patch, Circle) and patch not in hubs]
    # Carriers turn the meshes, seen from the housing, by this angle.
    angle = train.carrier_ratio * float(train.speeds[train.reference_mesh.pinion]) * phase
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    for mesh, dot in zip(train.meshes, dots(axes), strict=True):
        for arm in axes_of(train, mesh):
            centre, radius = dot.get_xydata()[0] + rotation @ arm, math.hypot(*arm)
            pitch_circles = [
                circle
                for circle in circles
                if math.dist(circle.center, centre) < 1e-9 and abs(circle.radius - radius) < 1e-9
            ]
            assert pitch_circles, mesh.name
            matched_circles += pitch_circles
    assert {*map(id, circles)} <= {*map(id, matched_circles)}
    # A hub for each shaft, where both of its bodies have their axis.
    assert len(hubs) == len(train.shafts) and float(train.layout().misfit) == 0.0
    assert all(any(math.dist(hub.center, c.center) < 1e-9 for c in circles) for hub in hubs)
