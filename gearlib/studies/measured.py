"""Compare measured sweeps, time histories and run-ups with computed ones."""

import math
import warnings
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.integrate import cumulative_trapezoid

from gearlib import checks
from gearlib.analysis.order_maps import order_map
from gearlib.data.motions import FRACTION_TOLERANCE
from gearlib.data.variables import SI_SCALES
from gearlib.engines.summary_columns import COLUMNS
from gearlib.runs.run_up import run_up
from gearlib.runs.simulation import simulate
from gearlib.uncertainty.course_observations import complete_blocks
from gearlib.uncertainty.measured import read_measured

#: Observable of a sweep -> variable of the computed sweeps with its scale in SI units.
SWEEP_SCALES = {
    **{column.name: column.scale for column in COLUMNS if not column.trains_only},
    "orbit_height": "static_deflection",
}
#: Observables in which jumps and peaks are searched, in order of preference.
_JUMP_OBSERVABLES = ("orbit_height", "displacement_max", "dynamic_force_max", "displacement_min")
#: Direction code in a measured data set -> direction of the computed sweep.
_DIRECTIONS = {0: "cold", 1: "up", -1: "down"}
#: Maximum number of intervals of the envelope of a run-up, and minimum number of samples in each.
_MAX_INTERVALS, _MIN_INTERVAL_SAMPLES = 400, 20
#: Number of harmonics of a time history; numbers of measured and computed points in its plot.
_HARMONIC_COUNT, _MEASURED_POINTS, _COMPUTED_POINTS = 5, 600, 256
#: Minimum relative singular value for which the samples determine all harmonics.
_MIN_SINGULAR_VALUE = 1e-7
#: Multiples of the mesh order; maximum number of blocks of revolutions; samples per mesh period.
_MESH_ORDERS, _MAX_BLOCKS, _SAMPLES_PER_PERIOD = np.arange(1, 4), 300, 128
#: Maximum number of straight segments that approximate a measured speed course.
_MAX_SPEED_SEGMENTS = 200
#: Minimum ratio of a jump to the range of values and to the largest other step.
_MIN_JUMP_RANGE_RATIO, _MIN_JUMP_STEP_RATIO = 0.15, 2.0
#: An unknown value and its standard deviation.
_UNKNOWN = (math.nan, math.nan)

#: A value and its standard deviation.
Estimate = tuple[float, float]


class Comparison(NamedTuple):
    """A measured and a computed estimate of one quantity."""

    quantity: str
    measured: Estimate
    computed: Estimate
    unit: str = ""
    calibration: str = "none"  #: what must be calibrated: none, sensor or speed


def read_response_curve(path: str, resonance: xr.Dataset) -> xr.Dataset:
    """Read a measured data set as a response curve over speed, in dimensionless model units.

    `path` is the YAML file of the data set, and `resonance` has the computed sweeps for all damping
    combinations. A run-up is replaced by its envelope. The tuning is mesh frequency over natural
    frequency; the attribute tuning_rate is the tuning per rpm. The attributes fitted_gain and
    fitted_offset of an observable result from a fit to the sweep that describes the data best; the
    value without sensor errors is (value - offset) / gain.
    """
    measurement = read_measured(path)
    resonance = _add_orbit_height(resonance)
    # A measured sweep has summaries such as extrema; a measured run-up has a time history.
    is_sweep = not set(SWEEP_SCALES).isdisjoint(measurement.data_vars)
    sweep = measurement if is_sweep else _compute_envelope(measurement)
    tuning_rate = float(resonance.tuning[-1] / resonance.speed[-1])
    scalars = [name for name in measurement.data_vars if not measurement[name].dims]
    dataset = measurement[scalars].reset_coords(drop=True)
    observables = [name for name in SWEEP_SCALES if name in sweep]
    if "speed" in sweep.coords and observables:
        speed = sweep.speed
        direction = sweep.coords.get("direction", xr.zeros_like(speed, np.int8))
        dataset = dataset.assign_coords(
            speed=("sample", speed.values),
            tuning=("sample", (tuning_rate * speed).values),
            direction=("sample", direction.values),
        )
        for name in observables:
            attrs, scale = sweep[name].attrs, SWEEP_SCALES[name]
            has_unit = scale and attrs.get("units") not in ("1", "count")
            factor = 1.0 / float(resonance[scale]) if has_unit else 1.0
            attrs |= {"units": "1", "noise_std": factor * attrs.get("noise_std", 0.0)}
            dataset[name] = "sample", factor * sweep[name].values, attrs
            dataset[name].attrs |= _fit_sensor(dataset, name, resonance)
    return dataset.assign_attrs(measurement.attrs | {"tuning_rate": tuning_rate})


def _compute_envelope(measurement: xr.Dataset) -> xr.Dataset:
    """Compute the extrema of displacement and force in short intervals of a run-up.

    `measurement` has samples over time and speed. The result has the mean speed of each interval
    and its direction, 1 if the speed rises and -1 if it falls. It is empty if time or speed is
    missing or if the speed is constant.
    """
    if not {"time", "speed"} <= set(measurement.coords):
        return xr.Dataset()
    speed = measurement.speed.values
    if np.ptp(speed) == 0.0:
        return xr.Dataset()
    count = max(1, min(_MAX_INTERVALS, speed.size // _MIN_INTERVAL_SAMPLES))
    starts = np.arange(count) * speed.size // count
    ends = np.append(starts[1:], speed.size) - 1
    direction = np.sign(speed[ends] - speed[starts]).astype(np.int8)
    if "direction" in measurement.coords:
        direction = measurement.direction.values[starts]
    mean_speed = np.add.reduceat(speed, starts) / (ends - starts + 1)
    coords = {"speed": ("sample", mean_speed), "direction": ("sample", direction)}
    envelope = xr.Dataset(coords=coords)
    for name in ("displacement", "dynamic_force"):
        if name in measurement:
            values, attrs = measurement[name].values, measurement[name].attrs
            envelope[f"{name}_max"] = "sample", np.fmax.reduceat(values, starts), attrs
            envelope[f"{name}_min"] = "sample", np.fmin.reduceat(values, starts), attrs
    return envelope


def _fit_sensor(measured: xr.Dataset, observable: str, resonance: xr.Dataset) -> dict:
    """Fit gain and offset of a sensor to the computed sweep that describes the data best.

    `measured` is a response curve with the variable `observable`; `resonance` has the computed
    sweeps for all damping combinations. Return a dict with fitted_gain and fitted_offset, which are
    1 and 0 unless the data set marks gain or offset as unknown.
    """
    values, attrs = measured[observable].values, measured[observable].attrs
    fit_gain = bool(attrs.get("unknown_gain"))
    fit_offset = bool(attrs.get("unknown_offset"))
    dampings = resonance.damping.values if fit_gain or fit_offset else ()
    # Tuples (mean square error, gain, offset); the first one is the default.
    fits = [(math.inf, 1.0, 0.0)]
    for damping in dampings:
        computed = _interpolate_sweeps(measured, resonance.sel(damping=damping), observable)
        gain, offset = _fit_line(computed, values, fit_gain, fit_offset)
        if gain > 0.0:  # false if gain is NaN because of too few samples
            mean_square = np.nanmean((gain * computed + offset - values) ** 2)
            fits.append((mean_square, gain, offset))
    _, gain, offset = min(fits)
    return {"fitted_gain": float(gain), "fitted_offset": float(offset)}


def _fit_line(computed, measured, fit_gain: bool = True, fit_offset: bool = True) -> tuple:
    """Fit gain and offset of measured = gain * computed + offset by least squares.

    `computed` and `measured` have the shape (n,). If a parameter is not fitted, the gain is 1 and
    the offset is 0. Both are NaN if fewer than four samples are finite.
    """
    finite = np.isfinite(measured) & np.isfinite(computed)
    measured, computed = measured[finite], computed[finite]
    if measured.size < 4:
        return _UNKNOWN
    columns = []
    if fit_gain:
        columns.append(computed)
    if fit_offset:
        columns.append(np.ones(computed.size))
    target = measured if fit_gain else measured - computed
    coefficients = np.linalg.lstsq(np.stack(columns, axis=1), target, rcond=None)[0]
    gain = coefficients[0] if fit_gain else 1.0
    offset = coefficients[-1] if fit_offset else 0.0
    return gain, offset


def _interpolate_sweeps(measured, sweeps, observable: str) -> np.ndarray:
    """Interpolate computed values of an observable at the speeds and directions of the samples.

    `measured` is a response curve; `sweeps` are the computed sweeps with one damping combination.
    Values are NaN outside the computed range of speeds and for directions that were not computed.
    """
    values = np.full(measured.sizes["sample"], np.nan)
    for code, direction in _DIRECTIONS.items():
        if direction in sweeps.direction.values:
            samples = measured.direction.values == code
            sweep = sweeps.sel(direction=direction)
            speeds = measured.speed.values[samples]
            values[samples] = np.interp(speeds, sweep.speed, sweep[observable], np.nan, np.nan)
    return values


def _add_orbit_height(resonance: xr.Dataset) -> xr.Dataset:
    """Return computed sweeps with the additional variable orbit_height (maximum - minimum)."""
    return resonance.assign(orbit_height=resonance.displacement_max - resonance.displacement_min)


def compare_time_histories(path: str, models: Mapping[str, Any], run: dict) -> xr.Dataset:
    """Compute the harmonics of measured time histories and of simulated periodic motions.

    `path` is the YAML file of the measured data set, `models` maps names of damping combinations to
    models, and `run` has arguments of `gearlib.simulate`. The dataset has the dimensions course (a
    time history at constant speed), observable, harmonic of the mesh frequency, and damping. The
    shape_phase (degrees) of harmonic k is its phase minus k times the phase of the first harmonic.
    It does not depend on the unknown phase of the shaft.
    """
    measurement = read_measured(path)
    names = [name for name in SI_SCALES if name in measurement]
    teeth = next(iter(models.values())).teeth
    histories = []
    for condition in _select_conditions(measurement, constant_speed=True):
        speed = float(condition.speed[0])
        if speed <= 0.0:
            continue
        motions = [simulate(model, speed=speed, **run) for model in models.values()]
        mesh_frequency = math.pi / 30.0 * speed * teeth  # rad/s
        observables = []
        for name in names:
            computed = [_analyse_computed_history(motion, name, run) for motion in motions]
            measured = _fit_measured_history(condition, name, mesh_frequency)
            history = xr.concat(computed, "damping").merge(measured)
            observables.append(history.assign_coords(observable=name))
        histories.append(xr.concat(observables, "observable").assign_coords(speed=speed))
    _require_conditions(histories, path, measurement, "a constant speed > 0")
    dataset = xr.concat(histories, "course").assign_coords(damping=[*models])
    dataset = dataset.assign_coords(harmonic=np.arange(1, _HARMONIC_COUNT + 1))
    return _add_measurement_attrs(dataset, measurement, names)


def _require_conditions(conditions: list, path: str, measurement: xr.Dataset, allowed: str) -> None:
    """Raise ValueError if a measured data set has no operating condition with a suitable speed.

    `conditions` is a list of the suitable conditions, and `path` the file of the `measurement`.
    `allowed` describes a suitable speed in the message.
    """
    speed = measurement.speed.values
    interval = f"{speed.min():g} to {speed.max():g} rpm"
    checks.require(conditions, f"speed in {path}", interval, f"{allowed} in at least one condition")


def _add_measurement_attrs(dataset: xr.Dataset, measurement, observables) -> xr.Dataset:
    """Return `dataset` with the attributes of `measurement` and the unit of the speed.

    The additional attribute course_units states the units of the `observables`, names of variables
    of `measurement`, as in "displacement in m".
    """
    dataset["speed"].attrs["units"] = "min-1"
    units = ", ".join(f"{name} in {measurement[name].attrs['units']}" for name in observables)
    return dataset.assign_attrs(measurement.attrs | {"course_units": units})


def _select_conditions(measurement: xr.Dataset, constant_speed: bool) -> list[xr.Dataset]:
    """Return a list of datasets with the samples of each operating condition.

    If `constant_speed` is true, only conditions with a constant speed are selected, otherwise only
    those with a varying speed. Without the coordinate "condition", all samples are one condition.
    """
    names = np.zeros(measurement.sizes["sample"])
    if "condition" in measurement.coords:
        names = measurement.condition.values
    conditions = []
    for name in dict.fromkeys(names.tolist()):
        condition = measurement.isel(sample=names == name)
        has_constant_speed = np.ptp(condition.speed.values) == 0.0
        if has_constant_speed == constant_speed:
            conditions.append(condition)
    return conditions


def _analyse_computed_history(motion: xr.Dataset, observable: str, run: dict) -> xr.Dataset:
    """Compute the harmonics (SI units) of a simulated observable, and one mesh period for plots.

    `motion` is a result of `gearlib.simulate` with the arguments `run`, and `observable` the name
    of a variable. The plotted mesh period starts at the peak of the first harmonic.
    """
    periods, samples = int(run["record_periods"]), int(run["samples_per_period"])
    scale = float(motion[SI_SCALES[observable]])
    values = scale * motion[observable].values[: periods * samples]
    # Over n mesh periods, each n-th component of the spectrum is a mesh harmonic.
    harmonics = np.fft.rfft(values)[periods::periods][:_HARMONIC_COUNT] / (0.5 * values.size)
    phases = np.linspace(0.0, math.tau, samples, endpoint=False)
    plot_phases = np.linspace(0.0, math.tau, _COMPUTED_POINTS)
    shifted_phases = plot_phases - np.angle(harmonics[0])
    plot_values = np.interp(shifted_phases, phases, values[:samples], period=math.tau)
    variables = {
        "computed_amplitude": ("harmonic", np.abs(harmonics)),
        "computed_shape_phase": ("harmonic", _shape_phases(harmonics)),
        "computed": ("phase", plot_values),
    }
    return xr.Dataset(variables, {"phase": plot_phases})


def _shape_phases(harmonics: np.ndarray) -> np.ndarray:
    """Return the phase of each harmonic k minus k times the phase of the first, in degrees.

    These phases do not depend on the origin of time. `harmonics` are complex amplitudes, beginning
    with the first harmonic.
    """
    numbers = np.arange(1, harmonics.size + 1)
    return np.degrees(np.angle(harmonics * np.exp(-1j * numbers * np.angle(harmonics[0]))))


def _fit_measured_history(
    condition: xr.Dataset, observable: str, mesh_frequency: float
) -> xr.Dataset:
    """Fit the harmonics of a measured time history, and select samples for plots.

    `condition` has the samples at one operating condition, and `observable` is the name of a
    variable. Harmonics of the `mesh_frequency` (rad/s) and their standard deviations are computed
    by least squares. All values are NaN if there are too few samples. The plotted samples along
    "number" have point_phase (rad, 0 at the peak of the first harmonic) and point (the value).
    """
    finite = np.isfinite(condition[observable].values)
    # If all samples are NaN, the first one is kept, so that arrays are not empty.
    finite[:1] |= not finite.any()
    time, values = condition.time.values[finite], condition[observable].values[finite]
    numbers = np.arange(1, _HARMONIC_COUNT + 1)
    harmonics = np.full(_HARMONIC_COUNT, complex(np.nan))
    deviation = math.nan
    plot_indices = np.linspace(0, time.size - 1, _MEASURED_POINTS).astype(int)
    if values.size > 2 * _HARMONIC_COUNT + 1:
        waves = np.exp(1j * np.outer(mesh_frequency * (time - time[0]), numbers))
        basis = np.hstack([np.ones((time.size, 1)), waves.real, waves.imag])
        fit, _, rank, _ = np.linalg.lstsq(basis, values, rcond=_MIN_SINGULAR_VALUE)
        if rank == basis.shape[1]:
            _, *cosines_and_sines = fit  # the first column of the basis is constant
            cosines, sines = np.split(np.array(cosines_and_sines), 2)
            harmonics = cosines - 1j * sines
            noise = condition[observable].attrs.get("noise_std") or np.std(values - basis @ fit)
            deviation = noise * math.sqrt(2.0 / time.size)
    phase_deviation = deviation / np.abs(harmonics)
    shape_deviation = np.degrees(np.hypot(phase_deviation, numbers * phase_deviation[0]))
    point_phases = mesh_frequency * (time[plot_indices] - time[0]) + np.angle(harmonics[0])
    return xr.Dataset(
        {
            "amplitude": ("harmonic", np.abs(harmonics)),
            "amplitude_std": ("harmonic", np.full(_HARMONIC_COUNT, deviation)),
            "shape_phase": ("harmonic", _shape_phases(harmonics)),
            "shape_phase_std": ("harmonic", shape_deviation),
            "point_phase": ("number", np.mod(point_phases, math.tau)),
            "point": ("number", np.where(np.isfinite(deviation), values[plot_indices], np.nan)),
        }
    )


def compare_run_ups(path: str, models: Mapping[str, Any]) -> xr.Dataset:
    """Compute amplitudes of the mesh orders in run-ups, measured and computed.

    Mesh orders are multiples (`_MESH_ORDERS`) of the number of teeth, in periods per revolution.
    `path` is the YAML file of the measured data set, and `models` maps names of damping
    combinations to models. The dataset has the dimensions track (a run-up or run-down), observable,
    order (multiple of the number of teeth) and block (of whole revolutions). The variable amplitude
    is measured; computed_amplitude, also over damping, is computed for the measured speed course,
    starting from static equilibrium. Amplitudes are rms values in SI units.
    """
    measurement = read_measured(path)
    names = [name for name in SI_SCALES if name in measurement]
    teeth = next(iter(models.values())).teeth
    dims = "observable", "order", "block"
    run_ups = []
    for condition in _select_conditions(measurement, constant_speed=False):
        speed = condition.speed.values
        revolutions = cumulative_trapezoid(speed / 60.0, condition.time.values, initial=0.0)
        interval = f"{np.ptp(condition.time.values):.4g} s"
        allowed = f"at least one revolution, not {revolutions[-1]:.3g} revolutions"
        checks.require(revolutions[-1] >= 1.0, f"time in {path}", interval, allowed)
        block_size = max(1, int(revolutions[-1] / _MAX_BLOCKS))
        edges = np.arange(int(revolutions[-1] / block_size) + 1) * block_size
        measured = [
            _mesh_order_amplitudes(condition[name], revolutions, edges, teeth) for name in names
        ]
        block_speed = np.interp(0.5 * (edges[1:] + edges[:-1]), revolutions, speed)
        measured_run_up = xr.Dataset(
            {"speed": ("block", block_speed), "amplitude": (dims, np.array(measured))},
            {"block": np.arange(edges.size - 1)},
        )
        options = {"resolution": 1.0 / block_size, "orders": teeth * _MESH_ORDERS}
        computed = []
        for model in models.values():
            speed_course = _approximate_speed_course(condition)
            run = run_up(model, speed=speed_course, samples_per_period=_SAMPLES_PER_PERIOD)
            maps = [order_map(run, variable=name, **options).amplitude.values.T for name in names]
            blocks = np.arange(maps[0].shape[-1])
            computed.append(xr.DataArray(np.array(maps), {"block": blocks}, dims))
        amplitudes = xr.concat(computed, "damping", join="outer")
        amplitudes = amplitudes.reindex_like(measured_run_up)
        run_ups.append(measured_run_up.assign(computed_amplitude=amplitudes))
    _require_conditions(run_ups, path, measurement, "a varying speed")
    dataset = xr.concat(run_ups, "track", join="outer")
    dataset = dataset.assign_coords(observable=names, damping=[*models], order=_MESH_ORDERS)
    dataset = dataset.transpose(..., "order", "block")
    return _add_measurement_attrs(dataset, measurement, names)


def _mesh_order_amplitudes(history, revolutions, edges, teeth: int) -> np.ndarray:
    """Compute rms amplitudes of the mesh orders of a measured time history, (orders, blocks).

    Mesh orders are multiples of the number of `teeth`, in periods per revolution. `history` is a
    variable over samples, and `revolutions` are the shaft revolutions at the samples. A block
    extends between adjacent `edges`, in revolutions. Amplitudes of blocks with gaps are NaN.
    """
    finite = np.isfinite(history.values)
    revolutions, values = revolutions[finite], history.values[finite]
    complete = complete_blocks(revolutions, edges, teeth)
    missing_count = int((~complete).sum())
    if missing_count:
        blocks = f"{missing_count} of {complete.size} blocks of revolutions"
        warnings.warn(f"{blocks} of {history.name} have gaps and are ignored", stacklevel=2)
    # Fourier coefficients of a block are integrals over its revolutions (trapezoidal rule).
    waves = values * np.exp(-2j * np.pi * teeth * _MESH_ORDERS[:, None] * revolutions)
    integrals = cumulative_trapezoid(waves, revolutions, initial=0.0)
    edge_values = np.array([np.interp(edges, revolutions, integral) for integral in integrals])
    amplitude = math.sqrt(2.0) * np.abs(np.diff(edge_values)) / np.diff(edges)
    return np.where(complete, amplitude, np.nan)


def _approximate_speed_course(condition: xr.Dataset) -> list[tuple[float, float]]:
    """Approximate a measured speed course by a piecewise linear one of points (time in s, rpm).

    Points are means over groups of samples, which suppresses the accelerations that sensor noise
    would cause. The time starts at 0.
    """
    time = condition.time.values - condition.time.values[0]
    speed = condition.speed.values
    groups = np.array_split(np.arange(time.size), min(_MAX_SPEED_SEGMENTS, time.size // 2))
    points = [(float(time[group].mean()), float(speed[group].mean())) for group in groups]
    return [(0.0, points[0][1]), *points, (float(time[-1]), points[-1][1])]


def comparison_rows(curves, resonance: xr.Dataset, courses=(), orders=()) -> Iterator[list]:
    """Yield the rows of a table that compares measured and computed quantities.

    `curves`, `courses` (time histories at constant speed) and `orders` (of run-ups) are lists of
    results of `read_response_curve`, `compare_time_histories` and `compare_run_ups`; `resonance`
    has the computed sweeps. The first row has the column names. Each other row compares a quantity
    of one data set with one damping combination. "set" is the title of the data set, "calibration"
    the calibration that the comparison requires, and "deviations" the difference divided by its
    standard deviation.
    """
    header = ["set", "quantity", "calibration", "damping", "measured", "standard_deviation"]
    yield [*header, "computed", "difference", "deviations"]
    resonance = _add_orbit_height(resonance)
    for dataset in (*curves, *courses, *orders):
        for damping in resonance.damping.values:
            if "track" in dataset.dims:
                comparisons = _compare_orders(dataset.sel(damping=damping))
            elif "course" in dataset.dims:
                comparisons = _compare_harmonics(dataset.sel(damping=damping))
            else:
                comparisons = _compare_curve(dataset, resonance.sel(damping=damping))
            for comparison in comparisons:
                yield _comparison_row(dataset.attrs["title"], str(damping), comparison)


def _comparison_row(title: str, damping: str, comparison: Comparison) -> list:
    """Return the table row of a comparison of a data set with a damping combination.

    `title` is the title of the data set, and `damping` the name of the combination. NaN becomes an
    empty cell.
    """
    measured, measured_deviation = comparison.measured
    computed, deviation = comparison.computed
    difference = computed - measured
    # An unknown standard deviation of the computed value is ignored.
    computed_deviation = deviation if math.isfinite(deviation) else 0.0
    total_deviation = math.hypot(measured_deviation, computed_deviation)
    z_score = difference / total_deviation if measured_deviation > 0 else math.nan
    numbers = (measured, measured_deviation, computed, difference, z_score)
    cells = [float(f"{number:.6g}") if math.isfinite(number) else "" for number in numbers]
    quantity = f"{comparison.quantity} {comparison.unit}".rstrip()
    return [title, quantity, comparison.calibration, damping, *cells]


def _compare_curve(measured: xr.Dataset, sweeps: xr.Dataset) -> Iterator[Comparison]:
    """Yield comparisons of a response curve with the `sweeps` of one damping combination.

    The comparisons are, in this order, ratios of jump speeds and of peaks, which need no
    calibration; misfits of all observables; jump speeds; and the speed at which contact loss
    begins.
    """
    observable = next((name for name in _JUMP_OBSERVABLES if name in measured), None)
    jumps = _compare_jumps(measured, sweeps, observable)
    if len(jumps) == 2:
        measured_down, computed_down = jumps["down"]
        measured_up, computed_up = jumps["up"]
        measured_ratio = _ratio_of_estimates(measured_down, measured_up)
        computed_ratio = _ratio_of_estimates(computed_down, computed_up)
        yield Comparison("jump down over jump up", measured_ratio, computed_ratio)
    if observable and "direction" in measured.coords:
        computed = _interpolate_sweeps(measured, sweeps, observable)
        # The response peak of the minimum displacement is a minimum.
        sign = -1.0 if observable == "displacement_min" else 1.0
        noise = measured[observable].attrs["noise_std"] or math.nan
        directions = measured.direction.values
        measured_ratio = _peak_ratio(sign * measured[observable].values, directions, noise)
        if math.isfinite(measured_ratio[0]):
            computed_ratio = _peak_ratio(sign * computed, directions, deviation=0.0)
            yield Comparison(f"highest {observable} down over up", measured_ratio, computed_ratio)
    for name in SWEEP_SCALES:
        if name in measured:
            yield from _compare_shapes(measured, sweeps, name)
    for direction, (speed, model_speed) in jumps.items():
        quantity = f"jump {direction}"
        yield Comparison(quantity, speed, model_speed, unit="min-1", calibration="speed")
    onset = _measured_speed(measured, "onset_of_contact_loss")
    if math.isfinite(onset[0]):
        quantity = "onset of contact loss"
        computed_onset = _find_computed_onset(sweeps)
        yield Comparison(quantity, onset, computed_onset, unit="min-1", calibration="speed")


def _compare_jumps(measured, sweeps, observable: str | None) -> dict[str, tuple]:
    """Return the measured and the computed jump speed for each direction with a measured jump.

    The result maps "up" and "down" to pairs of estimates (speed in rpm, standard deviation).
    `sweeps` are the computed sweeps with one damping combination. If the data set states no jump
    speed, the jump is searched in `observable`, unless this is None.
    """
    jumps = {}
    for code, direction in ((1, "up"), (-1, "down")):
        speed = _measured_speed(measured, f"jump_{direction}")
        if observable and "direction" in measured.coords and not math.isfinite(speed[0]):
            sweep = measured.isel(sample=measured.direction.values == code)
            speed = find_jump(sweep.speed.values, sweep[observable].values)
        if math.isfinite(speed[0]):
            computed = _UNKNOWN
            if direction in sweeps.direction.values:
                sweep = sweeps.sel(direction=direction)
                computed = find_jump(sweep.speed.values, sweep[observable or "orbit_height"].values)
            jumps[direction] = speed, computed
    return jumps


def _measured_speed(measured: xr.Dataset, name: str) -> Estimate:
    """Return a speed stated in a measured data set and its standard deviation, in rpm.

    `name` is a variable such as "jump_up". Both values are NaN if the data set does not have it.
    """
    if name not in measured:
        return _UNKNOWN
    return float(measured[name]), measured[name].attrs.get("noise_std", 0.0) or math.nan


def find_jump(speeds: np.ndarray, values: np.ndarray) -> Estimate:
    """Find the speed at which a curve jumps, and its standard deviation; NaN if there is no jump.

    The curve has `values` of an observable at `speeds`, in any order. NaN values are ignored. A
    jump is a step between adjacent samples that is large compared with the range of the values and
    with all other steps.
    """
    finite = np.isfinite(values)
    order = np.argsort(speeds[finite], kind="stable")
    speeds, values = speeds[finite][order], values[finite][order]
    if speeds.size < 4:
        return _UNKNOWN
    steps = np.abs(np.diff(values))
    i = int(steps.argmax())
    # The adjacent steps may be parts of the same jump.
    other_steps = np.concatenate([steps[: max(i - 1, 0)], steps[i + 2 :]])
    step_limit = _MIN_JUMP_STEP_RATIO * other_steps.max(initial=0.0)
    if steps[i] <= max(_MIN_JUMP_RANGE_RATIO * np.ptp(values), step_limit):
        return _UNKNOWN
    # The jump is uniformly distributed between two samples. The standard deviation must be > 0.
    return speeds[i : i + 2].mean(), max(speeds[i + 1] - speeds[i], 1e-300) / math.sqrt(12.0)


def _ratio_of_estimates(numerator: Estimate, denominator: Estimate) -> Estimate:
    """Return the ratio of two estimates, each a value and its standard deviation.

    The standard deviation of the ratio follows from propagation of errors.
    """
    ratio = numerator[0] / denominator[0]
    relative_deviations = (numerator[1] / numerator[0], denominator[1] / denominator[0])
    return ratio, abs(ratio) * math.hypot(*relative_deviations)


def _peak_ratio(values: np.ndarray, directions: np.ndarray, deviation: float) -> Estimate:
    """Return the ratio of the peaks of the sweeps down and up, and its standard deviation.

    `values` and `directions` (1 for up, -1 for down) have the shape (samples,), and `deviation` is
    the standard deviation of the values. Peaks are measured from the median of both sweeps. The
    result is NaN if one of the sweeps is missing.
    """
    down, up = values[directions == -1], values[directions == 1]
    if not (np.isfinite(down).any() and np.isfinite(up).any()):
        return _UNKNOWN
    median = np.nanmedian(np.concatenate([down, up]))
    peaks = [(float(np.nanmax(sweep)) - median, deviation) for sweep in (down, up)]
    return _ratio_of_estimates(*peaks)


def _compare_shapes(measured, sweeps, observable: str) -> Iterator[Comparison]:
    """Yield the misfit of an observable, i.e. the rms difference divided by the measured range.

    `sweeps` are the computed sweeps with one damping combination. Gain and offset of the sensor are
    fitted. If neither is marked as unknown, a second misfit uses the calibrated sensor. The
    measured estimate of a misfit is NaN; its standard deviation is the noise of the sensor.
    """
    values = measured[observable].values
    computed = _interpolate_sweeps(measured, sweeps, observable)
    gain, offset = _fit_line(computed, values)
    if not math.isfinite(gain):
        return
    attrs, value_range = measured[observable].attrs, float(np.nanmax(values) - np.nanmin(values))
    fits = [("free gain and offset", "none", gain * computed + offset)]
    if not attrs.get("unknown_gain") and not attrs.get("unknown_offset"):
        fits.append(("as calibrated", "sensor", computed))
    for description, calibration, fitted in fits:
        rms = float(np.sqrt(np.nanmean((values - fitted) ** 2))) / value_range
        measured_estimate = math.nan, attrs["noise_std"] / value_range or math.nan
        quantity = f"misfit of {observable} over its range, {description}"
        yield Comparison(quantity, measured_estimate, (rms, math.nan), calibration=calibration)


def _find_computed_onset(sweeps: xr.Dataset) -> Estimate:
    """Find the speed at which contact loss begins in the sweep up, and its standard deviation.

    `sweeps` are the computed sweeps with one damping combination. Both values are NaN if there is
    no such sweep or if contact is never lost.
    """
    if "up" not in sweeps.direction.values:
        return _UNKNOWN
    sweep = sweeps.sel(direction="up").sortby("speed")
    loses_contact = sweep.contact_loss_fraction.values > FRACTION_TOLERANCE
    onsets = np.flatnonzero(loses_contact[1:] & ~loses_contact[:-1])
    if not onsets.size:
        return _UNKNOWN
    lower, upper = sweep.speed.values[onsets[0] : onsets[0] + 2]
    # The onset is uniformly distributed between both speeds.
    return 0.5 * (lower + upper), (upper - lower) / math.sqrt(12.0)


def _compare_orders(run_ups: xr.Dataset) -> Iterator[Comparison]:
    """Yield comparisons of the mesh orders in `run_ups`, a result of `compare_run_ups`.

    In the names of quantities, z is the first mesh order (the number of teeth), 2z the second, etc.
    Standard deviations are unknown (NaN).
    """
    for i, j in np.ndindex(run_ups.sizes["track"], run_ups.sizes["observable"]):
        run_up = run_ups.isel(track=i, observable=j)
        amplitudes = (run_up.amplitude.values, run_up.computed_amplitude.values)
        name = str(run_up.observable.values)
        if not np.isfinite(run_up.amplitude.values[0]).any():
            continue
        for k in range(1, run_up.sizes["order"]):
            quotients = [np.nanmax(values[k]) / np.nanmax(values[0]) for values in amplitudes]
            ratios = [(float(quotient), math.nan) for quotient in quotients]
            yield Comparison(f"largest order {k + 1}z of {name} over order z", *ratios)
        estimates = []  # speeds of the largest measured and computed amplitude
        for values in amplitudes:
            peak_block = int(np.nanargmax(values[0]))
            estimates.append((float(run_up.speed[peak_block]), math.nan))
        quantity = f"largest order z of {name}"
        measured, computed = estimates
        yield Comparison(quantity, measured, computed, unit="min-1", calibration="speed")


def _compare_harmonics(histories: xr.Dataset) -> Iterator[Comparison]:
    """Yield comparisons of measured and computed harmonics of time histories at constant speed.

    `histories` is a result of `compare_time_histories` for one damping combination. Amplitudes and
    phases are compared relative to the first harmonic, so that neither the calibration nor the
    phase of the shaft matters.
    """
    for i, j in np.ndindex(histories.sizes["course"], histories.sizes["observable"]):
        history = histories.isel(course=i, observable=j)
        if not math.isfinite(float(history.amplitude[0])):
            continue
        location = f"of {history.observable.values} at {float(history.speed):.6g} min-1"
        measured = [*zip(history.amplitude.values, history.amplitude_std.values, strict=True)]
        computed = [(amplitude, 0.0) for amplitude in history.computed_amplitude.values]
        for k in range(1, history.sizes["harmonic"]):
            ratios = (
                _ratio_of_estimates(measured[k], measured[0]),
                _ratio_of_estimates(computed[k], computed[0]),
            )
            yield Comparison(f"harmonic {k + 1} over the first {location}", *ratios)
            phase = float(history.shape_phase[k]), float(history.shape_phase_std[k])
            computed_phase = float(history.computed_shape_phase[k])
            # Add full turns so that the computed phase is within 180 degrees of the measured one.
            computed_phase += 360.0 * round((phase[0] - computed_phase) / 360.0)
            quantity = f"phase of harmonic {k + 1} minus {k + 1} times that of the first {location}"
            yield Comparison(quantity, phase, (computed_phase, math.nan), unit="deg")
