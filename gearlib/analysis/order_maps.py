"""`order_map`, `order_track`: orders of run-ups, Fourier integrals over whole revolutions.

The shaft angle is known, so that no window and no leakage enter: each arc of a run-up between
switches and events is integrated over the angle to rounding, see `course_orders`. Elsewhere the
samples of the time course are summed over the angle, and every second of them tells the error.
"""

import json
import math

import numpy as np

from gearlib import checks
from gearlib.analysis import course_orders, order_slopes, sampled_signals
from gearlib.analysis.revolutions import Turning
from gearlib.analysis.steady_course import as_run_up
from gearlib.data.result import result_of_many

#: What an amplitude is, for orders above 0, in terms of a Fourier coefficient.
_AMPLITUDES = {
    "rms": lambda c: math.sqrt(2.0) * c,
    "peak": lambda c: 2.0 * c,
    "power": lambda c: 2.0 * c**2,
}
#: Highest mesh order by default.
_MESH_ORDERS = 5
#: Phases closer than this are one.
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
):
    """Return how strong the orders of a run-up are, block of revolutions by block.

    Parameters
    ----------
    run : xarray.Dataset
        Of `gearlib.run_up` with samples_per_period > 0, or of `gearlib.simulate`. Of a run-up one
        sample suffices: each arc is integrated, to rounding, from a second run. Samples are summed
        of a `LoadSharingPair`, of quadratic damping, of `gearlib.simulate` where a model has more
        than one degree of freedom. Times and phases count from the first sample.
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

    Returns
    -------
    xarray.Dataset
        Over ``time`` (s, the middle of each block of whole revolutions) and ``order`` (waves per
        revolution of the gear whose teeth count): amplitude, phase (rad, of a cosine of order times
        the shaft angle from the start of the run), of trains over ``mesh`` too;
        amplitude_error, an estimate; over ``time``: rpm, the mean speed, and overall, the root mean
        square of all without the mean. Scalars order_resolution and teeth. Of a run with
        `sensitivities` also d_amplitude_d_<parameter> and d_phase_d_<parameter>; where samples are
        summed, not by "speed".

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    needed, begins = {variable, "time", "speed", "phase"}, 0.0
    checks.one_of("amplitude", amplitude, tuple(_AMPLITUDES))
    teeth = checks.integer("teeth", teeth, 1)
    run = as_run_up(run)
    if sampled_signals.is_sampled(run):
        given = {"tacho": tacho, "teeth": teeth}
        run, most, begins = sampled_signals.at_equal_angles(run, variable, highest, **given)
        highest = most if highest is None else highest
    else:
        checks.one_of("variable", variable, tuple(course_orders.VARIABLES))
        if tacho is not None:
            raise checks.refusal("tacho", tacho, "None for a run-up, whose shaft angle is known")
    if not needed <= set(getattr(run, "variables", ())) or "time" not in run.sizes:
        shown = run.attrs.get("title", type(run).__name__) if hasattr(run, "attrs") else run
        words = "a dataset of gearlib.run_up with samples_per_period, or of gearlib.simulate"
        raise checks.refusal("run", shown, words)
    if int(run.status):
        raise ValueError(f"run is not allowed: {run.status.attrs['message']}")
    resolution = checks.number(
        "resolution", resolution, "a finite number > 0 and <= 1", lambda x: 0.0 < x <= 1.0
    )
    revolutions = math.ceil(1.0 / resolution - 1e-12)
    speeds, teeth = _course(run)
    span = math.tau * teeth * revolutions
    turned = math.pi / 30.0 * np.trapezoid(speeds[:, 1], speeds[:, 0]) / math.tau
    blocks = int(turned / revolutions + _CLOSE)
    if blocks < 1:
        raise ValueError(
            f"resolution = {resolution!r} is not allowed for this run: a block must have "
            f"{revolutions} whole revolutions, and the run has {turned:.4g}"
        )
    top = _MESH_ORDERS * teeth if highest is None else highest
    top = checks.finite_positive("highest", top)
    count, step = int(top * revolutions + 1e-9) + 1, 1.0 / (teeth * revolutions)
    names, model = order_slopes.names_of(run, variable), course_orders.of_run(run)
    known = order_slopes.known(model, run, variable, names)
    if model is None or (names and not known):
        per = math.tau * (run.phase.size - 1) / float(run.phase[-1] - run.phase[0])
        if top > 0.25 * per * teeth:
            raise ValueError(
                f"highest = {top:g} is not allowed with {per:.4g} samples per mesh period: it must "
                f"be at most {0.25 * per * teeth:.4g}"
            )
    args = blocks, span, step, count
    if model is None:
        phase, values = run.phase.values, run[variable].values
        found, squares, _ = summed(phase, values, *args)
        half = summed(phase[::2], values[::2], *args)[0]
        error = np.abs(found - half)
    else:
        found, squares, error = course_orders.integrals(
            model, run, course_orders.VARIABLES[variable], *args
        )
    if names and not known:
        names = tuple(name for name in names if name != "speed")
        of_names = (run[f"d_{variable}_d_{name}"].values for name in names)
        slopes = [summed(run.phase.values, one, *args)[0] for one in of_names]
    elif names:
        shape = blocks, count, step
        slopes = order_slopes.exact(model, run, names, variable, span, shape)
    order, size = np.arange(count) / revolutions, np.abs(found)
    above = (order > 0.0).reshape(1, -1, *[1] * (size.ndim - 2))
    mean = size**2 if amplitude == "power" else size
    unit, words = run[variable].attrs["units"], variable.replace("_", " ")
    squared = f"({unit})2" if " " in unit else f"{unit}2"
    own, inner = squared if amplitude == "power" else unit, run[variable].dims[1:]
    bounds = Turning(speeds).at(revolutions * np.arange(blocks + 1.0))[0]
    times, rpm = 0.5 * (bounds[1:] + bounds[:-1]), 60.0 * revolutions / np.diff(bounds)
    noise = np.sqrt(np.maximum(squares - size[:, 0] ** 2, 0.0))
    columns = {
        "amplitude": (
            np.where(above, _AMPLITUDES[amplitude](size), mean),
            own,
            f"{amplitude} of the orders of the {words}",
        ),
        "phase": (np.angle(found), "rad", "of a cosine of the order times the shaft angle"),
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
    if names:
        data |= order_slopes.variables(run, variable, names, found, slopes, amplitude)
    coords = {
        "time": ("time", times + begins, {"units": "s", "long_name": "middle of the block"}),
        "order": ("order", order, {"units": "1", "long_name": "order, waves per revolution"}),
    }
    coords |= {name: run[name].variable for name in inner}
    title, by = f"Order map of the {words}", "Fourier integrals over the shaft angle"
    kept = {
        k: run.attrs[k]
        for k in ("references", "gear_pair", "model", "parameters")
        if k in run.attrs
    }
    return result_of_many(title, data, coords, by, variable=variable, amplitude=amplitude, **kept)


def order_track(run, orders, **options):
    """Return single orders of a run-up over its speed.

    Parameters
    ----------
    run : xarray.Dataset
        Of `order_map`, or of `gearlib.run_up` or `gearlib.simulate`, of which it is made.
    orders : sequence of float
        Orders of the map.
    **options
        As of `order_map`.

    Returns
    -------
    xarray.Dataset
        As of `order_map`, of these orders.

    Raises
    ------
    ValueError
        If an order is none of the map.
    """
    orders = checks.sequence("orders", orders)
    checks.require(orders, "orders", orders, "a list of at least one entry")
    orders = [checks.finite_nonnegative(f"orders[{i}]", one) for i, one in enumerate(orders)]
    if "order" not in getattr(run, "sizes", ()):
        run = order_map(run, **({"highest": max(orders) + 0.5} | options))
    elif options:
        raise checks.refusal(next(iter(options)), next(iter(options.values())), "left to the map")
    own = run.order.values
    at = [int(np.abs(own - one).argmin()) for one in orders]
    for one, i in zip(orders, at, strict=True):
        if abs(own[i] - one) > 1e-9 * max(one, 1.0):
            raise ValueError(
                f"orders = {one!r} is not allowed: it must be one of 0, "
                f"{float(run.order_resolution):.4g}, ..., {own[-1]:.4g}"
            )
    return run.isel(order=at)


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


def summed(phase, values, blocks, span, step, count):
    """Return Fourier coefficients of samples by trapezia over the phase, block by block.

    Parameters
    ----------
    phase : ndarray, shape (n,)
        From 0 on, rising.
    values : ndarray, shape (n, ...)
    blocks : int
    span, step : float
        Of the phase: a block, and the wave number of the first order.
    count : int
        Orders, from 0.

    Returns
    -------
    coefficients : ndarray, shape (blocks, count, ...)
    squares : ndarray, shape (blocks, ...)
        Means of the squares.
    shares : ndarray, shape (blocks,)
        Sums of the squares of the weights of samples: what noise is lowered by.
    """
    shape = (blocks, count, *values.shape[1:])
    found, squares = np.zeros(shape, complex), np.zeros((blocks, *values.shape[1:]))
    shares, base = np.zeros(blocks), np.arange(math.isqrt(count - 1) + 1)
    large = np.arange(0, count, base.size)
    for k in range(blocks):
        i, j = np.searchsorted(phase, (k * span - _CLOSE, (k + 1) * span - _CLOSE))
        own, part = phase[i:j] - k * span, values[i:j]
        # The next block begins where this one ends, or the run is over.
        last = values[j] if j < len(values) else values[j - 1]
        own, part = np.append(own, span), np.concatenate([part, last[None]])
        share = np.gradient(own, edge_order=1)
        share[[0, -1]] *= 0.5
        part, share = part.reshape(own.size, -1), share / span
        # Waves of the order a n + b are products of two; BLAS would wake threads for small sums.
        low, high = (np.exp(-1j * step * np.outer(few, own)) for few in (base, large))
        sums = np.einsum("aim,bi->abm", high[:, :, None] * (share[:, None] * part), low)
        found[k] = sums.reshape(-1, part.shape[1])[:count].reshape(found[k].shape)
        squares[k] = np.einsum("i,im->m", share, part**2).reshape(squares[k].shape)
        shares[k] = share @ share
    return found, squares, shares
