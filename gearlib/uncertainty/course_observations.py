"""Compare the mesh orders of measured time histories, at constant speed and in run-ups.

A regression over each revolution fits the complex mesh orders together with an offset and the first
shaft orders, so that the offset of a sensor and the eccentricity of a gear have no effect.
"""

import json
import math
from contextlib import suppress
from typing import Any

import numpy as np

from gearlib import checks, parameters
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.analysis.order_maps import ShaftRotation
from gearlib.parameters import Angle
from gearlib.runs.run_up import run_up, speed_course
from gearlib.runs.sweeping import sweep
from gearlib.uncertainty import observation
from gearlib.uncertainty.observation import Channel, Curve, Observation, Prediction

#: Measured direction (0 from rest, 1 up, -1 down) -> sweep that ends at the measured speed: its
#: direction, ratio of its first speed to the measured speed, number of speeds.
_SWEEPS_TO_SPEED = {0: ("cold", 1.0, 1), 1: ("up", 0.5, 40), -1: ("down", 1.6, 40)}
#: Number of mesh orders that are compared.
ORDERS = 4
_ORDER_NUMBERS = np.arange(1, ORDERS + 1)
_SHAFT_ORDERS, _MIN_SAMPLES_PER_ORDER = 3, 2.5
_STEADY_SAMPLES_PER_PERIOD, _RUN_UP_SAMPLES_PER_PERIOD = 512, 32
_CURVE_POINTS = 200
_SAME_PHASE_TOLERANCE = 1e-9
#: Smallest standard deviation of the speed of a jump, rpm.
_MIN_SPEED_STD = 1e-9
#: Numbers of revolutions of a run-up that are not compared: at its start and around each jump.
_SKIPPED_AT_START, _SKIPPED_BEFORE_JUMP, _SKIPPED_AFTER_JUMP = 6, 4, 24
#: Arguments of `run_up` that ``known.options`` may contain.
_RUN_UP_OPTIONS = ("load", "driver", "driven_mass", "base_radius", "initial_state")


def time_history_observations(model: Any, data: Any, mesh: int) -> list[Observation]:
    """Return one `Observation` for each condition of a measured data set with time histories.

    An observation has measured values and a function that predicts them with a model. `data` is a
    dataset over ``sample`` with displacement, time and speed; a condition is a named part of a
    measurement. Each condition has a constant speed, or there is a single run-up. `mesh` is the
    index of the mesh whose displacement was measured.
    """
    histories = [data]
    if "condition" in data.coords:
        conditions = data.condition.values
        unique_conditions = dict.fromkeys(conditions.tolist())
        histories = [data.isel(sample=conditions == name) for name in unique_conditions]
    observations = []
    for history in histories:
        if "speed" in history.coords and np.ptp(history.speed.values) == 0.0:
            observations.append(_steady_observation(model, history, mesh))
        elif len(histories) == 1:
            observations.append(_run_up_observation(model, history, mesh))
        else:
            raise ValueError(
                f"data has {len(histories)} conditions with time histories: each of them must have "
                "a constant speed; pass each run-up as a separate data set"
            )
    return observations


def _speed_course(metadata: dict) -> tuple[list, dict]:
    """Return the speed course of a run-up, rows (s, rpm), and keyword arguments of `run_up`.

    They are the entries "course" and "options" (such as load and driver) of `metadata`, the JSON
    object in the attribute "known" of a measured data set. Raise ValueError if the course is
    missing or invalid.
    """
    if "course" not in metadata:
        raise ValueError("known.course is missing: a run-up needs its speed course, rows (s, rpm)")
    options = metadata.get("options", {})
    checks.require(isinstance(options, dict), "known.options", options, "a mapping")
    for name in options:
        checks.check_choice("known.options", name, _RUN_UP_OPTIONS)
    try:
        return speed_course(speed=metadata["course"]).tolist(), options
    except ValueError as error:
        raise ValueError(f"known.course: {error}") from None


def _check_history(model: Any, data: Any) -> tuple[dict, np.ndarray, np.ndarray, float]:
    """Check a time history; return (metadata, displacements, phase factors, mesh periods).

    The metadata are the JSON object in the attribute "known" of the dataset `data`. The
    displacements, (n,), have the units of the data. The phase factors, complex (ORDERS,), shift the
    mesh orders of a model (Fourier coefficients at multiples of the mesh frequency) to the mesh
    phase at the start of the measurement. The last value is the number of mesh periods per
    revolution.
    """
    text = data.attrs.get("known", "{}")
    metadata: Any = None
    with suppress(TypeError, ValueError):
        metadata = json.loads(text)
    checks.require(isinstance(metadata, dict), "known", text, "a JSON object, from json.dumps")
    phase = parameters.check("known.phase", metadata.get("phase", 0.0), Angle)
    displacements = np.asarray(data.displacement.values, float)
    checks.require((np.diff(data.time.values) > 0.0).all(), "time", "unsorted", "increasing")
    varies = np.ptp(displacements) > 0.0
    checks.require(varies, "displacement", float(displacements[0]), "a signal that varies")
    # Gear ratios have rounding errors.
    mesh_periods = float(round(model.periods_per_revolution, 9))
    allowed = "a whole number, as in a train with a fixed carrier"
    is_whole = mesh_periods.is_integer()
    checks.require(is_whole, "mesh periods of a revolution", mesh_periods, allowed)
    phase_factors = np.exp(1j * phase * _ORDER_NUMBERS)
    return metadata, displacements, phase_factors, mesh_periods


def _order_channel(name, displacement, orders, variance_ratios) -> Channel:
    """Return the `Channel` (measured values and their deviations) for the mesh orders of a signal.

    `name` is the name of the channel, and `displacement` the measured signal, an xarray variable
    whose attributes describe the sensor. `orders`, complex (blocks, ORDERS), are the Fourier
    coefficients of blocks of samples at the first multiples of the mesh frequency.
    `variance_ratios`, (blocks,), are their variances relative to the variance of a sample.
    """
    noise = float(displacement.attrs.get("noise_std", 0.0))  # 0: unknown
    # If the noise is unknown, only the ratios of the deviations matter.
    sample_std = noise or float(np.std(displacement.values))
    values = _real_and_imaginary(orders)
    return Channel(
        name,
        values,
        # The real and the imaginary part each have half of the variance of an order.
        deviations=np.repeat(sample_std * np.sqrt(0.5 * variance_ratios), 2 * ORDERS),
        noise_known=bool(noise),
        unknown_gain=bool(displacement.attrs.get("unknown_gain", 0)),
        # Each real or imaginary part is a sequence over the blocks.
        sequence_indices=np.arange(values.size).reshape(-1, 2 * ORDERS).T,
    )


def _real_and_imaginary(orders: np.ndarray) -> np.ndarray:
    """Return complex mesh orders as a flat array of alternating real and imaginary parts."""
    return np.ascontiguousarray(orders).view(float).ravel()


def _steady_observation(model: Any, data: Any, mesh: int) -> Observation:
    """Return the `Observation` of a time history at constant speed: the mesh orders of an orbit.

    Mesh orders are Fourier coefficients at multiples of the mesh frequency. `data` is a dataset
    over samples with a single speed, `mesh` the index of the measured mesh of the model.
    """
    _, displacements, phase_factors, mesh_periods = _check_history(model, data)
    speed = float(data.speed.values[0])
    checks.require(speed > 0.0, "speed", speed, "> 0")
    # The direction in which the speed was reached: 1 up, -1 down, 0 from rest.
    measured_direction = int(data.direction.values[0]) if "direction" in data.coords else 0
    direction, first_speed_ratio, speed_count = _SWEEPS_TO_SPEED[measured_direction]
    revolutions = data.time.values * speed / 60.0
    # A single block contains all samples, including the last one.
    edges = np.array([revolutions[0], np.nextafter(revolutions[-1], np.inf)])
    # Ten samples per mesh period, the minimum, extend over 0.9 mesh periods.
    checks.require(
        np.diff(edges)[0] * mesh_periods > 0.899,
        "time",
        f"{data.time.values[0]:.6g} to {data.time.values[-1]:.6g} s",
        f"of a mesh period or more, {60.0 / speed / mesh_periods:.4g} s at {speed:g} rpm",
    )
    measured_orders = regress_mesh_orders(revolutions, displacements, edges, mesh_periods)
    channel = _order_channel("time history", data.displacement, *measured_orders)

    def predict(model: Any) -> Prediction:
        """Sweep the model to the measured speed; return the mesh orders of its orbit there.

        The `Prediction` also has the largest displacement into the backlash.
        """
        # The tuning is the speed relative to the resonance speed.
        tuning = speed / float(model.speed(1.0))
        # If several motions exist, the direction of the sweep determines which one is reached.
        tunings = np.sort(np.linspace(first_speed_ratio * tuning, tuning, speed_count))
        curve = sweep(model, tunings, direction=direction, **observation.SETTLING_SWEEP)
        # States are sorted by increasing tuning, so a sweep down ends at the first state.
        state = curve.final_state.values[0 if direction == "down" else -1]
        quantities = observation.orbit_quantities(model, speed, state, _STEADY_SAMPLES_PER_PERIOD)
        # The Fourier coefficients, complex (orders, meshes), begin with order 0.
        orders = quantities[observation.ORDER_AMPLITUDE][1 : ORDERS + 1, mesh]
        excursion = observation.backlash_excursion(model, quantities)
        return Prediction([_real_and_imaginary(orders * phase_factors)], excursion)

    def make_curves(signals: list) -> list:
        """Return the `Curve` of the displacement over a mesh period in a list.

        Measured and predicted displacement are sums of the first mesh orders. `signals` has one
        array: the predicted mesh orders, scaled by the gain of the sensor.
        """
        phase = np.linspace(0.0, 1.0, _CURVE_POINTS)  # in mesh periods
        waves = np.exp(2j * np.pi * np.outer(phase, _ORDER_NUMBERS))
        # The real displacement is twice the real part of the sum over positive orders.
        measured = 2.0 * (waves @ channel.values.view(complex)).real
        predicted = 2.0 * (waves @ signals[0].view(complex)).real
        name = f"displacement at {speed:.5g} rpm"
        units = data.displacement.attrs.get("units", "m")
        speed_falls = np.zeros(phase.size, bool)  # the speed is constant
        return [Curve(name, units, "phase", phase, (measured, predicted), speed_falls)]

    return Observation("time history", [channel], predict, make_curves)


def _run_up_observation(model: Any, data: Any, mesh: int) -> Observation:
    """Return the `Observation` of a run-up: the mesh orders of its revolutions and its jump speeds.

    Mesh orders are Fourier coefficients at multiples of the mesh frequency; at a jump the first
    order changes suddenly. `data` is a dataset over samples with a varying speed, `mesh` the index
    of the measured mesh of the model.
    """
    metadata, displacements, phase_factors, mesh_periods = _check_history(model, data)
    course, options = _speed_course(metadata)
    rotation = ShaftRotation(course)
    orders, variance_ratios, warning = _revolution_orders(
        rotation, course[-1][0], data.time.values, displacements, mesh_periods
    )
    count = variance_ratios.size  # number of revolutions
    compared, amplitudes, jumps = _compared_revolutions(orders, variance_ratios)
    checks.require(
        compared.any(),
        "time",
        f"of {count} revolutions with jumps in {', '.join(map(str, jumps))}",
        f"of a whole revolution after the first {_SKIPPED_AT_START}, and not from "
        f"{_SKIPPED_BEFORE_JUMP} before to {_SKIPPED_AFTER_JUMP} after a jump",
    )
    speeds = rotation.time_and_speed(np.arange(count) + 0.5)[1]
    order_channel = _order_channel(
        "run-up", data.displacement, orders[compared], variance_ratios[compared]
    )
    channels = [order_channel]
    if jumps:
        before, after = speeds[np.array(jumps) - 1], speeds[jumps]
        jump_speeds = 0.5 * (before + after)
        speed_stds = _SKIPPED_AFTER_JUMP * abs(after - before) + _MIN_SPEED_STD
        noise_known = order_channel.noise_known
        channels.append(Channel("jumps", jump_speeds, speed_stds, noise_known, shares_weight=True))

    def predict(model: Any) -> Prediction:
        """Run the model along the measured speed course and predict the measured values.

        These are the mesh orders of the compared revolutions and the speeds of the jumps. The
        `Prediction` also has the largest displacement into the backlash. Raise `NoOrbit` if the run
        fails.
        """
        run_options = {"samples_per_period": _RUN_UP_SAMPLES_PER_PERIOD, **options}
        run = run_up(model, speed=course, **run_options)
        if int(run.status):
            raise NoOrbit(run.status.attrs["message"])
        displacement = run.displacement.values.reshape(run.sizes["time"], -1)[:, mesh]
        orders = _fourier_orders(run.phase.values, displacement, count, math.tau * mesh_periods)
        values = [_real_and_imaginary((orders * phase_factors)[compared])]
        if jumps:
            # Jumps are detected by measured amplitudes, so the gain of the sensor is applied.
            _, gain = order_channel.signal_and_gain(values[0])
            # A gain of 0, fitted to a motion without mesh orders, is ignored.
            predicted = np.abs(orders[:, 0]) * (gain or 1.0)
            jump_speeds = [_jump_speed(predicted, amplitudes, i, speeds) for i in jumps]
            values.append(np.array(jump_speeds))
        # The last revolution has no extrema if the run ends before it is complete.
        complete = compared[: run.displacement_min.shape[0]].nonzero()[0]
        extrema = run[["displacement_min", "displacement_max"]].isel(revolution=complete)
        return Prediction(values, observation.backlash_excursion(model, extrema))

    def make_curves(signals: list) -> list:
        """Return the measured and predicted amplitudes of each mesh order over speed as `Curve`s.

        `signals` begins with the predicted mesh orders of the compared revolutions, scaled by the
        gain of the sensor; the curves are NaN at other revolutions.
        """
        fitted = np.full(orders.shape, complex(np.nan))
        fitted[compared] = signals[0].view(complex).reshape(-1, ORDERS)
        units = data.displacement.attrs.get("units", "m")
        speed_falls = np.gradient(speeds) < 0.0
        # The amplitude of a real oscillation is twice the modulus of its complex coefficient.
        amplitudes = 2.0 * np.abs([orders.T, fitted.T])
        names = [f"order {k if k > 1 else ''}z" for k in _ORDER_NUMBERS]
        return [
            Curve(name, units, "speed", speeds, tuple(values), speed_falls)
            for name, values in zip(names, amplitudes.swapaxes(0, 1), strict=True)
        ]

    # Failing runs are reported before the fit starts.
    try:
        predict(model)
    except NoOrbit:
        raise ValueError(observation.START_ERROR) from None
    return Observation("run-up", channels, predict, make_curves, warning)


def _revolution_orders(rotation, end_time, times, displacements, mesh_periods):
    """Return (mesh orders of each whole revolution, their variance ratios, warning).

    `rotation` is the `ShaftRotation` of a speed course from 0 to `end_time`, s; `times`, s, and
    `displacements`, both (n,), are measured; `mesh_periods` is the number of mesh periods per
    revolution. Mesh orders, complex (revolutions, ORDERS), are Fourier coefficients at multiples of
    the mesh frequency; variance ratios, (revolutions,), are their variances relative to the
    variance of a sample. Both are NaN for revolutions with gaps. The warning states how many
    revolutions are omitted; it is "" if there are none.
    """
    revolutions = rotation.revolutions(times)
    count = int(revolutions[-1])  # number of whole revolutions
    interval = f"{times[0]:.6g} to {times[-1]:.6g} s"
    course_revolutions = float(rotation.revolutions(np.array([end_time]))[0])
    is_within = revolutions[0] < 1.0 and count <= course_revolutions + 1e-9
    allowed = f"within known.course, 0 to {end_time:.6g} s, and start in its first revolution"
    checks.require(is_within, "time", interval, allowed)
    # More revolutions must be compared than are skipped at the start.
    minimum = 2 * _SKIPPED_AT_START
    allowed = f"of more than {minimum} whole revolutions of known.course, not {count}"
    checks.require(count > minimum, "time", interval, allowed)
    edges = np.arange(count + 1)  # the blocks are revolutions
    compared_count = count - _SKIPPED_AT_START
    complete = complete_blocks(revolutions, edges, mesh_periods)
    allowed = f"of a revolution without gap after the first {_SKIPPED_AT_START}"
    incomplete = f"of {compared_count} revolutions with gaps"
    checks.require(complete[_SKIPPED_AT_START:].any(), "time", incomplete, allowed)
    orders, variance_ratios = regress_mesh_orders(
        revolutions, displacements, edges, mesh_periods, complete
    )
    missing_count = int(np.isnan(variance_ratios[_SKIPPED_AT_START:]).sum())
    warning = ""
    if missing_count:
        omitted = f"{missing_count} of {compared_count} revolutions of the run-up are left out"
        warning = f"{omitted}, because they have gaps or too few samples"
    return orders, variance_ratios, warning


def _compared_revolutions(orders, variance_ratios):
    """Return (mask of the compared revolutions, amplitudes of the first mesh order, jumps).

    `orders`, complex (revolutions, ORDERS), are the Fourier coefficients of a measured run-up at
    multiples of the mesh frequency; they and their `variance_ratios`, (revolutions,), are NaN for
    revolutions without enough samples. At a jump the amplitude changes by more than 15 % from one
    revolution to the next; a jump is the index of the revolution after it. The first revolutions
    and those around a jump, where motions differ most, are not compared.
    """
    is_measured = np.isfinite(variance_ratios)
    indices = np.arange(variance_ratios.size)
    compared = is_measured & (indices >= _SKIPPED_AT_START)
    # A revolution without enough samples gets the amplitude of the previous measured revolution.
    sources = np.maximum.accumulate(np.where(is_measured, indices, is_measured.argmax()))
    amplitudes = np.abs(orders[sources, 0])
    steps = np.abs(np.log(amplitudes[1:] / amplitudes[:-1]))
    jumps: list = []
    # If jumps are close to each other, only the largest one counts.
    for i in np.argsort(-steps):
        if steps[i] < observation.MIN_RELATIVE_JUMP:
            break
        is_separate = all(abs(i + 1 - jump) > _SKIPPED_AFTER_JUMP for jump in jumps)
        if i >= _SKIPPED_AT_START and is_separate:
            jumps.append(int(i + 1))
    for jump in jumps:
        compared[max(jump - _SKIPPED_BEFORE_JUMP, 0) : jump + _SKIPPED_AFTER_JUMP] = False
    return compared, amplitudes, sorted(jumps)


def _jump_speed(predicted, measured, jump, speeds) -> float:
    """Return the speed in rpm at which a model jumps closest to a measured jump, NaN if nowhere.

    `predicted` and `measured` are amplitudes at the mesh frequency and `speeds` are speeds in rpm
    for each revolution of a run-up; `jump` is the index of the first revolution after the measured
    jump. The model jumps where its amplitude crosses the mean of the measured amplitudes before and
    after the jump in the same direction; the speed is interpolated there.
    """
    before = measured[jump - _SKIPPED_BEFORE_JUMP]
    after = measured[min(jump + _SKIPPED_BEFORE_JUMP, len(measured) - 1)]
    threshold = 0.5 * (before + after)
    increases = after > before
    # The speed must change in the same direction as at the measured jump.
    directions = np.sign(np.gradient(speeds))
    has_jumped = (predicted > threshold) == increases
    crosses = has_jumped[1:] & ~has_jumped[:-1] & (directions[1:] == directions[jump])
    crossings = np.flatnonzero(crosses) + 1
    if not crossings.size:
        return math.nan
    i = crossings[np.abs(crossings - jump).argmin()]
    fraction = (threshold - predicted[i - 1]) / (predicted[i] - predicted[i - 1])
    return float(speeds[i - 1] + fraction * (speeds[i] - speeds[i - 1]))


def _fourier_orders(phase, displacements, block_count, block_length) -> np.ndarray:
    """Return the complex mesh orders of blocks of a computed motion, (blocks, ORDERS).

    They are the Fourier coefficients of the displacement at the first multiples of the mesh
    frequency, integrated by the trapezoidal rule. `phase`, the increasing mesh phase in rad, and
    `displacements` have shape (n,); each of the `block_count` blocks has the length `block_length`
    in rad.
    """
    edges = block_length * np.arange(block_count + 1)
    # The last sample is repeated at the last edge if the run ends before it.
    phase = np.append(phase, max(phase[-1], edges[-1]))
    displacements = np.append(displacements, displacements[-1])
    # Row k is the displacement times exp(-i (k + 1) phase).
    waves = displacements * np.cumprod([np.exp(-1j * phase)] * ORDERS, axis=0)
    starts = np.searchsorted(phase, edges - _SAME_PHASE_TOLERANCE)
    areas = 0.5 * (waves[:, 1:] + waves[:, :-1]) * np.diff(phase)
    return np.add.reduceat(areas[:, : starts[-1]], starts[:-1], axis=1).T / block_length


def complete_blocks(revolutions: np.ndarray, edges: np.ndarray, mesh_periods: float) -> np.ndarray:
    """Return a mask of the blocks of samples without gaps, shape (blocks,).

    `revolutions`, increasing, are the shaft angles of the samples in revolutions; each block
    extends from one of the `edges`, in revolutions, to the next. `mesh_periods` is the number of
    mesh periods per revolution. A gap is a step between samples that exceeds both a mesh period and
    three times the median step; it makes all blocks that it overlaps incomplete.
    """
    steps = np.diff(revolutions)
    complete = np.ones(len(edges) - 1, bool)
    for i in np.flatnonzero(steps > max(1.0 / mesh_periods, 3.0 * np.median(steps))):
        first_block, last_block = np.searchsorted(edges, revolutions[i : i + 2], "right") - 1
        complete[max(first_block, 0) : last_block + 1] = False
    return complete


def regress_mesh_orders(revolutions, displacements, edges, mesh_periods, complete=True):
    """Fit complex mesh orders to blocks of samples; return (orders, variance ratios).

    Orders, (blocks, ORDERS), are Fourier coefficients at the first multiples of the mesh frequency,
    from a linear regression together with an offset and the first shaft orders. The samples may
    have any increasing shaft angles `revolutions`; each block extends from one of the `edges`, in
    revolutions, to the next. `mesh_periods` is the number of mesh periods per revolution;
    `complete` is a mask of the blocks to use, or True for all blocks. The variance ratios,
    (blocks,), are the variance of an order (the sum over real and imaginary part) divided by the
    variance of a sample. Results are NaN for blocks that have too few samples or are not
    `complete`.
    """
    block_count = len(edges) - 1
    min_density = _MIN_SAMPLES_PER_ORDER * ORDERS
    # Mean number of samples in a mesh period of each block.
    density = np.diff(np.searchsorted(revolutions, edges)) / np.diff(edges) / mesh_periods
    is_dense = complete & (density >= min_density)
    lowest_density = f"{density.min():.3g} samples in a mesh period"
    checks.require(is_dense.any(), "displacement", lowest_density, f"of {min_density:g} or more")
    # Higher orders are fitted as well, so that they do not distort the first ones.
    order_count = min(2 * ORDERS, int(density[is_dense].min() / _MIN_SAMPLES_PER_ORDER))
    # Shaft orders cannot be separated from the offset in less than one revolution.
    shaft_order_count = _SHAFT_ORDERS if edges[1] - edges[0] >= 1.0 else 0
    mesh_frequencies = mesh_periods * np.arange(1, order_count + 1)
    frequencies = np.array([*range(1, shaft_order_count + 1), *mesh_frequencies])
    # The weight of a sample is the length of its cell, which ends halfway to both neighbours. With
    # these weights the regression approximates a Fourier integral if amplitudes change within a
    # block.
    cell_edges = np.concatenate([[-np.inf], 0.5 * (revolutions[1:] + revolutions[:-1]), [np.inf]])
    orders = np.full((block_count, ORDERS), complex(np.nan))
    variance_ratios = np.full(block_count, np.nan)
    cosine_columns = np.arange(ORDERS) + 1 + shaft_order_count
    sine_columns = cosine_columns + frequencies.size
    for k in np.flatnonzero(is_dense):
        start, end = edges[k : k + 2]
        first_sample = np.searchsorted(cell_edges, start, "right") - 1
        end_sample = np.searchsorted(cell_edges, end)
        samples = slice(first_sample, end_sample)
        weights = np.diff(np.clip(cell_edges[first_sample : end_sample + 1], start, end))[:, None]
        waves = np.exp(2j * np.pi * np.outer(revolutions[samples], frequencies))
        columns = np.hstack([np.ones((len(waves), 1)), waves.real, waves.imag])
        weighted_columns = weights * columns
        inverse = np.linalg.inv(columns.T @ weighted_columns)
        coefficients = inverse @ (weighted_columns.T @ displacements[samples])
        orders[k] = 0.5 * (coefficients[cosine_columns] - 1j * coefficients[sine_columns])
        variances = np.diag(inverse @ (weighted_columns.T @ weighted_columns) @ inverse)
        variance_ratios[k] = 0.5 * variances[[*cosine_columns, *sine_columns]].mean()
    return orders, variance_ratios
