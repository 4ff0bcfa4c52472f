"""Time courses as observations: mesh orders at constant speed, and of run-ups with their jumps.

Regressions take the complex amplitudes of the mesh orders from the samples of each revolution, so
offset and eccentricity do not enter. A course begins at the mesh phase ``known.phase`` (rad), 0
where nothing is said.
"""

import json
import math
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.analysis.order_maps import Turning
from gearlib.runs.run_up import run_up, speeds_of
from gearlib.runs.sweeping import sweep
from gearlib.uncertainty.observation import (
    JUMP_SHARE,
    ORDER,
    SETTLING,
    START_REFUSAL,
    Channel,
    Curve,
    Observation,
    at_speed,
)

#: How a speed was reached -> direction of the sweep, its first speed as a share, number of speeds.
_SWEEPS = {0: ("cold", 1.0, 1), 1: ("up", 0.5, 40), -1: ("down", 1.6, 40)}
#: Mesh orders of a time course that are compared.
ORDERS = 4
_ORDER_NUMBERS = np.arange(1, ORDERS + 1)
#: Orders of the shaft that are regressed beside them, and least samples for each mesh order.
_SHAFT_ORDERS, _LEAST_SAMPLES = 3, 2.5
#: Samples of the model in a mesh period: at constant speed, and in a run-up.
_STEADY_SAMPLES, _RUN_UP_SAMPLES = 512, 32
#: Points of a mesh period that is drawn.
_DRAWN_POINTS = 200
#: Phases closer than this count as equal.
_SAME_PHASE = 1e-9
#: Revolutions of a run-up that are left out: at the start, before a jump and behind it.
_FIRST, _BEFORE, _BEHIND = 6, 4, 24
#: Arguments of `run_up` that ``known.options`` may have.
_RUN_UP_OPTIONS = ("load", "driver", "driven_mass", "base_radius", "initial_state")


def courses_of(model: Any, data: Any, mesh: int) -> list[Observation]:
    """Return the observations of time courses: each condition is a course of its own."""
    parts = [data]
    if "condition" in data.coords:
        names = data.condition.values
        parts = [data.isel(sample=names == name) for name in dict.fromkeys(names.tolist())]
    steady = ["speed" in part.coords and np.ptp(part.speed.values) == 0.0 for part in parts]
    if len(parts) > 1 and not all(steady):
        raise ValueError(
            f"data has {len(parts)} conditions with time courses: each must have one speed; "
            "give run-ups as sets of their own"
        )
    return [
        (_of_steady if still else _of_run_up)(model, part, mesh)
        for part, still in zip(parts, steady, strict=True)
    ]


def _facts(data: Any) -> dict:
    """Return what is known of a rig."""
    text = data.attrs.get("known", "{}")
    try:
        facts = json.loads(text)
    except (TypeError, ValueError):
        facts = None
    checks.require(isinstance(facts, dict), "known", text, "a mapping as a text, of json.dumps")
    return facts


def _course_of(facts: dict) -> tuple[list, dict]:
    """Return the course of a run-up, rows of s and rpm, and its other arguments."""
    if "course" not in facts:
        raise ValueError(
            "known.course is missing: a run-up needs its course of speed, rows of s and rpm"
        )
    options = facts.get("options", {})
    checks.require(isinstance(options, dict), "known.options", options, "a mapping")
    for name in options:
        checks.one_of("known.options", name, _RUN_UP_OPTIONS)
    try:
        return speeds_of(speed=facts["course"]).tolist(), options
    except ValueError as error:
        raise ValueError(f"known.course: {error}") from None


def _signal(model: Any, data: Any) -> tuple[np.ndarray, np.ndarray, float]:
    """Return a displacement, the shift of a model's mesh orders, and mesh periods a revolution."""
    phase = _facts(data).get("phase", 0.0)
    phase = checks.number("known.phase", phase, "a number in rad", np.isfinite)
    values = np.asarray(data.displacement.values, float)
    checks.require((np.diff(data.time.values) > 0.0).all(), "time", "unsorted", "rising")
    checks.require(np.ptp(values) > 0.0, "displacement", float(values[0]), "no constant")
    teeth = checks.number(
        "mesh periods of a revolution",
        round(model.periods_per_revolution, 9),
        "a whole number, as of a train whose carrier stands",
        float.is_integer,
    )
    return values, np.exp(1j * phase * _ORDER_NUMBERS), teeth


def _channel(kind: str, displacement: Any, orders: np.ndarray, share: np.ndarray) -> Channel:
    """Return the channel of mesh orders; `share` lowers the variance of the displacement."""
    noise = float(displacement.attrs.get("noise_std", 0.0))
    size = (noise or float(np.std(displacement.values))) * np.sqrt(0.5 * share)
    values = _flat(orders)
    return Channel(
        kind,
        values,
        np.repeat(size, 2 * ORDERS),
        bool(noise),
        unknown_gain=bool(displacement.attrs.get("unknown_gain", 0)),
        sequences=np.arange(values.size).reshape(-1, 2 * ORDERS).T,
    )


def _flat(orders: np.ndarray) -> np.ndarray:
    """Return real and imaginary parts of mesh orders, one after the other."""
    return np.ascontiguousarray(orders).view(float).ravel()


def _of_steady(model: Any, data: Any, mesh: int) -> Observation:
    """Return the observation of a time course at constant speed, the mesh orders of its orbit."""
    (values, shift, teeth), speed = _signal(model, data), float(data.speed.values[0])
    checks.require(speed > 0.0, "speed", speed, "> 0")
    way = int(data.direction.values[0]) if "direction" in data.coords else 0
    direction, first, count = _SWEEPS[way]
    # The phase that is known is that at the time 0.
    turns = data.time.values * speed / 60.0
    bounds = np.array([turns[0], np.nextafter(turns[-1], np.inf)])
    channel = _channel("time course", data.displacement, *regressed(turns, values, bounds, teeth))

    def predict(model: Any) -> tuple:
        tuning = speed / float(model.speed(1.0))
        tunings = np.sort(np.linspace(first * tuning, tuning, count))
        run = sweep(model, tunings, direction=direction, **SETTLING)
        state = run.final_state.values[0 if direction == "down" else -1]
        point = at_speed(model, speed, state, _STEADY_SAMPLES)
        orders = point[ORDER][1 : ORDERS + 1, mesh]
        return [_flat(orders * shift)], max(0.0, -point["displacement_min"].min())

    def draw(sensed: list) -> list:
        phase = np.linspace(0.0, 1.0, _DRAWN_POINTS)
        waves = np.exp(2j * np.pi * np.outer(phase, _ORDER_NUMBERS))
        heights = [2.0 * (waves @ x.view(complex)).real for x in (channel.values, sensed[0])]
        name, units = f"displacement at {speed:.5g} rpm", data.displacement.attrs.get("units", "m")
        return [Curve(name, units, "phase", phase, (*heights,), np.zeros(phase.size, bool))]

    return Observation("time course", [channel], predict, draw)


def _of_run_up(model: Any, data: Any, mesh: int) -> Observation:
    """Return the observation of a run-up: mesh orders of its revolutions, speeds of its jumps."""
    (values, shift, teeth), (rows, options) = _signal(model, data), _course_of(_facts(data))
    turning = Turning(rows)
    turns = turning.revolutions(data.time.values)
    blocks = _whole_revolutions(turning, rows, data.time.values, turns)
    measured, share, warning = _revolutions(turns, values, teeth, blocks)
    kept, heights, jumps = _parts(measured, share)
    speeds = turning.at(np.arange(blocks) + 0.5)[1]
    channels = [_channel("run-up", data.displacement, measured[kept], share[kept])]
    if jumps:
        places = np.array([0.5 * (speeds[i - 1] + speeds[i]) for i in jumps])
        widths = [_BEHIND * abs(speeds[i] - speeds[i - 1]) + 1e-9 for i in jumps]
        noise_known = channels[0].noise_known
        channels.append(Channel("jumps", places, np.array(widths), noise_known, joined=True))

    def predict(model: Any) -> tuple:
        run = run_up(model, speed=rows, samples_per_period=_RUN_UP_SAMPLES, **options)
        if int(run.status):
            raise NoOrbit(run.status.attrs["message"])
        displacement = run.displacement.values.reshape(run.sizes["time"], -1)[:, mesh]
        orders = _fourier(run.phase.values, displacement, blocks, math.tau * teeth)
        values = [_flat((orders * shift)[kept])]
        if jumps:
            levels = np.abs(orders[:, 0]) * (channels[0].sensed(values[0])[1] or 1.0)
            values.append(np.array([_crossing(levels, i, heights, speeds) for i in jumps]))
        least = run.displacement_min.values[:blocks]
        return values, max(0.0, -float(least[kept[: least.shape[0]]].min()))

    def draw(sensed: list) -> list:
        fitted = np.full(measured.shape, complex(np.nan))
        fitted[kept] = sensed[0].view(complex).reshape(-1, ORDERS)
        units, falls = data.displacement.attrs.get("units", "m"), np.gradient(speeds) < 0.0
        amplitudes = 2.0 * np.abs([measured.T, fitted.T])
        names = [f"order {k if k > 1 else ''}z" for k in _ORDER_NUMBERS]
        return [
            Curve(name, units, "speed", speeds, tuple(amplitudes[:, k]), falls)
            for k, name in enumerate(names)
        ]

    try:
        predict(model)
    except NoOrbit:
        raise ValueError(START_REFUSAL) from None
    return Observation("run-up", channels, predict, draw, warning)


def _revolutions(turns: np.ndarray, values: np.ndarray, teeth: float, blocks: int) -> tuple:
    """Return mesh orders of each revolution, NaN beside gaps, their share of noise, a warning."""
    bounds, count = np.arange(blocks + 1), blocks - _FIRST
    complete = complete_blocks(turns, bounds, teeth)
    allowed = f"of one without a gap behind the first {_FIRST}"
    gaps = f"of {count} revolutions with gaps"
    checks.require(complete[_FIRST:].any(), "time", gaps, allowed)
    orders, share = regressed(turns, values, bounds, teeth, complete)
    missing, warning = int(np.isnan(share[_FIRST:]).sum()), ""
    if missing:
        warning = (
            f"{missing} of {count} revolutions are left out of the run-up: they have gaps or too "
            "few samples"
        )
    return orders, share, warning


def _parts(orders: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray, list]:
    """Return which revolutions are compared, heights of their first order, and the jumps.

    Around a jump, where the deviations of a motion grow, nothing is compared but its speed.
    """
    present, numbers = np.isfinite(share), np.arange(share.size)
    kept = present & (numbers >= _FIRST)
    # A revolution without samples has the height of the one before it.
    last = np.maximum.accumulate(np.where(present, numbers, present.argmax()))
    heights = np.abs(orders[last, 0])
    steps, jumps = np.abs(np.log(heights[1:] / heights[:-1])), []
    for i in np.argsort(-steps):
        if steps[i] < JUMP_SHARE or i < _FIRST:
            break
        if all(abs(i + 1 - jump) > _BEHIND for jump in jumps):
            jumps.append(int(i + 1))
    for i in jumps:
        kept[max(i - _BEFORE, 0) : i + _BEHIND] = False
    return kept, heights, sorted(jumps)


def _whole_revolutions(turning: Turning, rows: list, times: np.ndarray, turns: np.ndarray) -> int:
    """Return how many whole revolutions a run-up has; refuse what is not within its course."""
    end, blocks = rows[-1][0], int(turns[-1])
    given = f"{times[0]:.6g} to {times[-1]:.6g} s"
    count = float(turning.revolutions(np.array([end]))[0])
    within = turns[0] < 1.0 and blocks <= count + 1e-9
    allowed = f"within known.course, 0 to {end:.6g} s, from its first revolution on"
    checks.require(within, "time", given, allowed)
    allowed = f"of more than {2 * _FIRST} whole revolutions of known.course, not {blocks}"
    checks.require(blocks > 2 * _FIRST, "time", given, allowed)
    return blocks


def _crossing(levels: np.ndarray, i: int, heights: np.ndarray, speeds: np.ndarray) -> float:
    """Return the speed at which a model jumps next to the revolution `i`, NaN if it does not.

    There its first mesh order, `levels`, crosses the middle of the measured `heights`.
    """
    before, behind = heights[i - _BEFORE], heights[min(i + _BEFORE, len(heights) - 1)]
    middle, rises = 0.5 * (before + behind), behind > before
    # On the same way, up or down: the half of the course in which the jump was.
    way = np.sign(np.gradient(speeds))
    fits = (levels > middle) == rises
    crossings = np.flatnonzero(fits[1:] & ~fits[:-1] & (way[1:] == way[i])) + 1
    if not crossings.size:
        return math.nan
    j = crossings[np.abs(crossings - i).argmin()]
    share = (middle - levels[j - 1]) / (levels[j] - levels[j - 1])
    return float(speeds[j - 1] + share * (speeds[j] - speeds[j - 1]))


def _fourier(phase: np.ndarray, values: np.ndarray, blocks: int, span: float) -> np.ndarray:
    """Return mesh orders, (blocks, ORDERS), of samples by the trapezoidal rule."""
    edges = span * np.arange(blocks + 1)
    # The last sample closes a course that ends before its last edge.
    phase, values = np.append(phase, max(phase[-1], edges[-1])), np.append(values, values[-1])
    waves = values * np.cumprod([np.exp(-1j * phase)] * ORDERS, axis=0)
    places = np.searchsorted(phase, edges - _SAME_PHASE)
    areas = 0.5 * (waves[:, 1:] + waves[:, :-1]) * np.diff(phase)
    return np.add.reduceat(areas[:, : places[-1]], places[:-1], axis=1).T / span


def complete_blocks(turns: np.ndarray, bounds: np.ndarray, teeth: float) -> np.ndarray:
    """Return which blocks, between two of the `bounds`, have no gap between their samples.

    A gap is longer than a mesh period, and than three steps between samples as a rule.
    """
    steps, complete = np.diff(turns), np.ones(len(bounds) - 1, bool)
    for i in np.flatnonzero(steps > max(1.0 / teeth, 3.0 * np.median(steps))):
        first, last = np.searchsorted(bounds, turns[i : i + 2], "right") - 1
        complete[max(first, 0) : last + 1] = False
    return complete


def regressed(
    turns: np.ndarray, values: np.ndarray, bounds: np.ndarray, teeth: float, complete: Any = True
) -> tuple[np.ndarray, np.ndarray]:
    """Return mesh orders, shape (blocks, ORDERS), and what lowers the variance of the noise.

    Samples may lie anywhere: of each block, between two of the `bounds`, a regression on offset,
    first waves of the shaft and mesh orders. Samples weigh as much as the part of the block that
    is next to them, so that of waves that grow it has the Fourier integral. The variance of either
    part of an order is half the share. Blocks that are not complete or have too few samples have
    NaN.
    """
    cells = np.concatenate([[-np.inf], 0.5 * (turns[1:] + turns[:-1]), [np.inf]])
    blocks = len(bounds) - 1
    density = np.diff(np.searchsorted(turns, bounds)) / np.diff(bounds) / teeth
    dense = complete & (density >= _LEAST_SAMPLES * ORDERS)
    allowed = f"of {_LEAST_SAMPLES * ORDERS:g} or more"
    least = f"{density.min():.3g} samples in a mesh period"
    checks.require(dense.any(), "displacement", least, allowed)
    count = min(2 * ORDERS, int(density[dense].min() / _LEAST_SAMPLES))
    # Less than a turn does not tell them from the offset.
    shaft = _SHAFT_ORDERS if bounds[1] - bounds[0] >= 1.0 else 0
    waves = np.array([*range(1, shaft + 1), *(teeth * np.arange(1, count + 1))])
    orders, share = np.full((blocks, ORDERS), complex(np.nan)), np.full(blocks, np.nan)
    real = np.arange(ORDERS) + 1 + shaft
    imaginary = real + waves.size
    for k in np.flatnonzero(dense):
        low, high = bounds[k : k + 2]
        inside = slice(np.searchsorted(cells, low, "right") - 1, np.searchsorted(cells, high))
        weights = np.diff(np.clip(cells[inside.start : inside.stop + 1], low, high))[:, None]
        turn = np.exp(2j * np.pi * np.outer(turns[inside], waves))
        columns = np.hstack([np.ones((len(turn), 1)), turn.real, turn.imag])
        weighted = weights * columns
        inverse = np.linalg.inv(columns.T @ weighted)
        best = inverse @ (weighted.T @ values[inside])
        orders[k] = 0.5 * (best[real] - 1j * best[imaginary])
        variances = np.diag(inverse @ (weighted.T @ weighted) @ inverse)
        share[k] = 0.5 * variances[[*real, *imaginary]].mean()
    return orders, share
