"""`order_map`: orders of run-ups; `orders`: of runs at constant speed, over whole mesh periods.

The shaft angle is known, so that no window and no leakage enter. The samples of the time course are
summed over the angle, see `order_sums`, and every second of them tells the error.
"""

import json
import math

import numpy as np

from gearlib import checks
from gearlib.analysis.order_sums import (
    STENCIL,
    Turning,
    as_run_up,
    at_equal_angles,
    is_sampled,
    jump_phases,
    summed,
)
from gearlib.data.result import result_of_many
from gearlib.models.harmonics import Harmonics

#: What an amplitude is, for orders above 0, in terms of a Fourier coefficient.
_AMPLITUDES = {
    "rms": lambda c: math.sqrt(2.0) * c,
    "peak": lambda c: 2.0 * c,
    "power": lambda c: 2.0 * c**2,
}
#: Highest mesh order by default.
_MESH_ORDERS = 5
#: Variables of a run that have orders.
VARIABLES = "displacement", "velocity", "acceleration", "dynamic_force"
#: Largest change of a coefficient with half of the samples, of the root mean square.
MAX_CHANGE = 0.05
#: Revolutions closer than this count as equal.
_CLOSE = 1e-9


def order_map(
    run,
    *,
    variable="displacement",
    resolution=1.0,
    highest=None,
    amplitude="rms",
    tacho=None,
    teeth=1,
    orders=None,
):
    """Return how strong the orders of a run-up are, block of revolutions by block.

    Parameters
    ----------
    run : xarray.Dataset
        Of `gearlib.run_up` with samples_per_period, or of `gearlib.simulate`. Its samples are
        summed: with 128 in a mesh period the error is about 1e-6 of the largest amplitude of the
        displacement, 1e-4 of that of the force, which jumps where the stiffness does. Times and
        phases count from the first sample.
        Or any signal over ``time`` (s) with ``speed`` (min-1), as of `gearlib.read_measured`: it is
        interpolated at equal angles, by cubic splines.
    variable : {"displacement", "velocity", "acceleration", "dynamic_force"}
        Of a signal its name.
    resolution : float, default 1
        Distance of orders, > 0 and <= 1: a block has as many revolutions as it takes, so that the
        distance obtained, ``order_resolution``, is 1 over a whole number.
    highest : float, optional
        Highest order; by default 5 per tooth, of a signal the highest with four samples a wave.
    amplitude : {"rms", "peak", "power"}
        Of a sine: its root mean square, its amplitude, its mean square. Order 0 is the mean, or its
        square.
    tacho : sequence of float, optional
        Of a signal without speed: times of pulses, one a revolution, s.
    teeth : int, default 1
        Of a signal: mesh periods in a revolution.
    orders : sequence of float, optional
        Single orders, multiples of the distance of orders; by default all up to the highest.

    Returns
    -------
    xarray.Dataset
        Over ``time`` (s, the middle of each block of whole revolutions) and ``order`` (waves per
        revolution of the gear whose teeth count): amplitude, phase (rad, of a cosine of order times
        the shaft angle from the start of the run), of trains over ``mesh`` too;
        amplitude_error, an estimate; over ``time``: rpm, the mean speed, and overall, the root mean
        square of all without the mean. Scalars order_resolution and teeth.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range; or if a coefficient changes by more
        than 5 % of the root mean square when every second sample is left out.
    """
    begins, signal = 0.0, False
    checks.one_of("amplitude", amplitude, tuple(_AMPLITUDES))
    teeth = checks.integer("teeth", teeth, 1)
    if orders is not None:
        orders = [checks.finite_nonnegative("orders", order) for order in orders]
        checks.require(orders, "orders", orders, "a list of at least one entry")
        highest = max(*orders, resolution) if highest is None else highest
    run = as_run_up(run)
    if is_sampled(run):
        given, signal = {"tacho": tacho, "teeth": teeth}, True
        run, most, begins = at_equal_angles(run, variable, highest, **given)
        highest = most if highest is None else highest
    else:
        _check_run(run, variable, tacho)
    resolution = checks.number(
        "resolution", resolution, "a finite number > 0 and <= 1", lambda x: 0.0 < x <= 1.0
    )
    revolutions = math.ceil(1.0 / resolution - 1e-12)
    speeds, teeth = _course(run)
    turned = math.pi / 30.0 * np.trapezoid(speeds[:, 1], speeds[:, 0]) / math.tau
    blocks = int(turned / revolutions + _CLOSE)
    if blocks < 1:
        raise ValueError(
            f"resolution = {resolution!r} is not allowed for this run: a block must have "
            f"{revolutions} whole revolutions, and the run has {turned:.4g}"
        )
    top = _MESH_ORDERS * teeth if highest is None else highest
    top = checks.finite_positive("highest", top)
    check_density(run.phase.values, top, teeth)
    count = int(top * revolutions + 1e-9) + 1
    sums = _block_sums(run, variable, teeth, blocks, revolutions, count, signal)
    number = np.arange(count)
    if orders is not None:
        number = np.array([_number(order, revolutions, count) for order in orders])
    bounds = begins + Turning(speeds).at(revolutions * np.arange(blocks + 1.0))[0]
    return _dataset(run, variable, amplitude, sums, number, revolutions, bounds, teeth)


def _check_run(run, variable, tacho):
    """Check that a dataset is a run whose samples have orders."""
    checks.one_of("variable", variable, VARIABLES)
    if tacho is not None:
        raise checks.refusal("tacho", tacho, "None for a run-up, whose shaft angle is known")
    needed = {variable, "time", "speed", "phase"}
    if not needed <= set(getattr(run, "variables", ())) or "time" not in run.sizes:
        shown = run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run
        words = "a dataset of gearlib.run_up with samples_per_period, or of gearlib.simulate"
        raise checks.refusal("run", shown, words)
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")


def samples_per_period(phase):
    """Return how many samples a mesh period has, most of the time."""
    return round(math.tau / float(np.median(np.diff(phase)))) if phase.size > 1 else 1


def check_density(phase, highest, teeth):
    """Refuse orders that have fewer than four samples in a wave."""
    per = samples_per_period(phase)
    if highest > 0.25 * per * teeth * (1.0 + _CLOSE):
        raise ValueError(
            f"highest = {highest:g} is not allowed with samples_per_period = {per}: it must be "
            f"at most {0.25 * per * teeth:.4g}, orders with four samples a wave"
        )


def _block_sums(run, variable, teeth, blocks, revolutions, count, signal):
    """Return (coefficients, mean squares, changes with half of the samples) of all blocks.

    Nobody knows where a measured signal jumps, and noise changes it: its changes are not refused.
    """
    phase, values = run.phase.values, run[variable].values
    block = blocks, math.tau * teeth * revolutions, 1.0 / (teeth * revolutions), count
    # The displacement and its rate by time are continuous.
    jumps = None if signal else np.empty(0)
    if not signal and variable in ("acceleration", "dynamic_force"):
        jumps = jump_phases(run, teeth)
    sums, squares = summed(phase, values, *block, jumps)
    change = np.abs(sums - summed(phase[::2], values[::2], *block, jumps)[0])
    if not signal:
        check_change(change, squares, phase)
    return sums, squares, change


def check_change(change, squares, phase):
    """Refuse samples whose every second one gives other orders."""
    size = math.sqrt(squares.max())
    if change.max() > MAX_CHANGE * size:
        per = samples_per_period(phase)
        raise ValueError(
            f"samples_per_period = {per} is not allowed for these orders: with half of the samples "
            f"one changes by {change.max() / size:.2g} of the root mean square, and it must be at "
            f"most {MAX_CHANGE:g}"
        )


def _number(order, revolutions, count):
    """Return the number of an order in a map."""
    number = round(order * revolutions)
    if abs(number - order * revolutions) > 1e-9 * max(order, 1.0) or number >= count:
        raise ValueError(
            f"orders = {order!r} is not allowed: it must be one of 0, "
            f"{1.0 / revolutions:.4g}, ..., {(count - 1) / revolutions:.4g}"
        )
    return number


def _dataset(run, variable, amplitude, sums, number, revolutions, bounds, teeth):
    """Return the order map of the orders with these numbers."""
    coefficients, squares, error = sums
    noise = np.sqrt(np.maximum(squares - np.abs(coefficients[:, 0]) ** 2, 0.0))
    coefficients, error = coefficients[:, number], error[:, number]
    size = np.abs(coefficients)
    above = (number > 0).reshape(1, -1, *[1] * (size.ndim - 2))
    mean = size**2 if amplitude == "power" else size
    unit, words = run[variable].attrs["units"], variable.replace("_", " ")
    squared = f"({unit})2" if " " in unit else f"{unit}2"
    amplitude_unit = squared if amplitude == "power" else unit
    inner = run[variable].dims[1:]
    times, rpm = 0.5 * (bounds[1:] + bounds[:-1]), 60.0 * revolutions / np.diff(bounds)
    columns = {
        "amplitude": (
            np.where(above, _AMPLITUDES[amplitude](size), mean),
            amplitude_unit,
            f"{amplitude} of the orders of the {words}",
        ),
        "phase": (np.angle(coefficients), "rad", "of a cosine of the order times the shaft angle"),
        "amplitude_error": (np.where(above, 2.0, 1.0) * error, unit, "estimated error, of a peak"),
    }
    over = {"units": unit, "long_name": f"root mean square of the {words} without its mean"}
    data = {
        name: (("time", "order", *inner), values, {"units": cf, "long_name": said})
        for name, (values, cf, said) in columns.items()
    }
    data |= {
        "rpm": (("time",), rpm, {"units": "min-1", "long_name": "mean speed in the block"}),
        "overall": (("time", *inner), noise, over),
        "order_resolution": ((), 1.0 / revolutions, {"units": "1", "long_name": "order spacing"}),
        "teeth": ((), teeth, {"units": "1", "long_name": "mesh periods in a revolution"}),
    }
    about = {"units": "1", "long_name": "order, waves per revolution"}
    coords = {
        "time": ("time", times, {"units": "s", "long_name": "middle of the block"}),
        "order": ("order", number / revolutions, about),
    }
    coords |= {name: run[name].variable for name in inner}
    title, by = f"Order map of the {words}", "Fourier sums over the shaft angle"
    kept = {
        k: run.attrs[k]
        for k in ("references", "gear_pair", "model", "parameters")
        if k in run.attrs
    }
    return result_of_many(title, data, coords, by, variable=variable, amplitude=amplitude, **kept)


def _course(run):
    """Return (rows of s and rpm, mesh periods a revolution)."""
    speed, t, phase = (run[name].values for name in ("speed", "time", "phase"))
    angle = math.pi / 60.0 * ((speed[1:] + speed[:-1]) * np.diff(t)).sum()
    # Of one sample no ratio is known: that run has no block either.
    ratio = float((phase[-1] - phase[0]) / angle) if angle > 0.0 else 1.0
    whole = round(ratio)
    teeth = float(whole) if abs(ratio - whole) < 1e-6 * ratio else ratio
    teeth = float(run.teeth) if "teeth" in run else teeth
    return np.array(json.loads(run.attrs["parameters"])["speed"]), teeth


def orders(run, *, count=None):
    """Return the order spectrum of the mesh force and of the transmission error of a run.

    Parameters
    ----------
    run : xarray.Dataset
        Of `gearlib.simulate`; its record has to hold whole revolutions, or whole orbits.
    count : int, optional
        Highest mesh order; by default 10, at most a quarter of the samples per period.

    Returns
    -------
    xarray.Dataset
        Over ``order`` (per revolution of the gear whose teeth count, from 0): mesh_order (order
        over teeth), force_amplitude (N, peak; the mean at order 0), force_phase,
        error_amplitude (m) and error_phase (rad; of a cosine of the mesh phase times the mesh
        order), force_amplitude_error and error_amplitude_error, estimates and no bounds: the
        difference that every second sample makes; mean squares. Of a train over ``mesh`` too.

    Raises
    ------
    ValueError
        If the run could not go on, has no whole revolutions, or a coefficient changes by more than
        5 % of the root mean square when every second sample is left out.
    """
    names = {"phase", "displacement", "dynamic_force", "mesh_frequency"}
    if not names <= set(getattr(run, "variables", ())):
        shown = run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run
        raise checks.refusal("run", shown, "a dataset of gearlib.simulate, of gears that turn")
    return spectrum(run, count)


def spectrum(run, count=None, mesh_orders=False):
    """Return what `orders` does, or of the multiples of the mesh frequency only.

    Of the latter those that change too much are nan.
    """
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")
    asked = json.loads(run.attrs["parameters"])
    periods, samples = asked["record_periods"], run.phase.size
    teeth = round(float(run.mesh_frequency) * 60.0 / (math.tau * float(run.speed)))
    orbit = int(run.period)
    if periods % teeth and not (orbit and periods % orbit == 0):
        raise ValueError(
            f"record_periods = {periods} is not allowed: it must be a multiple of {teeth}, whole "
            "revolutions of the gear whose teeth count"
            + (f", or of the {orbit} periods of the orbit" if orbit else "")
        )
    most = max(samples // periods // 4, 1)
    count = checks.integer("count", min(10, most) if count is None else count, 1, most)
    fractions = 1 if mesh_orders else periods
    harmonics = np.arange(count * fractions + 1)
    dims = ("order", *run.displacement.dims[1:])
    shape = -1, *[1] * (len(dims) - 1)
    # A period that begins later turns the phases only: they count from the mesh phase 0.
    turn = np.exp(-1j * harmonics / fractions * float(run.phase[0])).reshape(shape)
    peak = np.where(harmonics > 0, 2.0, 1.0).reshape(shape)
    grid, repeats = (1.0 / fractions, harmonics.size), orbit and periods % orbit == 0
    force = run.dynamic_force.values * float(run.force_scale)
    error = transmission_error(run) * float(run.static_deflection)
    jumps = jump_phases(as_run_up(run), teeth)
    data: dict = {"mesh_order": ("order", harmonics / fractions)}
    for name, values, phases in (("force", force, jumps), ("error", error, np.empty(0))):
        sums, change, squares = _record_sums(
            run.phase.values, values, phases, periods, grid, repeats
        )
        if mesh_orders:
            sums[change > MAX_CHANGE * math.sqrt(squares.max())] = math.nan
        else:
            check_change(change, squares, run.phase.values)
        data[f"{name}_amplitude"] = dims, peak * np.abs(sums)
        data[f"{name}_phase"] = dims, np.angle(sums * turn)
        data[f"{name}_amplitude_error"] = dims, peak * change
        data[f"mean_square_{name}"] = dims[1:], (values**2).mean(axis=0)
    for name in ("tuning", "speed", "mesh_frequency", "period"):
        data[name] = run[name].values
    coords = {"order": harmonics * teeth / fractions}
    coords |= {name: run[name].values for name in dims[1:]}
    dataset = result_of_many("Order spectrum of a gear mesh", data, coords, "Fourier sums")
    dataset["order"].attrs["long_name"] = (
        "order, waves per revolution of the gear whose teeth count"
    )
    kept = ("references", "gear_pair", "parameters")
    dataset.attrs |= {name: run.attrs[name] for name in kept if name in run.attrs}
    return dataset


def transmission_error(run):
    """Return the transmission error at the samples, static deflections.

    Displacements of models with deviations of the flanks are those of the flanks.
    """
    x = run.displacement.values
    model = json.loads(run.attrs.get("gear_pair") or run.attrs["model"])
    given = model.get("deviation") if "profile" in model else None
    if not given:
        return x
    phase, scale = run.phase.values, 1.0 / run.static_deflection.item()
    waves = Harmonics(given["cosines"], given["sines"]).table(scale)
    return x - sum(c * np.cos(k * phase) + s * np.sin(k * phase) for k, c, s in waves)


def _record_sums(phase, values, jumps, periods, grid: tuple[float, int], repeats):
    """Return (Fourier coefficients of a record, their changes with half of them, mean squares).

    grid: step of the mesh orders and their number.
    """
    phase, span = phase - phase[0], math.tau * periods

    def coefficients(step):
        at, record = phase[::step], values[::step]
        if repeats:
            # An orbit goes on behind the record, and before it, as in it.
            at = np.concatenate([at[-STENCIL:] - span, at, at[:STENCIL] + span])
            record = np.concatenate([record[-STENCIL:], record, record[:STENCIL]])
        sums, squares = summed(at, record, 1, span, *grid, jumps)
        return sums[0], squares

    sums, squares = coefficients(1)
    return sums, np.abs(sums - coefficients(2)[0]), squares
