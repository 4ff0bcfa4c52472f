"""The stroboscopic map of any model, for many states at once.

One *cycle* is the span after which the equations of motion repeat: one mesh period, with run-out
as many as bring the gears back. A periodic orbit of n cycles is n points of the map.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gearlib import checks
from gearlib.data import status
from gearlib.kernels import orbit
from gearlib.kernels.closed_form.many_runs import skip_many
from gearlib.kernels.closed_form.mesh import mesh
from gearlib.kernels.piecewise_linear.run import run_linear
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.taylor.run import run_nonlinear
from gearlib.kernels.taylor.series import ORDER
from gearlib.methods import choose
from gearlib.methods.exact import ratios
from gearlib.models.oscillator import OneDegree
from gearlib.models.pair import GearPair
from gearlib.runs.run_arguments import MAX_EVENTS, check_tuning
from gearlib.runs.variational import full_state, moving_components, period_maps, rotation_free

_TO_BERNSTEIN = bernstein_matrix(ORDER)
_TOLERANCE = 1e-16
#: States that a thread takes at a time: many to hide the hand-over, few to share out the slow ones.
_CHUNK, _FEW = 2048, 16


class Stroboscope:
    """The map of many states over whole cycles."""

    def __init__(self, pair, tuning, *, max_events=MAX_EVENTS, threads=None):
        choose(pair, None, None)
        #: Whether the motion goes in closed forms, not in Taylor steps.
        self.exact = not isinstance(pair, OneDegree)
        self.pair, self.tuning = pair, check_tuning("tuning", tuning)
        self.max_events = checks.integer("max_events", max_events, 1)
        count = os.cpu_count() or 1
        self.threads = count if threads is None else checks.integer("threads", threads, 1)
        self.cycle = pair.repeats
        self._reduce, self.lift = rotation_free(pair)
        #: Turn rates into displacements.
        self.weights = np.repeat([1.0, self.tuning], len(self._reduce) // 2)

    def start(self, states):
        """Return the full states, shape (k, n), of displacements and velocities, shape (k, 2)."""
        if moving_components(self.pair) == 2:
            return np.array(states, float)
        return np.array([full_state(self.pair, self.tuning, state) for state in states])

    def seen(self, states):
        """Return the states as they are compared: without free rotation, in displacements."""
        return states @ self._reduce.T * self.weights

    def cycle_maps(self, state, cycles):
        """Return the derivatives of the map of each cycle in the coordinates of `seen`."""
        _, maps, code = period_maps(
            self.pair, self.tuning, state, cycles * self.cycle, self.max_events
        )
        if code != status.OK:
            raise RuntimeError(status.MESSAGES[code])
        maps = self._reduce @ maps @ self.lift
        scaled = maps * self.weights[:, None] / self.weights
        grouped = scaled.reshape(cycles, self.cycle, *maps.shape[1:])
        return np.array([chain(group) for group in grouped])

    def __call__(self, states, cycles):
        """Take states through `cycles` cycles.

        Parameters
        ----------
        states : ndarray, shape (k, n)
        cycles : int

        Returns
        -------
        ends : ndarray, shape (k, n)
        codes : ndarray of int, shape (k,)
            `gearlib.data.status`; where it is not OK, the end is NaN.
        """
        ends = np.full(states.shape, np.nan)
        codes = np.zeros(len(states), np.int64)
        scalar = isinstance(self.pair, GearPair)
        size = _CHUNK if scalar else _FEW
        size = max(1, min(size, -(-len(states) // self.threads)))
        run = self._together if scalar else self._one_by_one
        parts = [slice(i, i + size) for i in range(0, len(states), size)]

        def go(part):
            run(states[part], cycles * self.cycle, ends[part], codes[part])

        if len(parts) < 2 or self.threads == 1:
            for part in parts:
                go(part)
        else:
            # The kernels release the interpreter lock; every state has its own rows.
            with ThreadPoolExecutor(self.threads) as pool:
                list(pool.map(go, parts))
        ends[codes != status.OK] = np.nan
        return ends, codes

    def _together(self, states, periods, ends, codes):
        m = mesh(ratios(self.pair), self.tuning)
        states = np.ascontiguousarray(states)
        skip_many(m, states, periods, self.max_events, ends, codes)

    def _one_by_one(self, states, periods, ends, codes):
        samples = np.empty((0, orbit.SAMPLE_COLUMNS))
        events, summary = np.empty((0, orbit.EVENT_COLUMNS)), np.empty(orbit.SUMMARY_COLUMNS)
        rest = periods, 1, samples, events, self.max_events, summary
        if isinstance(self.pair, OneDegree):
            law = self.pair.law(self.tuning, _TOLERANCE)
            for i, (x, v) in enumerate(states):
                *ends[i], _, _, _, codes[i], _ = run_nonlinear(law, _TO_BERNSTEIN, x, v, *rest)
            return
        system, outputs = self.pair.system(self.tuning)
        part = self.pair.part(system)
        for i, state in enumerate(states):
            z = np.zeros(system.near.size)
            z[: state.size] = state
            codes[i] = run_linear(system, part, outputs, _TO_BERNSTEIN, z, *rest)[5]
            ends[i] = z[: state.size]


def chain(maps):
    """Return the product of maps, the first of them rightmost."""
    matrix = np.eye(maps.shape[-1])
    for one in maps:
        matrix = one @ matrix
    return matrix
