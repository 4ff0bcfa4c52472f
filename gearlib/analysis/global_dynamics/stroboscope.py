"""The stroboscopic map of any model, for many states at once.

One *cycle* is the span after which the equations of motion repeat: one mesh period, with run-out
as many as bring the gears back. A periodic orbit of n cycles is n points of the map.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits.shooting import product
from gearlib.data import status
from gearlib.integrators import choose
from gearlib.runs.run_arguments import MAX_EVENTS, check_tuning

#: A motion this many times as large as its model grows without bound if it becomes as many times
#: as large in so many periods as are counted, again and again, up to `Model.bound`.
_MANY_EXTENTS, _GROWTH = 1e2, 1.5


class Stroboscope:
    """The map of many states over whole cycles."""

    def __init__(self, model, tuning, *, max_events=MAX_EVENTS, threads=None):
        choose(model, None, None)
        self.pair, self.tuning = model, check_tuning("tuning", tuning)
        self.propagator = model.propagator(self.tuning)
        self.max_events = checks.integer("max_events", max_events, 1)
        count = os.cpu_count() or 1
        self.threads = count if threads is None else checks.integer("threads", threads, 1)
        self.cycle = model.repeats
        self._reduce, self.lift = model.reduction()
        #: Turn rates into displacements.
        self.weights = np.repeat([1.0, self.tuning], len(self._reduce) // 2)

    def start(self, states):
        """Return the full states, shape (k, n), of displacements and velocities, shape (k, 2)."""
        return np.array([self.propagator.start(state) for state in states])

    def seen(self, states):
        """Return the states as they are compared: without free rotation, in displacements."""
        return states @ self._reduce.T * self.weights

    def size(self, states):
        """Return the size of each state, shape (k,), in displacements; infinite if NaN."""
        size = np.abs(self.seen(states)).max(axis=-1)
        return np.where(np.isnan(size), np.inf, size)

    def unbounded(self, states, before, bounds, periods):
        """Return (mask, states): which of them grow beyond their bounds, followed while they grow.

        Shapes (k,) and (k, n); `before` are their sizes so many mesh periods ago.
        """
        states, size = states.copy(), self.size(states)
        growing = (size > _MANY_EXTENTS * self.pair.extent) & (size > _GROWTH * before)
        while (follow := growing & (size <= bounds)).any():
            ends, codes = self(states[follow], -(-periods // self.cycle))
            stopped = ~np.isin(codes, (status.OK, status.OVERFLOW))
            after = np.where(stopped, 0.0, self.size(ends))
            growing[follow] = grows = after > _GROWTH * size[follow]
            states[follow], size[follow] = np.where(grows[:, None], ends, states[follow]), after
        return size > bounds, states

    def cycle_maps(self, state, cycles):
        """Return the derivatives of the map of each cycle in the coordinates of `seen`."""
        _, maps, code = self.propagator.maps(state, cycles * self.cycle, self.max_events)
        if code != status.OK:
            raise RuntimeError(status.MESSAGES[code])
        maps = self._reduce @ maps @ self.lift
        scaled = maps * self.weights[:, None] / self.weights
        grouped = scaled.reshape(cycles, self.cycle, *maps.shape[1:])
        return np.array([product(group) for group in grouped])

    def __call__(self, states, cycles):
        """Take states, shape (k, n), through `cycles` cycles: their ends, codes of status.

        Where a code is not OK, the end is NaN.
        """
        ends = np.full(states.shape, np.nan)
        codes = np.zeros(len(states), np.int64)
        size = max(1, min(self.propagator.chunk, -(-len(states) // self.threads)))
        parts = [slice(i, i + size) for i in range(0, len(states), size)]

        def go(part):
            periods = cycles * self.cycle
            done = self.propagator.many(states[part], periods, self.max_events)
            ends[part], codes[part] = done

        if len(parts) < 2 or self.threads == 1:
            for part in parts:
                go(part)
        else:
            # The kernels release the interpreter lock; every state has its own rows.
            with ThreadPoolExecutor(self.threads) as pool:
                list(pool.map(go, parts))
        ends[codes != status.OK] = np.nan
        return ends, codes
