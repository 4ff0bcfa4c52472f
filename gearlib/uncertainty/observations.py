"""Build the observations that a fit compares: slow sweeps, jump speeds, time histories.

Slow sweeps are compared point by point, each side of a jump with its own branch of orbits; a point
beyond the fold of the model is compared with the last orbit before the fold. Jumps are compared by
their speeds.
"""

import math
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks, parameters
from gearlib.data import measured_names
from gearlib.parameters import NonNegative, Positive
from gearlib.runs.sweeping import sweep
from gearlib.uncertainty import observation
from gearlib.uncertainty.course_observations import time_history_observations
from gearlib.uncertainty.designs import RESONANCE_NAMES
from gearlib.uncertainty.observation import Channel, Curve, MeasuredSpeed, Observation, Prediction

#: Standard deviation of a measured speed whose noise is not known, relative to the speed.
_ASSUMED_SPEED_NOISE = 1e-3
#: Smallest ratio of a jump to the median change between successive points.
_MIN_JUMP_RATIO = 3.0
_ORDERS = range(1, observation.SAMPLES_PER_PERIOD // 2 + 1)
_ORDER_QUANTITIES = [f"{observation.ORDER_AMPLITUDE}_{order}" for order in _ORDERS]
_SWEEP_QUANTITIES = (*observation.STATISTICS, observation.LOAD_SHARING, *_ORDER_QUANTITIES)
#: Quantities that decrease at a jump up, and name endings of quantities that increase.
_FALLING_QUANTITIES = ("displacement_min", "dynamic_force_min")
_RISING_ENDINGS = ("_max", *_ORDER_QUANTITIES[:9])


def make_observations(model: Any, data: Any) -> list[Observation]:
    """Create the `Observation`s of one measured data set or of a list of data sets.

    An observation has measured values, such as those of a slow sweep, and a function that predicts
    them. `model` is the model of the rig; its mesh names select the variables that are compared.
    """
    datasets = data if isinstance(data, list | tuple) else [data]
    observations = []
    for dataset in datasets:
        observations += _dataset_observations(model, dataset)
    return observations


def _dataset_observations(model: Any, data: Any) -> list[Observation]:
    """Create the `Observation`s of one measured data set, or raise ValueError if it has none.

    An observation has measured values and a function that predicts them. `data` is a dataset with a
    displacement over time, quantities over speed, or scalar speeds of jumps; `model` is the model
    of the rig.
    """
    if not hasattr(data, "data_vars"):
        value = data if isinstance(data, int | float | str) else type(data).__name__
        raise checks.InputError(
            "data", value, "datasets with a displacement over time or jump speeds"
        )
    speeds = {name: data[name] for name in RESONANCE_NAMES if name in data}
    has_time = "time" in data.coords
    quantities: dict = {}
    observations: list = []
    if has_time or "speed" in data.coords:
        comparable = ("displacement",) if has_time else _SWEEP_QUANTITIES
        quantities = split_variable_names(model, data.data_vars, comparable)
    _check_dataset(data, quantities, speeds)
    if has_time:
        for name, (quantity, mesh) in quantities.items():
            history = data.isel(sample=data[name].notnull().values).rename({name: quantity})
            observations += time_history_observations(model, history, mesh)
    elif quantities:
        sweep_observation, jumps = _sweep_observation(data, quantities)
        observations.append(sweep_observation)
        # A jump speed given in the data set replaces the one found in the sweep.
        speeds = jumps | speeds
    if speeds:
        observations.append(_speed_observation(speeds))
    if not observations:
        raise ValueError(
            f"data = {list(data.variables)!r} is not allowed: it must have a displacement over "
            f"time, one of {', '.join(observation.STATISTICS)} over speed, jump_up, jump_down or "
            "onset_of_contact_loss"
        )
    return observations


def split_variable_names(model: Any, names: Any, comparable: tuple = _SWEEP_QUANTITIES) -> dict:
    """Split names of variables into quantity and mesh: return name -> (quantity, mesh index).

    `names` are names of variables of a measured data set, such as "load_sharing_sun_2", the load
    sharing of the mesh "sun 2" of a train; `comparable` are the names of the quantities to use.
    Other variables are omitted.
    """
    endings = [f"_{name.replace(' ', '_')}" for name in model.mesh_names] or [""]
    quantities = {}
    for name in map(str, names):
        for mesh, ending in enumerate(endings):
            quantity = name.removesuffix(ending)
            # A model without mesh names has only one mesh, so it has no load sharing.
            exists = ending or quantity != observation.LOAD_SHARING
            if name.endswith(ending) and quantity in comparable and exists:
                quantities[name] = quantity, mesh
    return quantities


def _check_dataset(data: Any, quantities: dict, speeds: dict) -> None:
    """Raise ValueError unless the compared variables have finite values, SI units and valid noise.

    `data` is a measured dataset. `quantities` maps names of its variables to (quantity, mesh
    index), and `speeds` maps names such as "jump_up" to scalar variables in rpm.
    """
    if quantities:
        for name in ("time", "speed", "direction"):
            if name in data.coords:
                _check_finite_samples(name, data[name])
        if "direction" in data.coords:
            for sign in np.unique(data.direction.values).tolist():
                checks.check_choice("direction", sign, (1, -1, 0))
    for name, (quantity, _) in quantities.items():
        _check_finite_samples(name, data[name], gaps="time" in data.coords)
        _check_sensor(name, quantity, data[name].attrs)
    for name, speed in speeds.items():
        checks.require(speed.ndim == 0, name, f"of shape {speed.shape}", "one number, in rpm")
        parameters.check(name, speed.values[()], Positive)
        _check_sensor(name, name, speed.attrs)


def _check_finite_samples(name: str, variable: Any, gaps: bool = False) -> None:
    """Raise ValueError unless a variable has finite real numbers at all samples.

    `name` is its name in messages. With `gaps`, some samples may be NaN (not measured).
    """
    values = variable.values
    checks.require(values.dtype.kind in "iuf", name, str(values.dtype), "of real numbers")
    checks.require(variable.ndim == 1, name, f"of shape {values.shape}", "over samples only")
    if gaps:
        over_samples = variable.dims == ("sample",)
        checks.require(over_samples, name, f"over {variable.dims[0]}", "over sample")
    checks.require(values.size > 0, name, "empty", "of at least one sample")
    finite = np.isfinite(values)
    is_valid = finite | np.isnan(values) if gaps else finite
    checks.require(finite.any() and is_valid.all(), name, "NaN", "finite in each sample")


def _check_sensor(name: str, quantity: str, attrs: dict) -> None:
    """Raise ValueError if the attributes that describe the sensor of a variable are invalid.

    The `attrs` are noise_std, the flags unknown_gain and unknown_offset (0 or 1), and units. `name`
    is the name of the variable in messages, and `quantity` the measured quantity.
    """
    parameters.check(f"noise_std of {name}", attrs.get("noise_std", 0.0), NonNegative)
    for flag in ("unknown_gain", "unknown_offset"):
        checks.check_choice(f"{flag} of {name}", int(attrs.get(flag, 0)), (0, 1))
    # Mesh orders have the units of the displacement.
    expected_units = measured_names.units_and_description(quantity)[0] or "m"
    units = attrs.get("units", expected_units)
    is_allowed = units == expected_units or attrs.get("unknown_gain", 0)
    allowed = f"{expected_units}, or any unit with unknown_gain = 1"
    checks.require(is_allowed, f"units of {name}", units, allowed)


def _speed_observation(speeds: dict) -> Observation:
    """Return the `Observation` of measured speeds of jumps and of the onset of contact loss.

    `speeds` maps their names, such as "jump_up", to scalar xarray variables in rpm, whose attribute
    noise_std is the standard deviation, or 0 if unknown.
    """
    measured = {name: float(speed) for name, speed in speeds.items()}
    noise = np.array([speed.attrs.get("noise_std", 0.0) for speed in speeds.values()], float)
    values = np.array([*measured.values()])
    deviations = np.where(noise > 0.0, noise, _ASSUMED_SPEED_NOISE * values)

    def predict(model: Any) -> Prediction:
        """Return the speeds of jumps and onset of a model, NaN if it does not have them.

        The displacement into the backlash is not computed but set to 0.
        """
        predicted = observation.resonance_speeds(model, measured)
        predicted_values = np.array([predicted.get(name, math.nan) for name in measured])
        return Prediction([predicted_values], backlash_excursion=0.0)

    def make_curves(signals: list) -> list:
        """Return a `MeasuredSpeed` for each speed; `signals` has the array of predicted speeds."""
        names = [name.replace("_", " ") for name in measured]
        return list(map(MeasuredSpeed, names, values, deviations, signals[0]))

    channel = Channel("speeds", values, deviations, noise_known=bool((noise > 0.0).all()))
    return Observation("speeds", [channel], predict, make_curves)


def _sweep_observation(data: Any, quantities: dict) -> tuple[Observation, dict]:
    """Return (`Observation` of quantities over speed, speeds of the jumps in these sweeps).

    `data` is a dataset with the coordinates speed in rpm and direction (1 up, -1 down).
    `quantities` maps names of its variables to (quantity, mesh index). Jump speeds map "jump_up"
    and "jump_down" to scalar variables in rpm.
    """
    speeds = np.asarray(data.speed.values, float)
    checks.require((speeds > 0.0).all(), "speed", float(speeds.min()), "> 0 in each sample")
    signs = data.direction.values if "direction" in data.coords else np.zeros(len(speeds))
    branches, jumps = _split_into_branches(data, quantities, speeds, signs)
    sequence = np.concatenate(branches)[None]  # one row of sample indices, branch by branch
    channels = []
    for name in quantities:
        values, attrs = np.asarray(data[name].values, float), data[name].attrs
        noise = float(attrs.get("noise_std", 0.0))
        allowed = "more than one value, or values with known noise"
        checks.require(np.ptp(values) > 0.0 or noise, name, values[0], allowed)
        # Channels of unknown noise are made comparable by the ranges of their values.
        stds = np.full(values.size, noise or np.ptp(values))
        sample_noise = data.get(f"{name}_noise_std")
        if sample_noise is not None and (sample_noise.values > 0.0).all():
            stds = sample_noise.values.astype(float)
        has_unknown_gain = bool(attrs.get("unknown_gain", 0))
        has_unknown_offset = bool(attrs.get("unknown_offset", 0))
        flags = bool(noise), has_unknown_gain, has_unknown_offset
        channels.append(Channel(name, values, stds, *flags, sequence))
    has_orders = any(observation.ORDER_AMPLITUDE in quantity for quantity, _ in quantities.values())
    samples_per_period = observation.SAMPLES_PER_PERIOD if has_orders else 1

    def predict(model: Any) -> Prediction:
        """Return the predicted values of each quantity at all measured speeds.

        On each side of a jump they belong to a separate branch of periodic orbits of the model.
        """
        orbits = np.empty(len(speeds), object)
        for branch in branches:
            orbits[branch] = _branch_orbits(model, speeds[branch], samples_per_period)
        values = [
            np.array([observation.mesh_quantity(orbit, quantity, mesh) for orbit in orbits])
            for quantity, mesh in quantities.values()
        ]
        excursions = (observation.backlash_excursion(model, orbit) for orbit in orbits)
        return Prediction(values, backlash_excursion=max(excursions))

    def make_curves(signals: list) -> list:
        """Return a `Curve` over speed of the measured and the predicted values of each channel.

        `signals` are the predicted signals of the sensors, one array per channel.
        """
        curves = []
        for channel, fitted in zip(channels, signals, strict=True):
            name = channel.name.replace("_", " ")
            units = data[channel.name].attrs.get("units", "")
            values = channel.values, fitted
            curves.append(Curve(name, units, "speed", speeds, values, signs < 0))
        return curves

    return Observation("branches", channels, predict, make_curves), jumps


def _split_into_branches(
    data: Any, quantities: dict, speeds: np.ndarray, signs: np.ndarray
) -> tuple:
    """Return (sample indices of each branch of orbits, speeds of the jumps).

    A sweep with a jump has two branches: from its first speed to the jump, and from its last speed
    back to the jump. `data` is the measured dataset; `speeds` in rpm and `signs` have shape
    (samples,). Signs are 1 for upward sweeps, -1 for downward sweeps and 0 for single speeds, each
    of which is a branch. `quantities` maps names of variables to (quantity, mesh index). The jump
    speeds map "jump_up" and "jump_down" to scalar variables in rpm.
    """
    # Quantities that always increase or always decrease at a jump up determine its direction; other
    # quantities are used only if there are none of these.
    falling = [name for name in quantities if quantities[name][0] in _FALLING_QUANTITIES]
    rising = [name for name in quantities if quantities[name][0].endswith(_RISING_ENDINGS)]
    monotonic = [name for name in quantities if name in falling or name in rising]
    variables = [data[name] for name in monotonic or quantities]
    factors = [-1.0 if variable.name in falling else 1.0 for variable in variables]
    rows = [variable.values.astype(float) for variable in variables]
    table = np.array(factors)[:, None] * rows
    # A step of three standard deviations or less may be noise.
    min_steps = [3.0 * float(variable.attrs.get("noise_std", 0.0)) for variable in variables]
    branches, jumps = [], {}
    for sign in np.unique(signs):
        samples = np.flatnonzero(signs == sign)
        if not sign:
            branches += list(samples[:, None])
            continue
        samples = samples[np.argsort(sign * speeds[samples], kind="stable")]
        i = _jump_index(table[:, samples], min_steps, sign if monotonic else 0)
        if i is None:
            branches.append(samples)
            continue
        branches += [samples[:i], samples[i:][::-1]]
        before, after = speeds[samples[i - 1]], speeds[samples[i]]
        # The jump is uniformly distributed between the two speeds.
        attrs = {"units": "min-1", "noise_std": abs(after - before) / math.sqrt(12.0)}
        speed = xr.DataArray(0.5 * (before + after), attrs=attrs)
        jumps["jump_up" if sign > 0 else "jump_down"] = speed
    return branches, jumps


def _jump_index(table: np.ndarray, min_steps: Any, sign: int) -> int | None:
    """Return the index of the first sample after the largest jump, or None without a jump.

    `table` has one row per quantity and one column per sample, in the order of the sweep. At a
    jump, the change between successive samples exceeds `min_steps` (a number, or one per row), 15 %
    of the largest value, and three times the median change. The `sign` 1 selects increases, -1
    decreases, 0 both.
    """
    if table.shape[1] < 2:
        return None
    changes = np.diff(table, axis=1)
    steps = np.abs(changes)
    largest_values = np.maximum(np.abs(table).max(axis=1), 1e-300)[:, None]
    median_steps = np.median(steps, axis=1)[:, None]
    is_jump = steps > observation.MIN_RELATIVE_JUMP * largest_values
    is_jump &= steps > _MIN_JUMP_RATIO * median_steps
    is_jump &= (steps > np.reshape(min_steps, (-1, 1))) & ((changes * sign > 0.0) | (sign == 0))
    if not is_jump.any():
        return None
    return int(np.where(is_jump, steps / largest_values, 0.0).max(axis=0).argmax()) + 1


def _branch_orbits(model: Any, speeds: np.ndarray, samples_per_period: int) -> list[dict]:
    """Return the quantities of the periodic orbits on a branch, a dictionary for each speed.

    The speeds in rpm are in the order of the sweep; `samples_per_period` is the number of samples
    per mesh period. The branch ends where the displacement jumps up in an upward sweep, or down in
    a downward sweep, but not at a first impact on the coast side. The last orbit is repeated at all
    speeds beyond the end.
    """
    is_sweep_up = len(speeds) < 2 or speeds[-1] > speeds[0]
    # Repeated speeds are computed once.
    tunings, order = np.unique(speeds / float(model.speed(1.0)), return_inverse=True)
    direction = "up" if is_sweep_up else "down"
    curve = sweep(model, tunings, direction=direction, **observation.SETTLING_SWEEP)
    states = curve.final_state.values[order]
    maxima = curve.displacement_max.values[order].reshape(len(speeds), -1).T
    end = _jump_index(maxima, 0.0, 1 if is_sweep_up else -1)
    count = len(speeds) if end is None else end
    orbits = [
        observation.orbit_quantities(model, speeds[i], states[i], samples_per_period)
        for i in range(count)
    ]
    return orbits + [orbits[-1]] * (len(speeds) - count)
