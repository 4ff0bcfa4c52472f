"""Check what `gearlib.plot` refuses, figures of incomplete data, and schematics of trains.

Pictures are compared in tests/golden.
"""

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
    ("call", "message"),
    [
        (plot.resonance, "gearlib.plot.resonance draws datasets of gearlib.sweep"),
        (plot.orders, "gearlib.plot.orders draws datasets of gearlib.orders"),
        (plot.run_up, "gearlib.plot.run_up draws datasets of gearlib.run_up"),
        (lambda run: plot.resonance([run]), "gearlib.plot.resonance draws datasets"),
        (lambda run: plot.values(run, [[]]), "is missing"),
        (lambda run: plot.time_course(run, variable=[]), "gearlib.plot.time_course draws datasets"),
        (lambda run: plot.time_course(run, labels=[3]), r"^labels = \[3\] .* 1 string"),
        (
            lambda run: plot.phase_plane(run, axes=3),
            "^axes = 3 is not allowed: it must be matplotlib axes",
        ),
    ],
)
def test_data_that_cannot_be_drawn_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call(simulate(PAPER_PAIR, 0.85, periods=4))


def test_variables_that_a_run_up_does_not_have_are_refused():
    run = run_up(PAPER_PAIR, start=PAPER_PAIR.speed(0.5), stop=PAPER_PAIR.speed(0.51), duration=0.1)
    with pytest.raises(ValueError, match="phase over revolution is missing"):
        plot.run_up(run, variable="phase")


def golden_with_nan(name, *variables):
    """Return a golden dataset in which given variables are NaN."""
    dataset = golden.read(name)
    return dataset.assign({variable: dataset[variable] * np.nan for variable in variables})


EXTREMA = ["displacement_max", "displacement_min"]
RESONANCE_CURVES, PHASE_PLANES, JUMPS = map(
    golden_with_nan, ("resonance.nc", "phase_planes.nc", "jump.nc")
)
CURVES_WITH_GAP = RESONANCE_CURVES.assign(
    RESONANCE_CURVES[EXTREMA].where(RESONANCE_CURVES.tuning > 0.6)
)
PLANES_WITHOUT_K1 = PHASE_PLANES.assign(
    displacement=PHASE_PLANES.displacement.where(PHASE_PLANES.damping != "k1")
)
JUMP_STUDY_WITHOUT_JUMPS = golden_with_nan("jump.nc", "jump").isel(
    variation=JUMPS.kind.isin(["base", "damping"])
)
STUDIES_WITHOUT_RESULTS = [
    golden_with_nan(f"nonlinear_damping/{place}_cubic.nc", *EXTREMA, "displacement", "velocity")
    for place in ("material", "oil")
]
#: Functions that draw a figure, each with a dataset that lacks values.
INCOMPLETE_DATA = {
    "no backlash": (draw_resonance, RESONANCE_CURVES.assign(backlash_ratio=0.0)),
    "no coast-side flank": (
        draw_resonance,
        RESONANCE_CURVES.assign(backlash_ratio=math.inf),
    ),
    "planes of one flank": (
        draw_phase_planes,
        PHASE_PLANES.assign(backlash_ratio=math.inf),
    ),
    "a plane without a result": (draw_phase_planes, PLANES_WITHOUT_K1),
    "no result at a tuning": (draw_resonance, CURVES_WITH_GAP),
    "one tuning": (draw_resonance, RESONANCE_CURVES.isel(tuning=[4])),
    "no jump": (draw_jump, JUMP_STUDY_WITHOUT_JUMPS),
    "no results": (draw_nonlinear_damping, STUDIES_WITHOUT_RESULTS),
}


@pytest.mark.parametrize(("draw", "data"), INCOMPLETE_DATA.values(), ids=INCOMPLETE_DATA)
def test_axis_limits_are_finite_for_incomplete_data(draw, data):
    for axes in draw(data).axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def test_phase_plane_rows_are_labelled_with_the_requested_tuning_or_speed():
    """Labels must tell close tunings apart, and state the speed of a tuning with many decimals."""
    tunings = [0.332, 0.334, 0.735, float(PAPER_PAIR.tuning_at(3600.0))]
    planes = PHASE_PLANES.isel(tuning=[0] * 4).assign_coords(tuning=tunings)
    planes["speed"] = "tuning", PAPER_PAIR.speed(np.array(tunings))
    # The label is on the first axes of each row. Its lines are the tuning and the speed.
    first_axes = draw_phase_planes(planes).axes[:: planes.damping.size]
    labels = [axes.get_ylabel().split("\n")[:2] for axes in first_axes]
    assert [tuning_line[-5:] for tuning_line, _ in labels[:3]] == ["0.332", "0.334", "0.735"]
    assert labels[3][1] == "(3600 rpm)"


def test_different_numbers_are_printed_differently():
    """Numbers must get enough digits to tell them apart, and at least as many as requested."""
    numbers = np.array([1.0, 1.0 + 1e-8, 2.0]) / 3.0
    assert style.format_numbers(numbers, 3) == ["0.33333333", "0.33333334", "0.66666667"]
    assert style.format_numbers([0.3, 0.25, 1e-12], 2, "f", 2) == ["0.30", "0.25", "1e-12"]
    # Numbers that differ by rounding errors only are printed alike.
    assert style.format_numbers([0.1 + 0.2, 0.3], 3) == ["0.3", "0.3"]


@pytest.mark.parametrize("chosen_colours", [{}, {3: "#0072B2"}])
def test_categories_use_distinct_colours_not_used_for_motions(chosen_colours):
    """40 categories must have 40 colours, none of which is the colour of a kind of motion."""
    category_count = 40
    styles = style.curve_styles(range(category_count), chosen_colours).values()
    distinct_colours = {*(curve.colour for curve in styles), *colours.MOTIONS.values()}
    assert len(distinct_colours) == category_count + len(colours.MOTIONS)


def test_the_same_data_give_the_same_picture_bytes(tmp_path):
    """Two SVG files of the same data must be identical; unknown file formats must be refused."""
    # The formats png and pdf are compared in tests/robustness.
    paths = [tmp_path / f"{name}.svg" for name in "ab"]
    for path in paths:
        style.save(draw_phase_planes(PHASE_PLANES), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with pytest.raises(ValueError, match="must end in"):
        style.save(draw_phase_planes(PHASE_PLANES), tmp_path / "figure.tiff")


LAYOUT_TRAINS = {
    "planetary": gearlib.planetary(),
    "turning": gearlib.planetary(turning=True, planets=4, teeth=(28, 100)),
    "ring at the output": gearlib.split_power_reducer(PAPER_PAIR, internal=True),
    "idler": gearlib.idler(PAPER_PAIR, angle=2.0),
    "two stages": gearlib.two_stage(PAPER_PAIR, modules=(0.003, 0.005)),
    "chain": random_trains.chain_train(np.random.default_rng(0)),
}


def gear_axes(train, mesh):
    """Return the positions of the axes of pinion and wheel, m, relative to the pitch point."""
    angle = mesh.centre_line_angle
    direction = np.array([math.cos(angle), math.sin(angle)])
    pinion_radius, wheel_radius = (
        train.by_name[name].base_radius / math.cos(mesh.pressure_angle)
        for name in (mesh.pinion, mesh.wheel)
    )
    # The axes of an internal mesh lie on the same side of the pitch point.
    wheel_side = -1 if mesh.internal else 1
    return -pinion_radius * direction, wheel_side * wheel_radius * direction


@pytest.mark.parametrize("name", LAYOUT_TRAINS)
@pytest.mark.parametrize("phase", [0.0, 7.0])
def test_pitch_circles_touch_at_the_pitch_points(name, phase):
    """Pinion and wheel of each mesh must be circles with the pitch radii that touch at its mark."""
    train, axes, matched_circles = LAYOUT_TRAINS[name], Figure().add_subplot(), set()
    schematic.draw_schematic(axes, train.layout(), phase=phase)
    hubs = [patch for patch in axes.patches if patch.get_fill()]
    circles = [patch for patch in axes.patches if isinstance(patch, Circle) and patch not in hubs]
    # The meshes of planets rotate with the carrier.
    angle = float(train.speeds.frame) * phase
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    # The pitch point of a mesh is marked by a line with a single point.
    marks = [line for line in axes.lines if len(line.get_xdata()) == 1]
    for mesh, mark in zip(train.meshes, marks, strict=True):
        for axis_position in gear_axes(train, mesh):
            centre = mark.get_xydata()[0] + rotation @ axis_position
            centre_and_radius = [*centre, math.hypot(*axis_position)]
            matches = {
                circle
                for circle in circles
                if math.dist([*circle.center, circle.radius], centre_and_radius) < 1e-9
            }
            assert matches, mesh.name
            matched_circles |= matches
    assert {*circles} == matched_circles
    # Each shaft has a hub at the centre of the circles of its bodies.
    assert len(hubs) == len(train.shafts) and float(train.layout().misfit) == 0.0
    assert all(
        any(math.dist(hub.center, circle.center) < 1e-9 for circle in circles) for hub in hubs
    )
