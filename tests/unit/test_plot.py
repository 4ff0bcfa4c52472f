"""What `gearlib.plot` refuses; figures of odd data; schematics. tests/golden has pictures."""

import math

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import gearlib
from gearlib import colours, plot, run_up, simulate
from gearlib.figures import schematic, style
from gearlib.figures.branches_figure import draw_jump
from gearlib.figures.motions_figure import draw_phase_planes
from gearlib.figures.resonance_figure import draw_nonlinear_damping, draw_resonance
from tests.golden import data as golden
from tests.paper import PAPER_PAIR
from tests.trains import random_trains


@pytest.fixture(autouse=True)
def no_window():
    """Draw without windows and close all figures afterwards."""
    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")


def test_plots_are_drawn_into_given_axes():
    _, axes = pyplot.subplots()
    assert plot.phase_plane(simulate(PAPER_PAIR, 0.85, periods=4), axes=axes) is axes and axes.lines


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (plot.resonance, "gearlib.plot.resonance draws datasets of gearlib.sweep"),
        (plot.orders, "gearlib.plot.orders draws datasets of gearlib.orders"),
        (plot.run_up, "gearlib.plot.run_up draws datasets of gearlib.run_up"),
        (lambda run: plot.resonance([run]), "gearlib.plot.resonance draws datasets"),
        (lambda run: plot.values(run, [[]]), "is missing"),
        (lambda run: plot.time_course(run, variable=[]), "gearlib.plot.time_course draws datasets"),
        (lambda run: plot.time_course(run, labels=[3]), r"^labels = \[3\] .* 1 texts"),
        (lambda run: plot.phase_plane(run, axes=3), "^axes = 3 is not allowed: it must be axes"),
    ],
)
def test_data_that_cannot_be_drawn_are_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call(simulate(PAPER_PAIR, 0.85, periods=4))


def test_variables_that_a_run_up_does_not_have_are_refused():
    run = run_up(PAPER_PAIR, start=PAPER_PAIR.speed(0.5), stop=PAPER_PAIR.speed(0.51), duration=0.1)
    with pytest.raises(ValueError, match="phase over revolution is missing"):
        plot.run_up(run, variable="phase")


def golden_without(name, *variables):
    """Return golden data in which given variables are NaN."""
    data = golden.read(name)
    return data.assign({variable: data[variable] * np.nan for variable in variables})


EXTREMA = ["displacement_max", "displacement_min"]
CURVES, PLANES, JUMPS = map(golden_without, ("resonance.nc", "phase_planes.nc", "jump.nc"))
SHORT = CURVES.assign(CURVES[EXTREMA].where(CURVES.tuning > 0.6))
NO_PLANE = PLANES.assign(displacement=PLANES.displacement.where(PLANES.damping != "k1"))
NO_JUMPS = golden_without("jump.nc", "jump").isel(variation=JUMPS.kind.isin(["base", "damping"]))
NO_RESULTS = [
    golden_without(f"nonlinear_damping/{place}_cubic.nc", *EXTREMA, "displacement", "velocity")
    for place in ("material", "oil")
]
#: Functions that draw a figure, with data that lack values.
ODD = {
    "no backlash": (draw_resonance, CURVES.assign(backlash_ratio=0.0)),
    "no coast-side flank": (
        draw_resonance,
        CURVES.assign(backlash_ratio=math.inf),
    ),
    "planes of one flank": (
        draw_phase_planes,
        PLANES.assign(backlash_ratio=math.inf),
    ),
    "a plane without a result": (draw_phase_planes, NO_PLANE),
    "no result at a tuning": (draw_resonance, SHORT),
    "one tuning": (draw_resonance, CURVES.isel(tuning=[4])),
    "no jump": (draw_jump, NO_JUMPS),
    "no results": (draw_nonlinear_damping, NO_RESULTS),
}


@pytest.mark.parametrize(("draw", "data"), ODD.values(), ids=ODD)
def test_axis_limits_are_finite_for_incomplete_data(draw, data):
    for axes in draw(data).axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def test_phase_plane_rows_are_labelled_with_the_requested_tuning_or_speed():
    tunings = [0.332, 0.334, 0.735, float(PAPER_PAIR.tuning_at(3600.0))]
    planes = PLANES.isel(tuning=[0] * 4).assign_coords(tuning=tunings)
    planes["speed"] = "tuning", PAPER_PAIR.speed(np.array(tunings))
    rows = draw_phase_planes(planes).axes[:: planes.damping.size]
    labels = [axes.get_ylabel().split("\n")[:2] for axes in rows]
    assert [label[0][-5:] for label in labels[:3]] == ["0.332", "0.334", "0.735"]
    assert labels[3][1] == "(3600 rpm)"


def test_different_numbers_are_printed_differently():
    numbers = np.array([1.0, 1.0 + 1e-8, 2.0]) / 3.0
    assert style.format_numbers(numbers, 3) == ["0.33333333", "0.33333334", "0.66666667"]
    assert style.format_numbers([0.3, 0.25, 1e-12], 2, "f", 2) == ["0.30", "0.25", "1e-12"]
    # Numbers that are equal up to rounding are printed alike.
    assert style.format_numbers([0.1 + 0.2, 0.3], 3) == ["0.3", "0.3"]


@pytest.mark.parametrize("chosen_colours", [{}, {3: "#0072B2"}])
def test_categories_use_distinct_colours_not_used_for_motions(chosen_colours):
    curve_colours = [
        curve.colour for curve in style.curve_styles(range(40), chosen_colours).values()
    ]
    assert len({*curve_colours, *colours.MOTIONS.values()}) == 40 + len(colours.MOTIONS)


def test_the_same_data_give_the_same_picture_bytes(tmp_path):
    # The formats png and pdf are compared in tests/robustness.
    paths = [tmp_path / f"{name}.svg" for name in "ab"]
    for path in paths:
        style.save(draw_phase_planes(PLANES), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with pytest.raises(ValueError, match="must end in"):
        style.save(draw_phase_planes(PLANES), tmp_path / "figure.tiff")


TRAINS = {
    "planetary": gearlib.planetary(),
    "turning": gearlib.planetary(turning=True, planets=4, teeth=(28, 100)),
    "ring at the output": gearlib.split_power_reducer(PAPER_PAIR, internal=True),
    "idler": gearlib.idler(PAPER_PAIR, angle=2.0),
    "two stages": gearlib.two_stage(PAPER_PAIR, modules=(0.003, 0.005)),
    "chain": random_trains.chain_train(np.random.default_rng(0)),
}


def axes_of(train, mesh):
    """Return the axes of pinion and wheel, m, relative to the pitch point."""
    angle = mesh.centre_line_angle
    direction = np.array([math.cos(angle), math.sin(angle)])
    pinion, wheel = (
        train.by_name[name].base_radius / math.cos(mesh.pressure_angle) * direction
        for name in (mesh.pinion, mesh.wheel)
    )
    # The axes lie on opposite sides of the pitch point, for an internal mesh on the same side.
    return -pinion, -wheel if mesh.internal else wheel


@pytest.mark.parametrize("name", TRAINS)
@pytest.mark.parametrize("phase", [0.0, 7.0])
def test_pitch_circles_touch_at_the_pitch_points(name, phase):
    """For each mesh two circles must have the pitch radii and centres relative to its mark."""
    train, axes, matched_circles = TRAINS[name], Figure().add_subplot(), set()
    schematic.draw_schematic(axes, train.layout(), phase=phase)
    hubs = [patch for patch in axes.patches if patch.get_fill()]
    circles = [patch for patch in axes.patches if isinstance(patch, Circle) and patch not in hubs]
    # Seen from the housing, the carrier rotates the meshes by this angle.
    angle = float(train.speeds.frame) * phase
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    # A mesh is marked by a line of one point.
    dots = [line for line in axes.lines if len(line.get_xdata()) == 1]
    for mesh, dot in zip(train.meshes, dots, strict=True):
        for arm in axes_of(train, mesh):
            expected = [*(dot.get_xydata()[0] + rotation @ arm), math.hypot(*arm)]
            touching = {
                circle
                for circle in circles
                if math.dist([*circle.center, circle.radius], expected) < 1e-9
            }
            assert touching, mesh.name
            matched_circles |= touching
    assert {*circles} == matched_circles
    # Each shaft has a hub on the common axis of its bodies.
    assert len(hubs) == len(train.shafts) and float(train.layout().misfit) == 0.0
    assert all(
        any(math.dist(hub.center, circle.center) < 1e-9 for circle in circles) for hub in hubs
    )
