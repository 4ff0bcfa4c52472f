"""The periodic orbit of a model whose flanks never part, over the tuning: in closed form."""

import functools

import numpy as np
from scipy.linalg import expm

from gearlib.kernels.several_meshes.train_system import matrix_of, set_harmonics
from gearlib.runs.run_arguments import MAX_EVENTS

#: Longest pieces of a period at whose ends extrema of several coordinates are looked for, rad.
_PIECE = 0.1
_DRIVE = 2  # contact code + 1


def linear_orbit_of(model):
    """Return the function of a tuning that returns (state, (highest, least)).

    These are the largest and the least displacement over the flank line: of several meshes the
    least of all, and that plus the height of the highest.
    """
    return functools.partial(_of_system, model) if model.size > 2 else _of_pair(model)


def _of_pair(model):
    # Without backlash one flank goes on where the other ends.
    linear = model.replace(backlash=0.0)
    propagators = linear.propagator(1.0)

    def found(tuning):
        propagator = propagators.at(tuning)
        end, maps, _ = propagator.maps(np.zeros(2), 1, MAX_EVENTS)
        state = np.linalg.solve(np.eye(2) - maps[0], end)
        _, summary, _ = propagator.record(state, 1, MAX_EVENTS)
        high, low = summary[0], summary[1]
        return state, (high - linear.flank_lines[0], low - linear.flank_lines[0])

    return found


def _of_system(model, tuning):
    system, n = model.system(tuning), model.size
    size = len(system.free)
    steps, matrix = [], np.empty((size, size))
    for i, length in enumerate(np.diff(system.starts)):
        matrix_of(system, system.effect[_DRIVE, i], matrix)
        count = int(np.ceil(length / _PIECE))
        steps += [expm(matrix * (length / count / system.tuning))] * count
    # Of six degrees of freedom segments are those of one mesh period, waves repeat after more.
    steps *= round(2.0 * np.pi * model.repeats / system.starts[-1])
    whole = np.eye(size)
    for step in steps:
        whole = step @ whole
    scale = np.repeat([1.0, tuning], n // 2)
    z = np.zeros(size)
    set_harmonics(system.harmonics, z, 0.0)
    reduce, lift = model.reduction()
    end, away = whole @ z, whole[:n, :n] * scale / scale[:, None]
    maps = np.eye(len(reduce)) - reduce @ away @ lift
    state = lift @ np.linalg.solve(maps, reduce @ (end[:n] / scale))
    z[:n] = state * scale
    places = [z]
    for step in steps:
        places.append(step @ places[-1])
    distances = np.array(places) @ system.near.T
    least = distances.min()
    return state, (least + np.ptp(distances, axis=0).max(), least)
