"""The period of a motion, by proof: states that repeat may be those of a transient.

Let P be the map of p mesh periods, M its derivative at the state s, and d = P(s) - s with the
components c along the eigenvectors of M, of length 1. Where the pattern of events is fixed and all
multipliers of M lie within the unit circle, all later states lie within

    D = sum_k |c_k| / (1 - |lambda_k|)

of s, and end on an orbit there. That is taken for proof where D is far below the distance from any
grazing, as in `gearlib.engines.pair.settling`, which does so for a `GearPair` on its way.
"""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import OK

#: A motion has settled once it stays this close to an orbit that draws it on: less than what tells
#: states apart, so that a transient of a shorter orbit is not taken for a longer one.
_SETTLED = 1e-8
#: Multipliers nearer to the unit circle draw a motion on too slowly to tell.
_LEAST_DECAY = 1e-6
#: An orbit grazes no line if it stays this far from it, in static deflections, or crosses it with
#: this speed, in static deflections by natural time.
_CLEAR, _QUICK = 1e-5, 1e-3
#: Periods over which `followed` goes on at most, in all and as a multiple of those behind it.
_MOST, _TIMES = 5000, 20
#: A motion that begins beside another by this share, the rounding of a run, has left it when it is
#: this far away, in shares of the state.
_BESIDE, _APART = 1e-13, 1e-2


def proven(propagator, z, period, limit, first=0):
    """Return the period of the orbit on which the motion from z settles, 0 where that is not shown.

    `period` is as of `orbit.orbit_period`, 0: none; `limit` the most events in one mesh period,
    `first` the mesh period of z where the excitation repeats after several.
    """
    model = propagator.model
    if not period or propagator.proves_periods:
        return period
    span, first = math.lcm(period, model.repeats), first % model.repeats
    end, maps, code, events, summary = propagator.watched(z, span, limit, first)
    if code != OK:
        return 0
    try:
        reduce, lift = model.reduction()
    except ValueError:
        # Its free rotation is not neutral: it has to come to rest as all the others.
        reduce = lift = np.eye(model.size)
    weights = np.repeat([1.0, propagator.tuning], len(reduce) // 2)
    reduce, lift = weights[:, None] * reduce, lift / weights
    step, within = reduce @ (end - z), _SETTLED * max(1.0, np.abs(reduce @ z).max())
    if not np.linalg.norm(step) <= within:
        return 0
    matrix = np.eye(len(reduce))
    for one in maps:
        matrix = reduce @ one @ lift @ matrix
    if not _way_left(matrix, step) <= within:
        return 0
    return period if _keeps_clear(propagator, events, summary) else 0


def _way_left(matrix, step):
    """Return D of the module's docstring, infinite where the map hardly contracts."""
    norm = np.linalg.norm(matrix)
    if norm < 0.5:
        # Next to nothing is left of a deviation, and eigenvectors are those of rounding.
        return np.linalg.norm(step) / (1.0 - norm)
    multipliers, vectors = np.linalg.eig(matrix)
    decay = 1.0 - np.abs(multipliers)
    if decay.min() < _LEAST_DECAY:
        return math.inf
    try:
        return (np.abs(np.linalg.solve(vectors, step)) / decay).sum()
    except np.linalg.LinAlgError:
        return math.inf


def _keeps_clear(propagator, events, summary):
    """Return whether a motion grazes no flank line."""
    ends = summary[..., [orbit.X_MAX, orbit.X_MIN]]
    lines = propagator.model.flank_lines
    near = [np.abs(np.moveaxis(ends, -1, 0) - line).min() for line in lines]
    speeds = np.abs(events[:, orbit.EVENT_VELOCITY]) * propagator.tuning
    return min(near) > _CLEAR and speeds.min(initial=math.inf) > _QUICK


def followed(propagator, z, periods, period, limit, until_settled):
    """Prove the period of the motion at z after so many `periods`, now or later on.

    `until_settled` goes on while it is not proven, to 20 times the periods or 5000 more, and takes
    z along; `period` is that of the states so far. Returns the period, 0 if it has not settled or
    rounding decides where, and the mesh periods after which it is proven.
    """
    model, most = propagator.model, periods
    if until_settled:
        most = min(_TIMES * periods, periods + _MOST)
    samples, events, summary = model.empty_record(events=0)
    twin, apart = z * (1.0 + _BESIDE), False
    while True:
        shown = 0 if apart else proven(propagator, z, period, limit, periods)
        more = min(periods, most - periods)
        if shown or apart or not more:
            return shown, periods
        rest, first = (more, 1, samples, events, limit, summary), periods % model.repeats
        other = propagator.run(twin, *rest, first=first)
        period, code = propagator.run(z, *rest, first=first)[2:6:3]
        periods += more
        if code != OK:
            return 0, periods
        apart = other[5] != OK or np.abs(twin - z).max() > _APART * max(1.0, np.abs(z).max())
