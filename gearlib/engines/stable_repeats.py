"""Proof of the period of a motion, which is needed because a transient may repeat for a while.

Let P be the map of p mesh periods, M its derivative at the state s, and d = P(s) - s with the
components c along the eigenvectors of M, which have length 1. If the sequence of events is fixed
and all multipliers of M are inside the unit circle, all later states lie within

    D = sum_k |c_k| / (1 - |lambda_k|)

of s and converge to an orbit there. This is a proof if D is far below the distance from any
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
    from gearlib.engines.protocol import Engine

#: Largest distance D of a settled motion from its stable orbit. It is smaller than the tolerance of
#: equal states, so that a transient towards a shorter orbit is not mistaken for a longer orbit.
_SETTLED_DISTANCE = 1e-8
#: Smallest distance of Floquet multipliers from the unit circle for which a proof is possible.
_MIN_DECAY = 1e-6
#: An orbit does not graze a flank line if it stays at least this far away, in static deflections,
#: or crosses the line at this speed or faster, in static deflections per unit of natural time.
_GRAZING_DISTANCE, _GRAZING_SPEED = 1e-5, 1e-3
#: Largest number of mesh periods by which a run is extended, and largest total number of mesh
#: periods as a multiple of the length of the run.
_MAX_ADDED_PERIODS, _MAX_PERIOD_RATIO = 5000, 20
#: Distance between two neighbouring initial states, as large as the rounding error of a run, and
#: distance at which their motions have diverged, both relative to the state.
_START_DISTANCE, _DIVERGED_DISTANCE = 1e-13, 1e-2


def prove_period(
    propagator: "Engine", z: np.ndarray, period: int, max_events: int, first_period: int = 0
) -> int:
    """Return the period of the orbit to which a motion provably converges from a state, or 0.

    `period` is the number of mesh periods after which the states repeat within a tolerance, or 0;
    it is returned if convergence from the state z to an orbit with this period is proven.
    `propagator` is the engine of the model. A mesh period has at most `max_events` events; z
    belongs to the start of mesh period `first_period` of the excitation period.
    """
    model = propagator.model
    if not period or propagator.proves_periods:
        return period
    span, first_period = math.lcm(period, model.repeats), first_period % model.repeats
    end_state, maps, status = propagator.maps(z, span, max_events, first_period)
    if status != OK:
        return 0
    # `reduce` removes the rigid-body rotation from a state, and `lift` is its inverse.
    try:
        reduce, lift = model.reduction()
    except ValueError:
        # The rigid-body rotation is damped, so it has to settle like any other motion.
        reduce = lift = np.eye(model.size)
    # The tuning converts derivatives by mesh phase to derivatives by natural time, which are of the
    # same size as the displacements.
    weights = np.repeat([1.0, propagator.tuning], len(reduce) // 2)
    reduce, lift = weights[:, None] * reduce, lift / weights
    step = reduce @ (end_state - z)
    tolerance = _SETTLED_DISTANCE * max(1.0, np.abs(reduce @ z).max())
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
    """Return the bound D = sum |c_k| / (1 - |lambda_k|) on the distance of a motion from its orbit.

    `matrix` is the monodromy matrix, the derivative of the state over one period of the orbit, with
    the eigenvalues lambda_k (Floquet multipliers). `step` is the change of the state over this
    period, with the components c_k along the eigenvectors. D is infinite if a multiplier is so
    close to the unit circle that deviations hardly decay.
    """
    norm = np.linalg.norm(matrix)
    if norm < 0.5:
        # If the map contracts fast, rounding errors dominate its eigenvectors. The geometric series
        # of the norm gives a bound without them.
        return np.linalg.norm(step) / (1.0 - norm)
    multipliers, vectors = np.linalg.eig(matrix)
    decay = 1.0 - np.abs(multipliers)
    if decay.min() < _MIN_DECAY:
        return math.inf
    try:
        return (np.abs(np.linalg.solve(vectors, step)) / decay).sum()
    except np.linalg.LinAlgError:
        return math.inf


def _avoids_grazing(propagator: "Engine", record: Record) -> bool:
    """Return whether a recorded motion is far from grazing its flank lines.

    A flank line is the displacement at which the flanks touch. If a motion grazes it, a small
    change can change its sequence of contacts. The extrema of the displacement must keep a minimum
    distance from each line, and crossings must have a minimum speed. `propagator` is the engine
    that has computed the `Record`.
    """
    extrema = np.moveaxis(record.summary[..., [orbit.X_MAX, orbit.X_MIN]], -1, 0)
    distances = [np.abs(extrema - line).min() for line in propagator.model.flank_lines]
    # The tuning converts velocities by mesh phase to velocities by natural time.
    speeds = np.abs(record.events[:, orbit.EVENT_VELOCITY]) * propagator.tuning
    return min(distances) > _GRAZING_DISTANCE and speeds.min(initial=math.inf) > _GRAZING_SPEED


def find_settled_period(
    propagator: "Engine", record: Record, span: Span, until_settled: bool
) -> tuple[int, int]:
    """Return (proven period of a motion, mesh periods until the proof) after a run.

    A motion has settled when it provably converges to a periodic orbit. `record` is the `Record` of
    the run over the `Span` by the engine `propagator`. The period is 0 without a proof, or if
    rounding decides to which orbit the motion converges. With `until_settled` the run is extended
    until there is a proof, up to 20 times its length, but by at most 5000 periods.
    """
    z, period, periods = record.state, record.period, span.periods
    # If a neighbouring motion diverges, rounding decides on which orbit the motion settles.
    neighbour, has_diverged, max_periods = z * (1.0 + _START_DISTANCE), False, periods
    if until_settled:
        max_periods = min(_MAX_PERIOD_RATIO * periods, periods + _MAX_ADDED_PERIODS)
    while True:
        orbit_period = (
            0 if has_diverged else prove_period(propagator, z, period, span.max_events, periods)
        )
        added_periods = min(periods, max_periods - periods)
        if orbit_period or has_diverged or not added_periods:
            return orbit_period, periods
        arguments = {"span": Span(added_periods, 1, span.max_events), "keep_events": False}
        arguments["first_period"] = periods % propagator.model.repeats
        run = functools.partial(propagator.run, **arguments)
        record, neighbour_record, periods = run(z), run(neighbour), periods + added_periods
        if record.status != OK:
            return 0, periods
        z, neighbour, period = record.state, neighbour_record.state, record.period
        distance, state_size = np.abs(neighbour - z).max(), max(1.0, np.abs(z).max())
        has_diverged = neighbour_record.status != OK or distance > _DIVERGED_DISTANCE * state_size
