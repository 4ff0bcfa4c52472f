"""Time courses as observations: mesh orders at constant speed, and of run-ups with their jumps.

Regressions take the complex amplitudes of the mesh orders from the samples of each revolution, so
offset and eccentricity do not enter. A course begins at the mesh phase ``known.phase`` (rad), 0
where nothing is said.
"""

import json
import math
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from gearlib import checks
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.analysis.order_maps import Turning
from gearlib.runs.run_up import run_up, speeds_of
from gearlib.runs.sweeping import sweep
from gearlib.uncertainty import orbit_values
from gearlib.uncertainty.observation import JUMP_SHARE, START_REFUSAL, Channel, Curve, Observation
from gearlib.uncertainty.orbit_values import ORDER, SETTLING

#: How a speed was reached -> direction of the sweep, its first speed as a share, number of speeds.
_SWEEPS = {0: ("cold", 1.0, 1), 1: ("up", 0.5, 40), -1: ("down", 1.6, 40)}
#: Mesh orders of a time course that are compared.
ORDERS = 4
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
        groups = [np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist())]
        parts = [data.isel(sample=group) for group in groups]
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
        if isinstance(facts, dict):
            return facts
    except (TypeError, ValueError):
        pass
    raise checks.refusal("known", text, "a mapping as a text, of json.dumps")


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


class _Course:
    """A measured time course as mesh orders of blocks of revolutions."""

    def __init__(self, model: Any, data: Any):
        phase = _facts(data).get("phase", 0.0)
        phase = checks.number("known.phase", phase, "a number in rad", np.isfinite)
        #: Factor on the mesh orders of a model, which begins at the phase 0.
        self.shift = np.exp(1j * phase * np.arange(1, ORDERS + 1))
        self.sensor = data.displacement.attrs
        self.values = np.asarray(data.displacement.values, float)
        checks.require((np.diff(data.time.values) > 0.0).all(), "time", "unsorted", "rising")
        constant = np.ptp(self.values) == 0.0
        checks.require(not constant, "displacement", float(self.values[0]), "no constant")
        #: Mesh periods of a revolution.
        self.teeth = checks.number(
            "mesh periods of a revolution",
            round(model.periods_per_revolution, 9),
            "a whole number, as of a train whose carrier stands",
            float.is_integer,
        )

    def regress(self, turns: np.ndarray, bounds: np.ndarray, complete: Any = True) -> None:
        """Take the mesh orders from the samples, which lie at `turns` revolutions."""
        #: Mesh orders, shape (blocks, ORDERS), and what lowers the variance of the noise.
        self.orders, self.share = regressed(turns, self.values, bounds, self.teeth, complete)

    def channel(self, kind: str, kept: np.ndarray) -> Channel:
        """Return the channel of the mesh orders of the blocks that are `kept`, a mask."""
        self.kept = kept
        noise = float(self.sensor.get("noise_std", 0.0))
        size = (noise or float(np.std(self.values))) * np.sqrt(0.5 * self.share[kept])
        values = _flat(self.orders[kept])
        return Channel(
            kind,
            values,
            np.repeat(size, 2 * ORDERS),
            bool(noise),
            unknown_gain=bool(self.sensor.get("unknown_gain", 0)),
            sequences=np.arange(values.size).reshape(-1, 2 * ORDERS).T,
        )

    def compared(self, orders: np.ndarray) -> np.ndarray:
        """Return the mesh orders of a model as values of the channel."""
        return _flat((orders * self.shift)[self.kept])

    def drawn(self, sensed: np.ndarray) -> np.ndarray:
        """Return values of the channel as mesh orders; NaN of blocks that are left out."""
        orders = np.full(self.orders.shape, complex(np.nan))
        orders[self.kept] = sensed.view(complex).reshape(-1, ORDERS)
        return orders


def _flat(orders: np.ndarray) -> np.ndarray:
    """Return real and imaginary parts of mesh orders, one after the other."""
    return np.ascontiguousarray(orders).view(float).ravel()


def _of_steady(model: Any, data: Any, mesh: int) -> Observation:
    """Return the observation of a time course at constant speed, the mesh orders of its orbit."""
    course, speed = _Course(model, data), float(data.speed.values[0])
    checks.require(speed > 0.0, "speed", speed, "> 0")
    way = int(data.direction.values[0]) if "direction" in data.coords else 0
    direction, first, count = _SWEEPS[way]
    # The phase that is known is that at the time 0.
    turns = data.time.values * speed / 60.0
    course.regress(turns, np.array([turns[0], np.nextafter(turns[-1], np.inf)]))
    channel = course.channel("time course", np.ones(1, bool))

    def predict(model: Any) -> tuple:
        tuning = speed / float(model.speed(1.0))
        tunings = np.sort(np.linspace(first * tuning, tuning, count))
        run = sweep(model, tunings, direction=direction, **SETTLING)
        state = run.final_state.values[0 if direction == "down" else -1]
        point = orbit_values.at_speed(model, speed, state, _STEADY_SAMPLES)
        orders = point[ORDER][1 : ORDERS + 1, mesh]
        return [course.compared(orders[None])], max(0.0, -point["displacement_min"].min())

    def draw(sensed: list) -> list:
        phase = np.linspace(0.0, 1.0, _DRAWN_POINTS)
        waves = np.exp(2j * np.pi * np.outer(phase, np.arange(1, ORDERS + 1)))
        rows = course.orders[0], course.drawn(sensed[0])[0]
        heights = tuple(2.0 * (waves @ orders).real for orders in rows)
        name, units = f"displacement at {speed:.5g} rpm", course.sensor.get("units", "m")
        return [Curve(name, units, "phase", phase, heights, np.zeros(_DRAWN_POINTS, bool))]

    return Observation("time course", [channel], predict, draw)


def _of_run_up(model: Any, data: Any, mesh: int) -> Observation:
    """Return the observation of a run-up: mesh orders of its revolutions, speeds of its jumps."""
    course, (rows, options) = _Course(model, data), _course_of(_facts(data))
    turning = Turning(rows)
    turns = turning.revolutions(data.time.values)
    blocks = _whole_revolutions(turning, rows, data.time.values, turns)
    kept, heights, jumps, warning = _revolutions(course, turns, blocks)
    speeds = turning.at(np.arange(blocks) + 0.5)[1]
    channels = [course.channel("run-up", kept)]
    if jumps:
        places = np.array([0.5 * (speeds[i - 1] + speeds[i]) for i in jumps])
        widths = [_BEHIND * abs(speeds[i] - speeds[i - 1]) + 1e-9 for i in jumps]
        noise_known = channels[0].noise_known
        channels.append(Channel("jumps", places, np.array(widths), noise_known, joined=True))

    def run_of(model: Any) -> Any:
        return run_up(model, speed=rows, samples_per_period=_RUN_UP_SAMPLES, **options)

    run = run_of(model)
    if int(run.status):
        raise ValueError(START_REFUSAL)
    # The phases are those of the course, whatever the parameters of the model are.
    matrix = _fourier_matrix(run.phase.values, blocks, math.tau * course.teeth)

    def predict(model: Any) -> tuple:
        run = run_of(model)
        if int(run.status):
            raise NoOrbit(run.status.attrs["message"])
        displacement = run.displacement.values.reshape(run.sizes["time"], -1)[:, mesh]
        orders = (matrix @ displacement).reshape(blocks, ORDERS)
        values = [course.compared(orders)]
        if jumps:
            gain = channels[0].sensed(values[0])[1] or 1.0
            levels = np.abs(orders[:, 0])
            values.append(np.array([_crossing(levels, i, heights / gain, speeds) for i in jumps]))
        least = run.displacement_min.values[:blocks]
        return values, max(0.0, -float(least[kept[: least.shape[0]]].min()))

    def draw(sensed: list) -> list:
        units, falls = course.sensor.get("units", "m"), np.gradient(speeds) < 0.0
        amplitudes = 2.0 * np.abs([course.orders.T, course.drawn(sensed[0]).T])
        return [
            Curve(
                f"order {k if k > 1 else ''}z",
                units,
                "speed",
                speeds,
                tuple(amplitudes[:, k - 1]),
                falls,
            )
            for k in range(1, ORDERS + 1)
        ]

    return Observation("run-up", channels, predict, draw, warning)


def _revolutions(course: _Course, turns: np.ndarray, blocks: int) -> tuple:
    """Return which revolutions are compared, heights of their first order, jumps, and a warning.

    Around a jump, where the deviations of a motion grow, nothing is compared but its speed.
    """
    bounds = np.arange(blocks + 1)
    complete, count = complete_blocks(turns, bounds, course.teeth), blocks - _FIRST
    allowed = f"of one without a gap behind the first {_FIRST}"
    gaps = f"of {count} revolutions with gaps"
    checks.require(complete[_FIRST:].any(), "time", gaps, allowed)
    course.regress(turns, bounds, complete)
    present = np.isfinite(course.share)
    kept = present & (bounds[:-1] >= _FIRST)
    missing, warning = count - int(kept.sum()), ""
    if missing:
        warning = (
            f"{missing} of {count} revolutions are left out of the run-up: they have gaps or too "
            "few samples"
        )
    # A revolution without samples has the height of the one before it.
    last = np.maximum.accumulate(np.where(present, bounds[:-1], present.argmax()))
    heights = np.abs(course.orders[last, 0])
    steps, jumps = np.abs(np.log(heights[1:] / heights[:-1])), []
    for i in np.argsort(-steps):
        if steps[i] < JUMP_SHARE or i < _FIRST:
            break
        if all(abs(i + 1 - jump) > _BEHIND for jump in jumps):
            jumps.append(int(i + 1))
    for i in jumps:
        kept[max(i - _BEFORE, 0) : i + _BEHIND] = False
    return kept, heights, sorted(jumps), warning


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


def _fourier_matrix(phase: np.ndarray, blocks: int, span: float) -> csr_array:
    """Return the matrix, shape (blocks * ORDERS, samples), from samples to mesh orders.

    It integrates each block, `span` of the phase, by the trapezoidal rule.
    """
    edges = span * np.arange(blocks + 1)
    places = np.searchsorted(phase, edges - _SAME_PHASE)
    intervals, samples = np.arange(places[-1]), phase.size
    phase = np.append(phase[: places[-1]], edges[-1])
    ends = np.array([intervals, intervals + 1])
    rows, columns, weights = np.broadcast_arrays(
        ORDERS * np.repeat(np.arange(blocks), np.diff(places)) + np.arange(ORDERS)[:, None, None],
        # The last sample closes a course that ends before its last edge.
        np.minimum(ends, samples - 1),
        np.diff(phase) * np.exp(-1j * phase[ends] * np.arange(1, ORDERS + 1)[:, None, None]),
    )
    entries = weights.ravel() / (2.0 * span), (rows.ravel(), columns.ravel())
    return csr_array(entries, (ORDERS * blocks, samples))


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
