"""`order_map`, `order_track`: orders of run-ups, Fourier integrals over whole revolutions.

The shaft angle is known, so that no window and no leakage enter: in a run-up of a `GearPair` each
arc between switches and events is integrated over the angle to rounding. Elsewhere the samples of
the time course are summed over the angle, and every second of them tells the error.
"""

import itertools
import json
import math

import numpy as np

from gearlib import checks
from gearlib.analysis import order_slopes, sampled_signals
from gearlib.analysis.revolutions import Turning
from gearlib.analysis.steady_course import as_run_up
from gearlib.data.result import result_of_many
from gearlib.kernels.closed_form import course_orders
from gearlib.kernels.closed_form.mesh_constants import mesh
from gearlib.models import acceleration
from gearlib.models.pair import GearPair
from gearlib.models.propagators import courses
from gearlib.models.propagators.closed_form import ratios
from gearlib.models.propagators.course_slopes import loaded
from gearlib.parameters import declared

#: name -> what of the kernels it is.
_VARIABLES = {
    "displacement": course_orders.DISPLACEMENT,
    "velocity": course_orders.VELOCITY,
    "acceleration": course_orders.ACCELERATION,
    "dynamic_force": course_orders.FORCE,
}
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
#: Error of exact coefficients, of the root mean square: instants of a long run have such digits.
_ROUNDING = 1e-10


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
        Of `gearlib.run_up` with samples_per_period > 0, or of `gearlib.simulate`. One sample
        suffices for a `GearPair` under a load without ramps, whose motion is integrated in closed
        forms; else the samples are summed. Times and phases count from the first sample.
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
        checks.one_of("variable", variable, tuple(_VARIABLES))
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
    pair = pair_of(run)
    if pair is None:
        per = math.tau * (run.phase.size - 1) / float(run.phase[-1] - run.phase[0])
        if top > 0.25 * per * teeth:
            raise ValueError(
                f"highest = {top:g} is not allowed with {per:.4g} samples per mesh period: it must "
                f"be at most {0.25 * per * teeth:.4g}"
            )
        args = blocks, span, step, count
        phase, values = run.phase.values, run[variable].values
        found, squares, _ = summed(phase, values, *args)
        half = summed(phase[::2], values[::2], *args)[0]
        error = np.abs(found - half)
    else:
        found, squares = integrated(pair, run, variable, blocks, span, step, count)
        error = _ROUNDING * np.sqrt(squares)[:, None] * np.ones(found.shape)
    names = order_slopes.names_of(run, variable)
    if pair is None:
        names = tuple(name for name in names if name != "speed")
        slopes = [summed(phase, run[f"d_{variable}_d_{name}"].values, *args)[0] for name in names]
    elif names:
        shape = blocks, count, step
        slopes = order_slopes.exact(pair, run, names, _VARIABLES[variable], span, shape)
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
    ratio = float((phase[-1] - phase[0]) / angle)
    whole = round(ratio)
    teeth = float(whole) if abs(ratio - whole) < 1e-6 * ratio else ratio
    teeth = float(run.teeth) if "teeth" in run else teeth
    return np.array(json.loads(run.attrs["parameters"])["speed"]), teeth


def pair_of(run):
    """Return the `GearPair` of a run-up in closed forms, None where there is none."""
    values = json.loads(run.attrs.get("gear_pair", "{}"))
    loads = json.loads(run.attrs["parameters"])["load"]
    ramps = any(a[0] < b[0] and a[1] != b[1] for a, b in itertools.pairwise(loads))
    if values.keys() != declared(GearPair).keys() or ramps:
        return None
    return GearPair(**{name: float(x) if x == "inf" else x for name, x in values.items()})


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


def integrated(pair, run, variable, blocks, span, step, count):
    """Return (coefficients, mean squares) of a `GearPair` as of `summed`, in SI."""
    asked = json.loads(run.attrs["parameters"])
    speeds, loads = np.array(asked["speed"]), np.array(asked["load"])
    omega, length = float(pair.mesh_frequency(1.0)), pair.static_deflection
    constants, push = mesh(ratios(pair), 1.0), 0.0
    if asked["driven_mass"]:
        push = float(acceleration.of_mesh(pair, asked["driven_mass"], asked["base_radius"])[0])
    phase = run.phase.values
    at = np.abs(phase - math.tau * np.rint(phase / math.tau)) <= _CLOSE
    names = ("time", "phase", "displacement", "velocity")
    starts = np.stack([run[name].values[at] for name in names], -1)
    names = ("event_time", "event_from", "event_to", "event_velocity")
    events = np.stack([run[name].values.astype(float) for name in names], -1)
    for table in (starts, events):
        table[:, 0] *= omega
        table[:, 3] /= length * omega
    starts[:, 2] /= length
    contact = float(events[0, 1]) if len(events) else float(run.contact.values[0])
    sums, squares = np.zeros((blocks, 2, count)), np.zeros(blocks)
    natural = math.sqrt(max(constants.high.square, constants.low.square))
    state, what = starts[0, 2:], _VARIABLES[variable]
    for piece in courses.pieces_of(pair, speeds, loads):
        breaks, contact = _breaks(constants, piece, starts, events, contact)
        breaks[0, [course_orders.X, course_orders.V]] = state
        breaks[0, course_orders.KNOWN] = 1.0
        middle = breaks[:-1, course_orders.PHASE] + 0.5 * np.diff(breaks[:, course_orders.PHASE])
        rows = np.floor(middle / span).astype(int)
        rows[rows >= blocks] = -1
        breaks[:-1, course_orders.PHASE] -= np.maximum(rows, 0) * span
        state = course_orders.add_waves(
            loaded(constants, piece.load + push * piece.acceleration),
            (piece.speed, piece.acceleration, natural),
            breaks,
            rows,
            what,
            step,
            order_slopes.rules(),
            sums,
            squares,
        )
    force = pair.scales()["force_scale"]
    scale = (length, length * omega, length * omega**2, force)[what]
    return scale / span * (sums[:, 0] + 1j * sums[:, 1]), scale**2 / span * squares


def _breaks(m, piece, starts, events, contact):
    """Return (breaks of a piece as of `course_orders.add_waves`, the contact at its end)."""
    end = piece.start + piece.length
    last = float(piece.by(end)[1])
    first, half = int(piece.phase / math.tau), m.half_high
    turns = math.tau * np.arange(first - 1, int(last / math.tau) + 2)
    switches = np.sort(np.concatenate([turns - half, turns + half]))
    # A stiffness of one level has none.
    inside = (switches > piece.phase) & (switches < last) & (0.0 < half) & (half < math.pi)
    switches = switches[inside]
    passed = switches - piece.phase
    switched = piece.start + 2.0 * passed / (piece.speed + piece.speed_at(switches))
    own = starts[(starts[:, 1] > piece.phase) & (starts[:, 1] < last)]
    met = events[(events[:, 0] >= piece.start) & (events[:, 0] < end)]
    rows = np.zeros((len(own) + len(switched) + len(met) + 2, course_orders.BREAK_COLUMNS))
    rows[0, :2], rows[-1, :2] = (piece.start, piece.phase), (end, last)
    i, j = 1 + len(own), 1 + len(own) + len(switched)
    rows[1:i, [0, 1, 3, 4]], rows[1:i, 2] = own, 1.0
    rows[i:j, 0], rows[i:j, 1] = switched, switches
    coast = (met[:, 1:3] < 0.0).any(axis=1)
    rows[j:-1, :4] = np.stack(
        [met[:, 0], piece.by(met[:, 0])[1], np.ones(len(met)), np.where(coast, -m.gap, 0.0)], -1
    )
    rows[j:-1, 4] = met[:, 3]
    which = np.full(len(rows), -1)
    which[j:-1] = np.arange(len(met))
    order = np.argsort(rows[:, 0], kind="stable")
    rows, which = rows[order], np.maximum.accumulate(which[order])
    rows[:, course_orders.CONTACT] = np.append(contact, met[:, 2])[which + 1]
    middle = (rows[:-1, 1] + 0.5 * np.diff(rows[:, 1])) % math.tau
    rows[:-1, course_orders.LEVEL] = (middle <= half) | (middle >= math.tau - half)
    return rows, float(rows[-1, course_orders.CONTACT])
