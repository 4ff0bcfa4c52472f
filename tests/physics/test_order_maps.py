"""Order maps of run-ups: against spectra, the independent program, the balance of powers.

Order maps of signals of a rig: against the closed forms of ramps with known orders.
"""

import json
import math

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import gearlib
from gearlib import plot
from tests.paper import PAPER_PAIR
from tests.physics.test_run_up import RUN_OUT, SIX, WAVES, reference_run_up

#: A gear of few teeth turns often.
FEW = PAPER_PAIR.replace(teeth=3, material_damping=700.0, backlash_damping=300.0)


#: Models whose shafts complete a revolution in a few mesh periods.
MODELS = {
    "pair": FEW,
    "six": SIX.replace(pair=FEW.replace(backlash=120e-6)),
    "run-out": RUN_OUT.replace(pair=FEW, teeth=(3, 5)),
    "idler": gearlib.idler(FEW),
    "waves": gearlib.OneDegreePair(pair=FEW, **WAVES),
}


def by_quadrature(model, run, speed, load, orders):
    """Return Fourier coefficients of the displacement over the first revolution, (orders, meshes).

    The code of `tests.independent` computes the displacement along the courses `speed` and `load`.
    Gauss's quadrature integrates it between the events of `run` and all switches.
    """
    code, teeth = reference_run_up(model, speed, load), float(model.periods_per_revolution)
    (_, first_rpm), (end, last_rpm) = speed[:2]
    radians_per_rpm = float(model.mesh_frequency(1.0)) / float(model.speed(1.0))
    rate, slope = first_rpm * radians_per_rpm, (last_rpm - first_rpm) * radians_per_rpm / end
    revolution_phase = math.tau * teeth
    revolution_end = (
        2.0 * revolution_phase / (rate + math.sqrt(rate**2 + 2.0 * slope * revolution_phase))
    )
    bounds = [times for piece in code.pieces for times in (piece.begin, *code.cuts(piece))]
    bounds = np.array(bounds) / code.system.speed
    bounds = np.unique([*bounds, revolution_end, *run.event_time.values])
    # Intervals are halved, because bearings may vibrate several times between two bounds.
    bounds = np.unique(np.concatenate([bounds[:-1], bounds[1:], 0.5 * (bounds[1:] + bounds[:-1])]))
    bounds = bounds[bounds <= revolution_end]
    nodes, weights = np.polynomial.legendre.leggauss(24)
    begins, lengths = bounds[:-1, None], np.diff(bounds)[:, None]
    times = (begins + 0.5 * lengths * (1.0 + nodes)).ravel()
    time_weights = (0.5 * lengths * weights).ravel()
    displacements, _ = code.move(*np.zeros((2, model.size // 2)), times)
    phase, revolution_fraction = (
        (rate + 0.5 * slope * times) * times,
        time_weights * (rate + slope * times) / revolution_phase,
    )
    return np.exp(-1j * np.outer(orders, phase) / teeth) @ (
        revolution_fraction[:, None] * displacements
    )


@pytest.mark.parametrize(("name", "tuning"), [("pair", 0.45), *((name, 0.85) for name in MODELS)])
def test_orders_of_a_speed_ramp_match_integrals_of_the_independent_motion(name, tuning):
    """Compare amplitudes and phases of a ramp with integrals of the motion of a second code."""
    model = MODELS[name]
    rpm = float(model.speed(tuning))
    # This is the time of 2.2 revolutions at the first speed, and of less than three on the ramp.
    seconds = math.tau / float(model.mesh_frequency(tuning)) * 2.2 * model.periods_per_revolution
    speed, load = [(0.0, rpm), (seconds, 1.3 * rpm)], [(0.0, 1.0), (seconds / 4.0, 1.0)]
    # The load of the pair steps; in the other models it falls linearly.
    load += [(seconds / (4.0 if name == "pair" else 2.0), 0.7)]
    start = (0.0,) * max(model.size, 2)
    run = gearlib.run_up(model, speed=speed, load=load, initial_state=start, samples_per_period=256)
    order_map = gearlib.order_map(run, highest=15, amplitude="peak")
    orders = order_map.order.values
    assert order_map.sizes["time"] == 2 and run.event_time.size > 5
    coefficients = by_quadrature(model, run, speed, load, orders).reshape(
        order_map.amplitude[0].shape
    )
    amplitudes = np.abs(coefficients)
    amplitudes[orders > 0] *= 2.0
    assert np.abs(order_map.amplitude[0].values - amplitudes).max() < 1e-6 * amplitudes.max()
    rotation = np.exp(1j * (order_map.phase[0].values - np.angle(coefficients)))
    assert np.abs((rotation - 1.0) * amplitudes).max() < 1e-6 * amplitudes.max()
    assert order_map.amplitude_error.max() < 1e-4 * amplitudes.max()


def assert_block_has(block, amplitudes, rpm):
    """Assert that a block of an order map has given amplitudes and a given speed."""
    # The transient that is left after nine revolutions is far smaller.
    assert np.abs(block.amplitude.values - amplitudes).max() < 1e-7 * amplitudes.max()
    assert float(block.rpm) == pytest.approx(rpm, rel=1e-12)


@pytest.mark.parametrize(
    ("variable", "name"), [("displacement", "error"), ("dynamic_force", "force")]
)
def test_blocks_at_constant_speed_match_the_spectrum(variable, name):
    """At constant speed each block of an order map must equal the spectrum by `gearlib.orders`."""
    pair = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
    steady_run = gearlib.simulate(pair, 0.9, periods=240, record_periods=24, samples_per_period=256)
    rpm = float(steady_run.speed)
    run = gearlib.run_up(pair, rpm, rpm, duration=600.02 / rpm, samples_per_period=256)
    order_map = gearlib.order_map(run, variable=variable, amplitude="peak")
    exact = gearlib.orders(steady_run, count=5)[f"{name}_amplitude"].values
    assert_block_has(order_map.isel(time=-1), exact, rpm)
    # This motion repeats after three mesh periods, with contact on either flank and on neither.
    run_settings = {"periods": 1507, "record_periods": 48, "samples_per_period": 256}
    run = gearlib.simulate(
        PAPER_PAIR.replace(material_damping=1000.0),
        1.055,
        initial_state=(-2.0, 1.0),
        **run_settings,
    )
    spectrum = gearlib.orders(run, count=4)
    orders = gearlib.order_map(run, variable=variable, amplitude="peak", resolution=0.5, highest=96)
    assert orders.order.values == pytest.approx(spectrum.order.values, rel=1e-14)
    exact = spectrum[f"{name}_amplitude"].values
    assert_block_has(orders.isel(time=0), exact, float(run.speed))
    # Phases of the spectrum refer to the mesh phase 0, but phases of the map to the first sample.
    begin = orders.order.values / PAPER_PAIR.teeth * float(run.phase[0])
    rotation = np.exp(1j * (orders.phase[0].values - spectrum[f"{name}_phase"].values - begin))
    assert np.abs(exact * (rotation - 1.0)).max() < 1e-7 * exact.max()
    # There is one block for each of the two revolutions, whose motions are equal.
    shaft_orders = gearlib.order_map(run, orders=[24, 48], variable=variable)
    assert shaft_orders.sizes == {"time": 2, "order": 2}
    assert shaft_orders.amplitude[0].values == pytest.approx(
        shaft_orders.amplitude[1].values, rel=1e-9
    )


#: Orders of the signal of `ramp`, with their amplitudes.
WAVES_OF_RIG = {0: 0.5, 3: 1.0, 23: 2.0}
OPTIONS = {"variable": "acceleration", "amplitude": "peak", "highest": 40}


def ramp(first, last, seconds=6.0, rate=20_000.0, jitter=0.4):
    """Return a signal with known orders on a speed ramp, and its revolutions over time.

    The speed goes from `first` to `last`, rpm, in `seconds`. There are `rate` samples a second, and
    each deviates from equal spacing by at most the fraction `jitter` of a step.
    """
    noise = np.random.default_rng(1).uniform(-jitter, jitter, int(seconds * rate))
    t = np.maximum(np.arange(noise.size) + noise, 0.0) / rate
    t[0] = 0.0

    def turns(t):
        return (first + 0.5 * (last - first) / seconds * t) * t / 60.0

    angle = math.tau * turns(t)
    x = 0.5 + np.cos(3.0 * angle + 0.2) + 2.0 * np.cos(23.0 * angle + 0.4)
    data = xr.Dataset({"acceleration": ("sample", x, {"units": "m s-2"})})
    speed = first + (last - first) / seconds * t
    return data.assign_coords(time=("sample", t), speed=("sample", speed)), turns


def assert_orders(order_map, tolerance=1e-4):
    """Assert that all blocks have the orders of `ramp`, whose shortest wave has 29 samples."""
    exact = np.zeros(order_map.sizes["order"])
    exact[list(WAVES_OF_RIG)] = list(WAVES_OF_RIG.values())
    assert np.abs(order_map.amplitude.values - exact).max() < tolerance
    assert (
        np.abs(np.exp(1j * order_map.phase.sel(order=[3, 23])) - np.exp([0.2j, 0.4j])).max() < 1e-3
    )


@pytest.mark.parametrize("missing", ["rows", "time", "acceleration", "speed"])
@pytest.mark.parametrize("begin", [0.0, 2.0, 5.93])
def test_a_gap_removes_only_the_revolutions_that_it_touches(begin, missing):
    """A missing stretch of 0.05 s must remove its whole revolutions and leave all others exact."""
    data, turns = ramp(600.0, 1800.0)
    is_gap = (data.time > begin) & (data.time < begin + 0.05)
    data_with_gap = (
        data.drop_isel(sample=np.flatnonzero(is_gap)) if missing == "rows" else data.copy()
    )
    if missing != "rows":
        data_with_gap[missing] = data[missing].where(~is_gap)
    order_map = gearlib.order_map(data_with_gap, **OPTIONS)
    assert_orders(order_map)
    touched_revolutions = math.ceil(turns(begin + 0.05)) - math.floor(turns(begin))
    # The last whole revolution ends at 5.9996 s.
    assert order_map.sizes["time"] == 119 - min(touched_revolutions, 119 - math.floor(turns(begin)))
    ((start, end),) = json.loads(order_map.attrs["left_out"])
    assert turns(start) == pytest.approx(math.floor(turns(begin)), abs=1e-3)
    assert end >= begin + 0.05 and "gap" in order_map.attrs["comment"]
    # A gap must not change the default of the highest order.
    options = {"variable": "acceleration"}
    orders = [gearlib.order_map(d, **options).order[-1] for d in (data, data_with_gap)]
    assert orders[0] == orders[1] > 90.0


@pytest.mark.parametrize(
    ("first", "last", "blocks", "left_out"),
    [
        (1800, 600, 119, None),
        (0, 1800, 89, None),
        (1800, 0, 89, None),
        (-600, -1800, 119, None),
        # It turns 22.5 times forwards and 62.5 times back; the reversal is omitted.
        (1140, -1900, None, "changes sign"),
    ],
)
def test_ramps_have_the_same_orders_from_standstill_and_backwards(first, last, blocks, left_out):
    """Orders must not depend on the speed course, backwards and through standstill included."""
    data, turns = ramp(first, last)
    order_map = gearlib.order_map(data, **OPTIONS)
    assert_orders(order_map)
    speeds = first + (last - first) / 6.0 * order_map.time.values
    # The mean speed of a block is that in the middle of its time, apart from its first sample.
    np.testing.assert_allclose(order_map.rpm, speeds, atol=0.5)
    most_turns = turns(data.time.values).max()
    expected = blocks or math.floor(most_turns) + math.floor(most_turns) - math.ceil(
        turns(data.time.values[-1])
    )
    assert order_map.sizes["time"] == expected
    assert (left_out or "") in order_map.attrs.get("comment", "")


@pytest.mark.parametrize("per_turn", [1, 2, 60])
@pytest.mark.parametrize("speeds", [(600.0, 1800.0), (1800.0, 600.0), (0.0, 1800.0)])
def test_single_irregular_tacho_pulses_are_repaired_and_reported(per_turn, speeds):
    """Remove one pulse and insert another at random places: orders stay, and both are reported."""
    data, turns = ramp(*speeds)
    grid = np.linspace(0.0, 6.0, 2_000_001)
    pulses = np.interp(np.arange(int(turns(6.0) * per_turn)), turns(grid) * per_turn, grid)
    data = data.drop_vars("speed")
    generator = np.random.default_rng(per_turn)
    tacho = {"pulses_per_revolution": per_turn}
    assert_orders(gearlib.order_map(data, tacho=pulses, **tacho, **OPTIONS), 1e-3)
    for share in (0.5, 0.02, generator.random()):
        missing, doubled = generator.permutation(np.arange(10, pulses.size - 10, 8))[:2]
        extra = pulses[doubled] + share * (pulses[doubled + 1] - pulses[doubled])
        irregular_pulses = np.sort([*np.delete(pulses, missing), extra])
        order_map = gearlib.order_map(data, tacho=irregular_pulses, **tacho, **OPTIONS)
        assert_orders(order_map, 1e-3)
        assert json.loads(order_map.attrs["double_pulses"]) == [extra]
        ((before, after),) = json.loads(order_map.attrs["missing_pulses"])
        assert before < pulses[missing] < after and "Missing" in order_map.attrs["comment"]
    # Three missing pulses in a row are refused with their time and number.
    i = pulses.size // 2
    message = rf"tacho = {pulses[i + 3]:.6g} s \(pulse {i}\) is irregular.* 4 pulses.* be 1"
    with pytest.raises(ValueError, match=message):
        gearlib.order_map(data, tacho=np.delete(pulses, [i, i + 1, i + 2]), **tacho, **OPTIONS)


def test_the_map_of_a_signal_stays_empty_in_a_gap():
    """Blocks of an order map that touch a gap in the signal must be drawn empty."""
    data, _ = ramp(600.0, 1800.0)
    data["acceleration"] = data.acceleration.where(np.abs(data.time - 3.0) > 0.2)
    figure = plot.order_map(gearlib.order_map(data, **OPTIONS), figure=Figure())
    mesh = figure.axes[0].collections[0]
    # Each row of the array is a block, whose speed is the first coordinate.
    empty = np.ma.getmaskarray(mesh.get_array()).all(axis=1)
    speeds = mesh.get_coordinates()[:-1, 0, 0][empty]
    assert empty.sum() == 2 and 1100.0 < speeds.min() < speeds.max() < 1300.0
