"""Compare order maps of run-ups with spectra and with the independent program.

Order maps of measured signals are compared with signals of known orders on a speed ramp.
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
from tests.physics.test_run_up import (
    EXCITATION_FIELDS,
    GEARS_WITH_RUN_OUT,
    GEARS_WITHOUT_RUN_OUT,
    reference_run_up,
)

#: With three teeth, a revolution takes only three mesh periods.
PAIR_WITH_FEW_TEETH = PAPER_PAIR.replace(teeth=3, material_damping=700.0, backlash_damping=300.0)


#: Models whose shafts complete a revolution within a few mesh periods.
MODELS = {
    "pair": PAIR_WITH_FEW_TEETH,
    "six": GEARS_WITHOUT_RUN_OUT.replace(pair=PAIR_WITH_FEW_TEETH.replace(backlash=120e-6)),
    "run-out": GEARS_WITH_RUN_OUT.replace(pair=PAIR_WITH_FEW_TEETH, teeth=(3, 5)),
    "idler": gearlib.idler(PAIR_WITH_FEW_TEETH),
    "waves": gearlib.OneDegreePair(pair=PAIR_WITH_FEW_TEETH, **EXCITATION_FIELDS),
}


def order_coefficients(model, run, speed, load, orders):
    """Return Fourier coefficients of the displacement over the first revolution, (orders, meshes).

    The independent program computes the displacement along the courses `speed`, (s, rpm), and
    `load`, (s, factor). Gauss's quadrature integrates it between the events of `run` and the
    discontinuities of the stiffness and of the courses.
    """
    code, teeth = reference_run_up(model, speed, load), float(model.periods_per_revolution)
    # The mesh phase is (rate + slope t / 2) t, and a revolution ends where it is 2 pi times teeth.
    (_, first_rpm), (end, last_rpm) = speed[:2]
    radians_per_rpm = float(model.mesh_frequency(1.0)) / float(model.speed(1.0))
    rate = first_rpm * radians_per_rpm
    slope = (last_rpm - first_rpm) * radians_per_rpm / end
    revolution_phase = math.tau * teeth
    root = math.sqrt(rate**2 + 2.0 * slope * revolution_phase)
    revolution_end = 2.0 * revolution_phase / (rate + root)
    bounds = [
        times
        for interval in code.intervals
        for times in (interval.begin, *code.switch_times(interval))
    ]
    bounds = np.array(bounds) / code.system.speed
    bounds = np.unique([*bounds, revolution_end, *run.event_time.values])
    # Intervals are halved, because bearings may vibrate several times within one of them.
    bounds = np.unique(np.concatenate([bounds[:-1], bounds[1:], 0.5 * (bounds[1:] + bounds[:-1])]))
    bounds = bounds[bounds <= revolution_end]
    nodes, weights = np.polynomial.legendre.leggauss(24)
    begins, lengths = bounds[:-1, None], np.diff(bounds)[:, None]
    times = (begins + 0.5 * lengths * (1.0 + nodes)).ravel()
    time_weights = (0.5 * lengths * weights).ravel()
    displacements, _ = code.move(*np.zeros((2, model.size // 2)), times)
    phase = (rate + 0.5 * slope * times) * times
    # Orders refer to the angle of the shaft, so that time increments are converted to fractions of
    # the revolution.
    weights_per_revolution = time_weights * (rate + slope * times) / revolution_phase
    waves = np.exp(-1j * np.outer(orders, phase) / teeth)
    return waves @ (weights_per_revolution[:, None] * displacements)


@pytest.mark.parametrize(("name", "tuning"), [("pair", 0.45), *((name, 0.85) for name in MODELS)])
def test_orders_of_a_speed_ramp_match_integrals_of_the_independent_motion(name, tuning):
    """Amplitudes and phases must equal Fourier integrals of an independently computed motion."""
    model = MODELS[name]
    rpm = float(model.speed(tuning))
    # During 2.2 revolutions at the initial speed the accelerated shaft makes two whole revolutions.
    mesh_period = math.tau / float(model.mesh_frequency(tuning))
    duration = mesh_period * 2.2 * model.periods_per_revolution
    speed = [(0.0, rpm), (duration, 1.3 * rpm)]
    # The load of the pair has a step, the load of the other models falls linearly.
    load_end = duration / (4.0 if name == "pair" else 2.0)
    load = [(0.0, 1.0), (duration / 4.0, 1.0), (load_end, 0.7)]
    initial_state = (0.0,) * max(model.size, 2)
    run = gearlib.run_up(
        model, speed=speed, load=load, initial_state=initial_state, samples_per_period=256
    )
    order_map = gearlib.order_map(run, highest=15, amplitude="peak")
    orders = order_map.order.values
    assert order_map.sizes["time"] == 2 and run.event_time.size > 5
    coefficients = order_coefficients(model, run, speed, load, orders)
    coefficients = coefficients.reshape(order_map.amplitude[0].shape)
    # A harmonic of order > 0 has the sum of two conjugate coefficients.
    amplitudes = np.abs(coefficients)
    amplitudes[orders > 0] *= 2.0
    assert np.abs(order_map.amplitude[0].values - amplitudes).max() < 1e-6 * amplitudes.max()
    phase_factors = np.exp(1j * (order_map.phase[0].values - np.angle(coefficients)))
    assert np.abs((phase_factors - 1.0) * amplitudes).max() < 1e-6 * amplitudes.max()
    assert order_map.amplitude_error.max() < 1e-4 * amplitudes.max()


def assert_block_has(block, amplitudes, rpm):
    """Assert that a block of an order map has given amplitudes and a given speed."""
    # After nine revolutions, the rest of the transient is far smaller than the bound.
    assert np.abs(block.amplitude.values - amplitudes).max() < 1e-7 * amplitudes.max()
    assert float(block.rpm) == pytest.approx(rpm, rel=1e-12)


@pytest.mark.parametrize(
    ("variable", "name"), [("displacement", "error"), ("dynamic_force", "force")]
)
def test_blocks_at_constant_speed_match_the_spectrum(variable, name):
    """At constant speed, each block of an order map must equal the spectrum of `gearlib.orders`."""
    pair = PAPER_PAIR.replace(material_damping=3953.7, backlash_damping=3953.7)
    steady_run = gearlib.simulate(pair, 0.9, periods=240, record_periods=24, samples_per_period=256)
    rpm = float(steady_run.speed)
    run = gearlib.run_up(pair, rpm, rpm, duration=600.02 / rpm, samples_per_period=256)
    order_map = gearlib.order_map(run, variable=variable, amplitude="peak")
    exact = gearlib.orders(steady_run, count=5)[f"{name}_amplitude"].values
    assert_block_has(order_map.isel(time=-1), exact, rpm)
    # This motion repeats after three mesh periods. It has contact on both flanks, and free flights.
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
    phase_shifts = orders.order.values / PAPER_PAIR.teeth * float(run.phase[0])
    phase_errors = orders.phase[0].values - spectrum[f"{name}_phase"].values - phase_shifts
    assert np.abs(exact * (np.exp(1j * phase_errors) - 1.0)).max() < 1e-7 * exact.max()
    # Each of the two revolutions is a block. Both have the same motion.
    shaft_orders = gearlib.order_map(run, orders=[24, 48], variable=variable)
    assert shaft_orders.sizes == {"time": 2, "order": 2}
    assert shaft_orders.amplitude[0].values == pytest.approx(
        shaft_orders.amplitude[1].values, rel=1e-9
    )


#: Amplitudes of the signal of `ramp` by order.
SIGNAL_ORDERS = {0: 0.5, 3: 1.0, 23: 2.0}
ORDER_MAP_OPTIONS = {"variable": "acceleration", "amplitude": "peak", "highest": 40}


def ramp(start_speed, end_speed, duration=6.0, rate=20_000.0, jitter=0.4):
    """Return a signal with known orders on a speed ramp, and its revolutions as a function of time.

    Speeds are in rpm, and the duration is in s. The sampling rate is in Hz; each sample deviates
    from equal spacing by at most the fraction `jitter` of a step.
    """
    deviations = np.random.default_rng(1).uniform(-jitter, jitter, int(duration * rate))
    times = np.maximum(np.arange(deviations.size) + deviations, 0.0) / rate
    times[0] = 0.0
    acceleration = (end_speed - start_speed) / duration

    def revolutions_at(time):
        return (start_speed + 0.5 * acceleration * time) * time / 60.0

    angle = math.tau * revolutions_at(times)
    signal = 0.5 + np.cos(3.0 * angle + 0.2) + 2.0 * np.cos(23.0 * angle + 0.4)
    data = xr.Dataset({"acceleration": ("sample", signal, {"units": "m s-2"})})
    speed = start_speed + acceleration * times
    return data.assign_coords(time=("sample", times), speed=("sample", speed)), revolutions_at


def assert_orders(order_map, tolerance=1e-4):
    """Assert that all blocks of an order map have the amplitudes and phases of `ramp`.

    The tolerance allows for the interpolation of the shortest wave, which has 29 samples.
    """
    exact = np.zeros(order_map.sizes["order"])
    exact[list(SIGNAL_ORDERS)] = list(SIGNAL_ORDERS.values())
    assert np.abs(order_map.amplitude.values - exact).max() < tolerance
    phase_factors = np.exp(1j * order_map.phase.sel(order=[3, 23]))
    assert np.abs(phase_factors - np.exp([0.2j, 0.4j])).max() < 1e-3


@pytest.mark.parametrize("missing", ["rows", "time", "acceleration", "speed"])
@pytest.mark.parametrize("begin", [0.0, 2.0, 5.93])
def test_a_gap_removes_only_the_revolutions_that_it_touches(begin, missing):
    """A gap of 0.05 s must remove the revolutions that it touches, and all others must be exact.

    In the gap, samples are missing ("rows"), or one variable is NaN.
    """
    data, revolutions_at = ramp(600.0, 1800.0)
    gap_end = begin + 0.05
    is_gap = (data.time > begin) & (data.time < gap_end)
    if missing == "rows":
        data_with_gap = data.drop_isel(sample=np.flatnonzero(is_gap))
    else:
        data_with_gap = data.copy()
        data_with_gap[missing] = data[missing].where(~is_gap)
    order_map = gearlib.order_map(data_with_gap, **ORDER_MAP_OPTIONS)
    assert_orders(order_map)
    # The signal has 119 whole revolutions, of which the last ends at 5.9996 s.
    first_touched = math.floor(revolutions_at(begin))
    touched_count = min(math.ceil(revolutions_at(gap_end)), 119) - first_touched
    assert order_map.sizes["time"] == 119 - touched_count
    ((omitted_start, omitted_end),) = json.loads(order_map.attrs["left_out"])
    assert revolutions_at(omitted_start) == pytest.approx(first_touched, abs=1e-3)
    assert omitted_end >= gap_end and "gap" in order_map.attrs["comment"]
    # A gap must not change the default of the highest order.
    highest_order, highest_order_with_gap = (
        gearlib.order_map(dataset, variable="acceleration").order[-1]
        for dataset in (data, data_with_gap)
    )
    assert highest_order == highest_order_with_gap > 90.0


@pytest.mark.parametrize(
    ("start_speed", "end_speed", "block_count", "comment"),
    [
        (1800, 600, 119, None),
        (0, 1800, 89, None),
        (1800, 0, 89, None),
        (-600, -1800, 119, None),
        # The shaft makes 22.5 revolutions forwards and 62.5 backwards. The reversal is omitted.
        (1140, -1900, None, "changes sign"),
    ],
)
def test_ramps_have_the_same_orders_from_standstill_and_backwards(
    start_speed, end_speed, block_count, comment
):
    """Orders must not depend on the speed course, which may go backwards or through standstill."""
    duration = 6.0
    data, revolutions_at = ramp(start_speed, end_speed, duration)
    order_map = gearlib.order_map(data, **ORDER_MAP_OPTIONS)
    assert_orders(order_map)
    # The mean speed of a block is the speed in the middle of its time, up to one sample.
    speeds = start_speed + (end_speed - start_speed) / duration * order_map.time.values
    np.testing.assert_allclose(order_map.rpm, speeds, atol=0.5)
    if block_count is None:
        # Whole revolutions before and after the reversal, at the largest angle, are counted.
        revolutions = revolutions_at(data.time.values)
        forward_count = math.floor(revolutions.max())
        block_count = forward_count + forward_count - math.ceil(revolutions[-1])
    assert order_map.sizes["time"] == block_count
    assert (comment or "") in order_map.attrs.get("comment", "")


@pytest.mark.parametrize("pulses_per_revolution", [1, 2, 60])
@pytest.mark.parametrize("speeds", [(600.0, 1800.0), (1800.0, 600.0), (0.0, 1800.0)])
def test_single_irregular_tacho_pulses_are_repaired_and_reported(pulses_per_revolution, speeds):
    """A missing pulse and an additional one must be reported, and must not change the orders."""
    duration = 6.0
    data, revolutions_at = ramp(*speeds, duration)
    data = data.drop_vars("speed")
    # The pulse times are the inverse function of the pulse count over time.
    grid = np.linspace(0.0, duration, 2_000_001)
    pulse_count = int(revolutions_at(duration) * pulses_per_revolution)
    counts = revolutions_at(grid) * pulses_per_revolution
    pulses = np.interp(np.arange(pulse_count), counts, grid)
    rng = np.random.default_rng(pulses_per_revolution)
    options = ORDER_MAP_OPTIONS | {"pulses_per_revolution": pulses_per_revolution}
    assert_orders(gearlib.order_map(data, tacho=pulses, **options), 1e-3)
    for fraction in (0.5, 0.02, rng.random()):
        missing, doubled = rng.permutation(np.arange(10, pulse_count - 10, 8))[:2]
        extra_pulse = pulses[doubled] + fraction * (pulses[doubled + 1] - pulses[doubled])
        irregular_pulses = np.sort([*np.delete(pulses, missing), extra_pulse])
        order_map = gearlib.order_map(data, tacho=irregular_pulses, **options)
        assert_orders(order_map, 1e-3)
        assert json.loads(order_map.attrs["double_pulses"]) == [extra_pulse]
        ((pulse_before, pulse_after),) = json.loads(order_map.attrs["missing_pulses"])
        assert pulse_before < pulses[missing] < pulse_after
        assert "Missing" in order_map.attrs["comment"]
    # Three missing pulses in a row are refused. The message has the time and number of the next.
    first = pulse_count // 2
    message = rf"tacho = {pulses[first + 3]:.6g} s \(pulse {first}\) is irregular.* 4 pulses.* be 1"
    with pytest.raises(ValueError, match=message):
        gearlib.order_map(data, tacho=np.delete(pulses, [first, first + 1, first + 2]), **options)


def test_the_map_of_a_signal_stays_empty_in_a_gap():
    """The picture of an order map must be empty at the speeds of the gap in the signal."""
    data, _ = ramp(600.0, 1800.0)
    data["acceleration"] = data.acceleration.where(np.abs(data.time - 3.0) > 0.2)
    figure = plot.order_map(gearlib.order_map(data, **ORDER_MAP_OPTIONS), figure=Figure())
    mesh = figure.axes[0].collections[0]
    # Each row of the colour mesh is a block, and its first coordinate is the speed.
    is_empty = np.ma.getmaskarray(mesh.get_array()).all(axis=1)
    speeds = mesh.get_coordinates()[:-1, 0, 0][is_empty]
    # The gap, from 2.8 s to 3.2 s, lies around 1200 rpm.
    assert is_empty.sum() == 2 and 1100.0 < speeds.min() < speeds.max() < 1300.0
