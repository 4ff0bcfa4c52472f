"""The pictures of gearlib.plot by what their artists hold; figures of odd data; schematics."""

import math

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure
from matplotlib.patches import Circle

import gearlib
from gearlib import plot, simulate, sweep
from gearlib.figures import (
    jump_figure,
    nonlinear_damping_figure,
    phase_planes_figure,
    resonance_figure,
    schematic,
    style,
)
from tests.geometry.drawings import own
from tests.golden import data as golden
from tests.paper import PAPER
from tests.trains import random_trains

MESH = own()
PAIR = gearlib.GearPair.from_geometry(MESH, torque=85.0, damping_ratio=0.12)


@pytest.fixture(autouse=True)
def no_window():
    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def run_up():
    """A run-up through the main resonance and back."""
    course = [(0.0, PAIR.speed(0.7)), (0.5, PAIR.speed(1.0)), (1.0, PAIR.speed(0.7))]
    return gearlib.run_up(PAIR, speed=course, samples_per_period=64)


def labels(axes):
    return {text.get_text() for text in axes.get_legend().get_texts()}


def highest(axes):
    """Return the largest height of all lines."""
    return np.nanmax(np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.lines]))


def test_resonance_holds_both_sweeps_and_their_speeds():
    run = {"periods": 400, "record_periods": 8}
    curves = [sweep(PAIR, np.linspace(0.6, 1.3, 36), direction=to, **run) for to in ("up", "down")]
    _, subplot = pyplot.subplots()
    axes = plot.resonance(*curves, axes=subplot)
    assert axes is subplot and labels(axes) == {"tuning going up", "tuning going down"}
    expected = max(float(curve.displacement_max.max()) for curve in curves)
    assert highest(axes) == pytest.approx(expected)
    names = {scale.get_xlabel() + scale.get_ylabel() for scale in axes.child_axes}
    assert names == {"speed (rpm)", "displacement (µm)"}


def test_plots_reach_the_largest_values_and_name_what_they_show():
    run = simulate(PAIR, 0.85, periods=400, record_periods=2)
    assert highest(plot.phase_plane(run)) == pytest.approx(float(run.velocity.max()))
    assert highest(plot.time_course(run)) == pytest.approx(float(run.displacement.max()))
    assert "stable" in str(labels(plot.orbit(gearlib.periodic_orbit(PAIR, 0.7))))
    errors = MESH.transmission_error(torque=[20.0, 85.0])
    largest = 1e6 * float(errors.transmission_error.max())
    assert highest(plot.harris_map(errors)) == pytest.approx(largest, rel=1e-2)
    diagram = gearlib.split_power_reducer(PAIR).campbell()
    assert "excited" in labels(plot.campbell(diagram))


def test_orders_are_drawn_with_their_amplitudes_and_mesh_orders_are_named():
    run = simulate(PAIR, 0.45, periods=423, record_periods=23)
    spectrum = gearlib.orders(run, count=3)
    for variable, scale in (("force_amplitude", 1.0), ("error_amplitude", 1e6)):
        axes = plot.orders(spectrum, variable=variable)
        ends = [segment[1] for lines in axes.collections for segment in lines.get_segments()]
        heights = scale * spectrum[variable].sel(order=[23, 46, 69]).values
        # A motion that repeats after one mesh period has mesh orders only, multiples of 23 teeth.
        np.testing.assert_allclose(ends, np.column_stack([[23, 46, 69], heights]), rtol=1e-12)
        assert [text.get_text() for text in axes.texts] == ["mesh", "2 × mesh", "3 × mesh"]
    assert axes.get_ylabel() == "transmission error (µm, peak)"
    train = simulate(gearlib.planetary(), 0.9, periods=27, record_periods=27)
    assert len(labels(plot.orders(gearlib.orders(train, count=2)))) == train.sizes["mesh"]


def test_run_ups_are_plotted_over_speed_with_falling_speeds_dotted(run_up):
    up, down = plot.run_up(run_up).lines
    assert (up.get_linestyle(), down.get_linestyle()) == ("-", ":")
    forces = run_up.dynamic_force_max.values
    rises, falls = run_up.revolution_time < 0.49, run_up.revolution_time > 0.51
    np.testing.assert_array_equal(up.get_xdata(), run_up.revolution_speed)
    np.testing.assert_array_equal(up.get_ydata()[rises], forces[rises])
    assert np.isnan(up.get_ydata()[falls]).all()
    both = np.where(np.isnan(up.get_ydata()), down.get_ydata(), up.get_ydata())
    np.testing.assert_array_equal(both, forces)
    axes = plot.run_up(run_up, variable="displacement_max")
    assert axes.get_ylabel() == "largest displacement in the revolution (µm)"
    heights = 1e6 * run_up.displacement_max[rises]
    np.testing.assert_allclose(axes.lines[0].get_ydata()[rises], heights, rtol=1e-12)
    with pytest.raises(ValueError, match="phase over revolution is missing"):
        plot.run_up(run_up, variable="phase")


def test_an_order_map_holds_levels_lines_and_the_overall_level(run_up):
    levels = gearlib.order_map(run_up, variable="dynamic_force", highest=60)
    up, down, low_up, low_down, *_ = plot.order_map(levels).axes
    assert [axes.get_title() for axes in (up, down)] == ["speed goes up", "speed goes down"]
    rises = np.gradient(levels.rpm.values) >= 0.0
    for axes, below, mask in ((up, low_up, rises), (down, low_down, ~rises)):
        part = levels.isel(time=np.flatnonzero(mask)).sortby("rpm")
        (mesh,) = axes.collections
        level = 20.0 * np.log10(part.amplitude.values[:, 1:])
        lowest = np.maximum(level, mesh.get_clim()[1] - 80.0)
        np.testing.assert_allclose(mesh.get_array().reshape(level.shape), lowest, 0.0, 1e-9)
        (line,) = below.lines
        np.testing.assert_allclose(line.get_xdata(), part.rpm)
        np.testing.assert_allclose(10.0 ** (line.get_ydata() / 20.0), part.overall, rtol=1e-12)
    axes = plot.order_map(levels, vertical="frequency").axes[0]
    line = next(line for line in axes.lines if line.get_label() == "z")
    np.testing.assert_allclose(line.get_ydata(), 23.0 * line.get_xdata() / 60.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (plot.resonance, "gearlib.plot.resonance draws datasets of gearlib.sweep"),
        (plot.orders, "gearlib.plot.orders draws datasets of gearlib.orders"),
        (plot.run_up, "gearlib.plot.run_up draws datasets of gearlib.run_up"),
        (lambda run: plot.phase_plane(run, axes=3), "^axes = 3 is not allowed: it must be axes"),
    ],
)
def test_what_cannot_be_drawn_is_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call(simulate(PAIR, 0.85, periods=4))


def gone(name, *variables):
    """Return golden data of which variables have no numbers."""
    data = golden.read(name)
    return data.assign({variable: data[variable] * np.nan for variable in variables})


EXTREMA = ["displacement_max", "displacement_min"]
CURVES, PLANES, JUMPS = map(gone, ("resonance.nc", "phase_planes.nc", "jump.nc"))
SHORT = CURVES.assign(CURVES[EXTREMA].where(CURVES.tuning > 0.6))
NO_PLANE = PLANES.assign(displacement=PLANES.displacement.where(PLANES.damping != "k1"))
NO_JUMPS = gone("jump.nc", "jump").isel(variation=JUMPS.kind.isin(["base", "damping"]))
NO_RESULTS = [
    gone(f"nonlinear_damping/{place}_cubic.nc", *EXTREMA, "displacement", "velocity")
    for place in ("material", "oil")
]
#: Figures of which no limit may be lost.
ODD = {
    "no backlash": (resonance_figure, CURVES.assign(backlash_ratio=0.0)),
    "no far flank": (resonance_figure, CURVES.assign(backlash_ratio=math.inf)),
    "planes without a far flank": (phase_planes_figure, PLANES.assign(backlash_ratio=math.inf)),
    "a plane without a result": (phase_planes_figure, NO_PLANE),
    "no result at a tuning": (resonance_figure, SHORT),
    "one tuning": (resonance_figure, CURVES.isel(tuning=[4])),
    "no jump": (jump_figure, NO_JUMPS),
    "no results": (nonlinear_damping_figure, NO_RESULTS),
}


@pytest.mark.parametrize(("figure", "data"), ODD.values(), ids=ODD)
def test_limits_are_numbers(figure, data):
    for axes in figure.draw(data).axes:
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
