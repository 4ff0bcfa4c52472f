"""Proof of the period of a motion. A proof is needed because a transient may repeat for a while.

Let P be the map of p mesh periods, M its derivative at the state s, and d = P(s) - s with the
components c along the eigenvectors of M, of length 1. Where the pattern of events is fixed and all
multipliers of M lie within the unit circle, all later states lie within

    D = sum_k |c_k| / (1 - |lambda_k|)

of s and converge to an orbit there. This counts as a proof if D is far below the distance from any
grazing. `gearlib.engines.pair.settling` proves the same during the runs of a `GearPair`.
"""

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import OK
from gearlib.engines.orbit import Record, Span

if TYPE_CHECKING:
    from gearlib.engines.protocol import Base

#: Largest distance D of a settled motion from its stable orbit. It is smaller than the tolerance of
#: equal states, so that a transient towards a shorter orbit is not taken for a longer orbit.
_SETTLED_DISTANCE = 1e-8
#: Smallest distance of Floquet multipliers from the unit circle for which a proof is possible.
_MIN_DECAY = 1e-6
#: An orbit grazes no flank line if it stays at this distance, in static deflections, or crosses it
#: with this speed, in static deflections by natural time.
_GRAZING_DISTANCE, _GRAZING_SPEED = 1e-5, 1e-3
#: Largest number of additional periods, and of all periods as a multiple of the periods so far.
_MAX_ADDED_PERIODS, _MAX_PERIOD_RATIO = 5000, 20
#: Distance of two neighbouring starts, as large as the rounding of a run, and distance at which
#: their motions have diverged, both as fractions of the state.
_START_DISTANCE, _DIVERGED_DISTANCE = 1e-13, 1e-2


def proven_period(
    propagator: "Base", z: np.ndarray, period: int, max_events: int, first_period: int = 0
) -> int:
    """Return the period of the orbit to which a motion from the state z converges, 0 unproven.

    `period` is the number of mesh periods after which stroboscopic states repeat, 0 if they do not.
    A mesh period has at most `max_events` events; the excitation starts with period `first_period`.
    """
    model = propagator.model
    if not period or propagator.proves_periods:
        return period
    span, first_period = math.lcm(period, model.repeats), first_period % model.repeats
    end, maps, status = propagator.maps(z, span, max_events, first_period)
    if status != OK:
        return 0
    try:
        reduce, lift = model.reduction()
    except ValueError:
        # The free rotation is damped, so it has to settle like all other motions.
        reduce = lift = np.eye(model.size)
    weights = np.repeat([1.0, propagator.tuning], len(reduce) // 2)
    reduce, lift = weights[:, None] * reduce, lift / weights
    step, tolerance = reduce @ (end - z), _SETTLED_DISTANCE * max(1.0, np.abs(reduce @ z).max())
    if not np.linalg.norm(step) <= tolerance:
        return 0
    matrix = np.eye(len(reduce))
    for period_map in maps:
        matrix = reduce @ period_map @ lift @ matrix
    if not _distance_bound(matrix, step) <= tolerance:
        return 0
    record = propagator.run(z, Span(span, span, max_events), first_period=first_period)
    return period if record.status == OK and _avoids_grazing(propagator, record) else 0


def _distance_bound(matrix: np.ndarray, step: np.ndarray) -> float:
    """Return the largest distance D = sum |c_k| / (1 - |lambda_k|) of a motion from its orbit.

    The monodromy matrix has the Floquet multipliers lambda_k; c_k are the components along its
    eigenvectors of the step of the state in one period. D is infinite if the map hardly contracts.
    """
    norm = np.linalg.norm(matrix)
    if norm < 0.5:
        # The map contracts so fast that rounding determines its eigenvectors.
        return np.linalg.norm(step) / (1.0 - norm)
    multipliers, vectors = np.linalg.eig(matrix)
    decay = 1.0 - np.abs(multipliers)
    if decay.min() < _MIN_DECAY:
        return math.inf
    try:
        return (np.abs(np.linalg.solve(vectors, step)) / decay).sum()
    except np.linalg.LinAlgError:
        return math.inf


def _avoids_grazing(propagator: "Base", record: Record) -> bool:
    """Return whether a recorded motion crosses or avoids the flank lines of its model clearly."""
    extrema = np.moveaxis(record.summary[..., [orbit.X_MAX, orbit.X_MIN]], -1, 0)
    distances = [np.abs(extrema - line).min() for line in propagator.model.flank_lines]
    speeds = np.abs(record.events[:, orbit.EVENT_VELOCITY]) * propagator.tuning
    return min(distances) > _GRAZING_DISTANCE and speeds.min(initial=math.inf) > _GRAZING_SPEED


def settled_period(
    propagator: "Base", record: Record, span: Span, until_settled: bool
) -> tuple[int, int]:
    """Return (proven period of the motion, mesh periods until the proof) after a run over a span.

    The period is 0 if the motion has not settled or if rounding decides where it settles. With
    `until_settled` the run continues until there is a proof, up to 20 times its length, but at most
    by 5000 periods.
    """
    z, period, periods = record.state, record.period, span.periods
    # If a neighbouring motion diverges, rounding decides where the motion settles.
    neighbour, has_diverged, max_periods = z * (1.0 + _START_DISTANCE), False, periods
    if until_settled:
        max_periods = min(_MAX_PERIOD_RATIO * periods, periods + _MAX_ADDED_PERIODS)
    while True:
        proven = (
            0 if has_diverged else proven_period(propagator, z, period, span.max_events, periods)
        )
        added = min(periods, max_periods - periods)
        if proven or has_diverged or not added:
            return proven, periods
        arguments = {"span": Span(added, 1, span.max_events), "keep_events": False}
        arguments["first_period"] = periods % propagator.model.repeats
        run = functools.partial(propagator.run, **arguments)
        record, neighbour_record, periods = run(z), run(neighbour), periods + added
        if record.status != OK:
            return 0, periods
        z, neighbour, period = record.state, neighbour_record.state, record.period
        distance, size = np.abs(neighbour - z).max(), max(1.0, np.abs(z).max())
        has_diverged = neighbour_record.status != OK or distance > _DIVERGED_DISTANCE * size
