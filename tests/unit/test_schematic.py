"""Schematics of trains: circles and meshes against plane kinematics, colours, marks of contact."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import gearlib
from gearlib import plot
from gearlib.figures import schematic
from tests.trains import random_trains

PAIR = gearlib.GearPair(
    max_stiffness=4e8, stiffness_ratio=0.6, contact_ratio=1.6, reduced_mass=3.0, load=3e3,
    backlash=40e-6,
)  # fmt: skip
TRAINS = {
    "planetary": gearlib.planetary(),
    "turning": gearlib.planetary(turning=True, planets=4, teeth=(28, 100)),
    "shifted": gearlib.planetary(planet_teeth=35),
    "reducer": gearlib.split_power_reducer(PAIR),
    "ring at the output": gearlib.split_power_reducer(PAIR, internal=True),
    "idler": gearlib.idler(PAIR, angle=2.0),
    "two stages": gearlib.two_stage(PAIR, modules=(0.003, 0.005)),
    **{f"chain {n}": random_trains.chain_train(np.random.default_rng(n)) for n in range(4)},
}


def axes_of(train, mesh):
    """Return the axes of pinion and wheel in m, seen from the pitch point."""
    ends = (mesh.wheel, mesh.pinion) if mesh.internal else (mesh.pinion, mesh.wheel)
    radius = [train.by_name[name].base_radius for name in ends]
    ahead = np.array([math.cos(mesh.centres), math.sin(mesh.centres)]) / math.cos(
        mesh.pressure_angle
    )
    # Past the pitch point, seen from a ring gear, no pinion has its axis.
    first, second = -radius[0] * ahead, (-1.0 if mesh.internal else 1.0) * radius[1] * ahead
    return (second, first) if mesh.internal else (first, second)


def drawn(train, **now):
    axes = Figure().add_subplot()
    schematic.draw(axes, train.layout(), **now)
    return axes


def dots(axes):
    """Return the marks of meshes: lines of one point."""
    return [line for line in axes.lines if len(line.get_xdata()) == 1]


def points(axes):
    return np.array([line.get_xydata()[0] for line in dots(axes)])


@pytest.mark.parametrize("name", TRAINS)
@pytest.mark.parametrize("phase", [0.0, 7.0])
def test_pitch_circles_touch_at_the_pitch_points(name, phase):
    train = TRAINS[name]
    axes, found = drawn(train, phase=phase), []
    hubs = [one for one in axes.patches if one.get_fill()]
    circles = [one for one in axes.patches if isinstance(one, Circle) and not one.get_fill()]
    for mesh, point in zip(train.meshes, points(axes), strict=True):
        # Pinion and wheel from the pitch point, written without gearlib's axes; in the housing they
        # go round with the frame.
        frame = train.carrier_ratio * float(train.speeds[train.reference_mesh.pinion]) * phase
        c, s = math.cos(frame), math.sin(frame)
        for way in axes_of(train, mesh):
            centre = point + np.array([[c, -s], [s, c]]) @ way
            same = [
                one
                for one in circles
                if math.dist(one.center, centre) < 1e-9
                and abs(one.radius - math.hypot(*way)) < 1e-9
            ]
            assert len(same) >= 1, (mesh.name, way)
            found += same
        first, second = axes_of(train, mesh)
        radii = [math.hypot(*first), math.hypot(*second)]
        apart = radii[1] - radii[0] if mesh.internal else sum(radii)
        assert math.dist(first, second) == pytest.approx(abs(apart), rel=1e-12)
    assert {id(one) for one in circles} <= {id(one) for one in found}
    # A hub for each shaft, where both of its bodies have their axis.
    assert len(hubs) == len(train.shafts)
    assert all(any(math.dist(hub.center, c.center) < 1e-9 for c in circles) for hub in hubs)
    assert float(train.layout().misfit) == 0.0


@pytest.mark.parametrize("name", TRAINS)
def test_gears_roll_on_each_other(name):
    train, step = TRAINS[name], 1e-3
    layout, names = train.layout(), list(train.body_names)
    turned = step * (layout.body_turns.values - float(layout.frame_turns))
    for mesh, (pinion, wheel) in zip(train.meshes, layout.pitch_radius.values, strict=True):
        # Against the line of centres both rims go equally far.
        own, other = (turned[names.index(body)] for body in (mesh.pinion, mesh.wheel))
        assert own * pinion == pytest.approx(-other * wheel, rel=1e-12)
    before, after = (schematic.create_drawing(layout, phase).marks for phase in (0.0, step))
    ways = [line[:, 1] - line[:, 0] for line in (before, after)]
    angles = [np.arctan2(way[:, 1], way[:, 0]) for way in ways]
    there = [bool(radii) for radii in schematic.circles_of(layout).values()]
    np.testing.assert_allclose(angles[1] - angles[0], step * layout.body_turns.values[there])


def test_the_carrier_turns_as_willis_has_it():
    layout = TRAINS["turning"].layout()
    speed = dict(zip(map(str, layout.body.values), layout.body_turns.values, strict=True))
    # The ring stands still: w_c = w_s z_s / (z_s + z_r), of the planets about their axes too.
    carrier = speed["sun"] * 28 / 128
    assert speed["ring"] == 0.0 and speed["carrier"] == pytest.approx(carrier, rel=1e-12)
    assert speed["planet 1"] == pytest.approx(carrier * (1.0 - 100 / 36), rel=1e-12)
    arms = [schematic.create_drawing(layout, phase).arms for phase in (0.0, 1.0)]
    way = [np.arctan2(*(arm[:, 1] - arm[:, 0]).T[::-1]) for arm in arms]
    np.testing.assert_allclose((way[1] - way[0]) % math.tau, carrier)
    assert len(arms[0]) == 4


def test_meshes_show_their_contact():
    train = TRAINS["planetary"]
    axes = drawn(train, contact=[1, 0, 1, 1, -1, 1])
    open_ones = [line.get_markerfacecolor() == "white" for line in dots(axes)]
    assert open_ones == [False, True, False, False, False, False]
    assert [line.get_marker() for line in dots(axes)] == ["o"] * 4 + ["D", "o"]
    assert {text.get_text() for text in axes.texts} == set(train.mesh_names)
    run = gearlib.simulate(gearlib.planetary(stiffness_ratio=(0.4, 0.4)), 0.9, periods=60)
    one = plot.schematic(train, run=run, phase=float(run.phase[100]))
    apart = [line.get_markerfacecolor() == "white" for line in dots(one)]
    assert apart == (run.contact.values[100] == 0).tolist()
    broken = run.assign(status=((), 1, {"message": "it jammed"}))
    for wrong, words in (
        ({"phase": -1.0}, "phase = -1.0"),
        ({"run": run[["phase"]]}, "contact is"),
        ({"run": broken}, "no contacts to show: it jammed"),
    ):
        with pytest.raises(ValueError, match=words):
            plot.schematic(train, **({"run": run} | wrong))
    with pytest.raises(ValueError, match="gearlib.GearTrain"):
        plot.schematic(PAIR)
    with pytest.raises(ValueError, match="its meshes must be those"):
        plot.schematic(TRAINS["idler"], run=run)
