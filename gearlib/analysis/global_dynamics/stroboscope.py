"""The stroboscopic map of any model for many states at once, and grids of initial states.

One *cycle* is the time after which the equations of motion repeat: one mesh period, with run-out
as many as bring the gears back. A periodic orbit of n cycles is n points of the map.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.orbits.shooting import compose
from gearlib.data import status
from gearlib.data.motions import float_array
from gearlib.integrators import choose
from gearlib.runs.run_arguments import MAX_EVENTS, check_tuning

#: Sizes beyond this multiple of the model's extent may grow without bound.
_LARGE_EXTENTS = 1e2
#: Factor by which such a size must grow again and again, up to `Model.bound`.
_MIN_GROWTH = 1.5
#: Largest number of initial states in one call: all of them are held in memory.
MAX_STATES = 50_000_000
#: Bytes of one state during a run: the state, its end, its labels.
_BYTES_PER_STATE = 120


class Stroboscope:
    """The map of many states over whole cycles of the excitation."""

    def __init__(self, model, tuning, *, max_events=MAX_EVENTS, threads=None):
        choose(model, None, None)
        self.pair, self.tuning = model, check_tuning("tuning", tuning)
        self.propagator = model.propagator(self.tuning)
        self.max_events = checks.integer("max_events", max_events, 1)
        count = os.cpu_count() or 1
        self.threads = count if threads is None else checks.integer("threads", threads, 1)
        #: Mesh periods of one cycle.
        self.cycle = model.repeats
        #: Matrices from full states to states without free rotation, and back.
        self._reduction, self.lift = model.reduction()
        #: Factors that turn velocities into displacements.
        self.weights = np.repeat([1.0, self.tuning], len(self._reduction) // 2)

    def start(self, states: np.ndarray) -> np.ndarray:
        """Return the full states, shape (k, n), of displacements and velocities, shape (k, 2)."""
        return np.array([self.propagator.start(state) for state in states])

    def scaled(self, states: np.ndarray) -> np.ndarray:
        """Return states without free rotation, with velocities scaled to displacements."""
        return states @ self._reduction.T * self.weights

    def size(self, states: np.ndarray) -> np.ndarray:
        """Return the largest scaled coordinate of each state, shape (k,); infinite if NaN."""
        size = np.abs(self.scaled(states)).max(axis=-1)
        return np.where(np.isnan(size), np.inf, size)

    def unbounded(self, states: np.ndarray, sizes_before: Any, bounds: Any, periods: int) -> tuple:
        """Return (mask of the states that grow beyond their bounds, states followed so far).

        Shapes (k,) and (k, n). States are followed as long as they grow; `sizes_before` are their
        sizes the given number of mesh periods ago.
        """
        states, size = states.copy(), self.size(states)
        growing = size > _LARGE_EXTENTS * self.pair.extent
        growing &= size > _MIN_GROWTH * sizes_before
        while (followed := growing & (size <= bounds)).any():
            ends, codes = self(states[followed], -(-periods // self.cycle))
            stopped = ~np.isin(codes, (status.OK, status.OVERFLOW))
            new_size = np.where(stopped, 0.0, self.size(ends))
            grows = new_size > _MIN_GROWTH * size[followed]
            growing[followed] = grows
            states[followed] = np.where(grows[:, None], ends, states[followed])
            size[followed] = new_size
        return size > bounds, states

    def cycle_maps(self, state: np.ndarray, cycles: int) -> np.ndarray:
        """Return the derivatives of the map of each cycle in scaled coordinates."""
        _, maps, code = self.propagator.maps(state, cycles * self.cycle, self.max_events)
        if code != status.OK:
            raise RuntimeError(status.MESSAGES[code])
        maps = self._reduction @ maps @ self.lift
        scaled = maps * self.weights[:, None] / self.weights
        maps_of_cycles = scaled.reshape(cycles, self.cycle, *maps.shape[1:])
        return np.array([compose(maps_of_cycle) for maps_of_cycle in maps_of_cycles])

    def __call__(self, states: np.ndarray, cycles: int) -> tuple:
        """Propagate states, shape (k, n), over cycles; return (final states, status codes).

        Where a code is not OK, the final state is NaN.
        """
        ends = np.full(states.shape, np.nan)
        codes = np.zeros(len(states), np.int64)
        size = max(1, min(self.propagator.chunk_size, -(-len(states) // self.threads)))
        parts = [slice(i, i + size) for i in range(0, len(states), size)]

        def propagate(part):
            periods = cycles * self.cycle
            ends[part], codes[part] = self.propagator.many(states[part], periods, self.max_events)

        if len(parts) < 2 or self.threads == 1:
            for part in parts:
                propagate(part)
        else:
            # The kernels release the interpreter lock; every state has rows of its own.
            with ThreadPoolExecutor(self.threads) as pool:
                list(pool.map(propagate, parts))
        ends[codes != status.OK] = np.nan
        return ends, codes


def check_one_mesh(model: Any) -> None:
    """Raise ValueError if a model has several meshes, so that two numbers are no initial state."""
    if model.mesh_names:
        raise ValueError(
            f"pair = {type(model).__name__} is not allowed here: it must have one mesh, whose "
            "displacement and velocity are the initial state"
        )


def grid_axes(grid: Any) -> tuple:
    """Return (displacements, velocities) of a grid of initial states, as float arrays, checked."""
    try:
        first, second = grid
    except (TypeError, ValueError):
        raise checks.refusal(
            "grid", grid, "two, displacements and velocities, each (first, last, count) or an array"
        ) from None
    axes = {"grid displacements": first, "grid velocities": second}
    counts = [
        checks.integer(f"count of the {name}", axis[2], 1) if _is_range(axis) else np.size(axis)
        for name, axis in axes.items()
    ]
    # The number of states is checked before any array is made.
    if (states := math.prod(counts)) > MAX_STATES:
        raise ValueError(
            f"grid of {counts[0]:,} x {counts[1]:,} = {states:,} initial states is not allowed: "
            f"they would take some {states * _BYTES_PER_STATE / 2**30:,.0f} GiB of memory; there "
            f"must be at most {MAX_STATES:,}, so take parts of the grid one after the other"
        )
    return tuple(_axis_values(name, axis) for name, axis in axes.items())


def _is_range(axis: Any) -> bool:
    """Return whether an axis of a grid is a tuple (first, last, count)."""
    return isinstance(axis, tuple) and len(axis) == 3


def _axis_values(name: str, axis: Any) -> np.ndarray:
    """Return the values of an axis of a grid: (first, last, count) or distinct numbers."""
    if not _is_range(axis):
        return distinct_values(name, axis)
    first, last = (
        checks.number(f"{end} of the {name}", value, "finite", math.isfinite)
        for end, value in zip(("first", "last"), axis, strict=False)
    )
    if last < first or (last == first) != (axis[2] == 1):
        raise ValueError(
            f"{name} = {axis!r} is not allowed: the last must be greater than the first, or "
            "equal to it with count 1"
        )
    return np.linspace(first, last, axis[2])


def distinct_values(name: str, values: Any) -> np.ndarray:
    """Return a non-empty sequence of distinct finite numbers as a float array, checked."""
    array = np.atleast_1d(float_array(values))
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise checks.refusal(name, values, "a non-empty sequence of finite numbers")
    if np.unique(array).size < array.size:
        raise ValueError(f"{name} = {values!r} is not allowed: its values must be all different")
    return array


def region_bounds(region: Any) -> np.ndarray:
    """Return ((x0, x1), (v0, v1)) of a region of initial states as an array, checked."""
    try:
        array = np.array([[low, high] for low, high in region], float)
        valid = array.shape == (2, 2) and np.isfinite(array).all() and (np.diff(array) > 0.0).all()
    except (TypeError, ValueError):
        valid = False
    if not valid:
        raise ValueError(
            f"region = {region!r} is not allowed: it must be ((lowest, highest displacement), "
            "(lowest, highest dx/dtau)), finite, the second greater"
        )
    return array


def grid_states(displacements: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """Return all states of a grid, shape (n m, 2), in which velocities vary fastest."""
    both = np.meshgrid(displacements, velocities, indexing="ij")
    return np.stack([axis.ravel() for axis in both], axis=1)
