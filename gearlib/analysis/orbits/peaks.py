"""The largest extremum of a motion on the way to a fold, or about a resonance without one."""

import numpy as np
from scipy.optimize import minimize_scalar

#: Share of the first step beside a fold at which it shows whether an extremum grows further.
_BESIDE_FOLD = 1e-3
_TOLERANCE = 1e-8


def highest_point(period_map, column, rows, fold, from_highest):
    """Return (point, value) where an extremum is largest along the stable branch.

    That is next to the fold (state, tuning), or the fold itself; without one next to the first row
    or, `from_highest`, to the highest. Rows are tunings, states and summaries, the extremum is a
    column of these.
    """
    tunings, states, summaries = rows
    values, places = summaries[:, 0, column], tunings
    if fold is not None:
        # Beside a fold states go with the root of the distance.
        before = np.flatnonzero(tunings > fold[-1])[::-1]
        places = np.sqrt(np.append(0.0, tunings[before] - fold[-1]))
        states = np.vstack([fold[:-1], states[before]])
        highest = period_map.summary(fold[-1], fold[:-1])[0, column]
        values = np.append(highest, values[before])
    order = np.argsort(places)

    def point(place):
        tuning = place if fold is None else fold[-1] + place**2
        guess = np.array([np.interp(place, places[order], one[order]) for one in states.T])
        state = period_map.orbit(tuning, guess)
        if fold is not None and np.linalg.det(period_map.residual(tuning, state)[1]) < 0.0:
            # It is one of the unstable branch, which mirrors the stable one at the fold.
            state = period_map.orbit(tuning, 2.0 * fold[:-1] - state)
        return np.append(state, tuning)

    def value(place):
        orbit = point(place)
        return float(period_map.summary(orbit[-1], orbit[:-1])[0, column])

    i, last = int(values.argmax()) if from_highest else 0, len(values) - 1
    while i < last and values[i + 1] > values[i]:
        i += 1
    if i == 0 and fold is not None and value(_BESIDE_FOLD * places[1]) <= values[0]:
        return fold, float(values[0])
    ends = sorted((places[max(i - 1, 0)], places[min(i + 1, last)]))
    options = {"xatol": _TOLERANCE}
    top = minimize_scalar(lambda x: -value(x), bounds=ends, method="bounded", options=options)
    return point(top.x), -float(top.fun)
