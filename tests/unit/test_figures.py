"""Figures of odd data: gaps, single values, no limits; schematics of trains."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import gearlib
from gearlib.figures import (
    jump_figure,
    nonlinear_damping_figure,
    phase_planes_figure,
    resonance_figure,
    schematic,
    style,
)
from tests.golden import data as golden
from tests.paper import PAPER
from tests.trains import random_trains

EXTREMA = ["displacement_max", "displacement_min"]
CURVES, PLANES = golden.read("resonance.nc"), golden.read("phase_planes.nc")


def gone(data, *names):
    """Return data of which variables have no numbers."""
    return data.assign({name: data[name] * np.nan for name in names})


def jumps():
    data = gone(golden.read("jump.nc"), "jump")
    return data.isel(variation=np.isin(data.kind.values, ["base", "damping"]))


def powers():
    names = [f"nonlinear_damping/{place}_cubic.nc" for place in ("material", "oil")]
    return [gone(golden.read(name), *EXTREMA, "displacement", "velocity") for name in names]


#: Figures of which no limit may be lost.
ODD = {
    "no backlash": lambda: resonance_figure.draw(CURVES.assign(backlash_ratio=0.0)),
    "no far flank": lambda: resonance_figure.draw(CURVES.assign(backlash_ratio=math.inf)),
    "planes without a far flank": lambda: phase_planes_figure.draw(
        PLANES.assign(backlash_ratio=math.inf)
    ),
    "a plane without a result": lambda: phase_planes_figure.draw(
        PLANES.assign(displacement=PLANES.displacement.where(PLANES.damping != "k1"))
    ),
    "no result at a tuning": lambda: resonance_figure.draw(
        CURVES.assign(CURVES[EXTREMA].where(CURVES.tuning > 0.6))
    ),
    "one tuning": lambda: resonance_figure.draw(CURVES.isel(tuning=[4])),
    "no jump": lambda: jump_figure.draw(jumps()),
    "no results": lambda: nonlinear_damping_figure.draw(powers()),
}


@pytest.mark.parametrize("case", ODD)
def test_limits_are_numbers(case):
    for axes in ODD[case]().axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def test_same_data_same_bytes(tmp_path):
    # tests/robustness compares those of png and pdf.
    paths = [tmp_path / f"{name}.svg" for name in "ab"]
    for path in paths:
        style.save(phase_planes_figure.draw(PLANES), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with pytest.raises(ValueError, match="must end in"):
        style.save(phase_planes_figure.draw(PLANES), tmp_path / "figure.tiff")


TRAINS = {
    "planetary": gearlib.planetary(),
    "turning": gearlib.planetary(turning=True, planets=4, teeth=(28, 100)),
    "ring at the output": gearlib.split_power_reducer(PAPER, internal=True),
    "idler": gearlib.idler(PAPER, angle=2.0),
    "two stages": gearlib.two_stage(PAPER, modules=(0.003, 0.005)),
    "chain": random_trains.chain_train(np.random.default_rng(0)),
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


@pytest.mark.parametrize("name", TRAINS)
@pytest.mark.parametrize("phase", [0.0, 7.0])
def test_pitch_circles_touch_at_the_pitch_points(name, phase):
    train, axes, matched = TRAINS[name], Figure().add_subplot(), set()
    schematic.draw(axes, train.layout(), phase=phase)
    hubs = [patch for patch in axes.patches if patch.get_fill()]
    circles = [patch for patch in axes.patches if isinstance(patch, Circle) and patch not in hubs]
    # Carriers turn the meshes, seen from the housing, by this angle.
    angle = train.carrier_ratio * float(train.speeds[train.reference_mesh.pinion]) * phase
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    # The marks of meshes are lines of one point.
    dots = [line for line in axes.lines if len(line.get_xdata()) == 1]
    for mesh, dot in zip(train.meshes, dots, strict=True):
        for arm in axes_of(train, mesh):
            expected = [*(dot.get_xydata()[0] + rotation @ arm), math.hypot(*arm)]
            found = {c for c in circles if math.dist([*c.center, c.radius], expected) < 1e-9}
            assert found, mesh.name
            matched |= found
    assert {*circles} == matched
    # A hub for each shaft, where both of its bodies have their axis.
    assert len(hubs) == len(train.shafts) and float(train.layout().misfit) == 0.0
    assert all(any(math.dist(hub.center, c.center) < 1e-9 for c in circles) for hub in hubs)
