"""Mean mesh forces of a periodic orbit of a train, and what they change by with parameters.

The integral of a force over an orbit is exact as it is over a revolution of a run-up: the orbit is
gone through once at its speed, its start moving with the parameters as the orbit does.
"""

import numpy as np

from gearlib.kernels import orbit as columns
from gearlib.kernels.several_meshes.record import FORCE_SUM
from gearlib.models import acceleration
from gearlib.models.propagators import courses
from gearlib.models.propagators.course_matrices import of_matrices
from gearlib.runs.run_arguments import MAX_EVENTS

#: An extremum that no motion comes near.
_NONE = 1e300
_TIMES = [columns.TIME_NORMAL, columns.TIME_BACKLASH, columns.TIME_INVERSE]


def mean_forces(orbit, names, slopes):
    """Return (mean forces in N, shape (m,), their derivatives at this speed, shape (m, k)).

    Parameters
    ----------
    orbit : Orbit
        Of a `GearTrain`.
    names : sequence of str
        Of `GearTrain.derivatives`, k of them.
    slopes : ndarray, shape (n, k)
        What its start changes by at this speed.
    """
    train = orbit.pair
    rpm, lasts = float(train.speed(orbit.tuning)), 2.0 * np.pi * orbit.period
    seconds = lasts / float(train.mesh_frequency(orbit.tuning))
    speeds, loads = np.array([[0.0, rpm], [seconds, rpm]]), np.array([[0.0, 1.0]])
    state, once = tuple(orbit.state), courses.equal_steps(1)
    runner, pieces, z = courses.set_out(train, speeds, loads, state)
    push = acceleration.of_train(train, None)
    found = list(
        courses.run_through(runner, pieces, z, once, MAX_EVENTS, push, 2.0 * float(orbit.period))
    )
    # The run may have been made in several stretches.
    table = np.concatenate([one.summary for one in found])
    times = table[..., _TIMES].sum(axis=(0, -1))
    means = table[..., FORCE_SUM].sum(axis=0) / times
    along = [
        train.direction(name)
        | {f"initial_state of {c}": one for c, one in zip(train.components, own, strict=True)}
        for name, own in zip(names, slopes.T, strict=True)
    ]
    whole = np.copy(table[:1])
    whole[..., [columns.X_MAX, columns.FORCE_MAX]] = _NONE
    whole[..., [columns.X_MIN, columns.FORCE_MIN]] = -_NONE
    moved = of_matrices(train, names, found, whole, state, 1, along, driver=None)
    change = moved.area.sum(axis=0) - means[:, None] * moved.times.sum(axis=0)[3]
    return train.load * means, train.load * change / times[:, None]
