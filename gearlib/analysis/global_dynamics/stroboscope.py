"""Stroboscopic map of a model for many states at once, and grids of initial states.

One *cycle* is the period of the equations of motion: one mesh period, with run-out as many as it
takes until the same teeth meet again. A periodic orbit of n cycles is n points of the map.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from gearlib import checks, parameters
from gearlib.analysis.orbits.shooting import compose
from gearlib.data import status
from gearlib.data.motions import float_array
from gearlib.integrators import choose_method
from gearlib.parameters import Count, Finite
from gearlib.runs.run_arguments import MAX_EVENTS

#: Motions larger than this, relative to the extent of the model, may grow without bound.
_MIN_RELATIVE_SIZE = 1e2
#: Factor by which such a motion must grow repeatedly, up to `Model.bound`.
_MIN_GROWTH = 1.5
#: Largest number of initial states in a call: all of them are held in memory.
MAX_STATES = 50_000_000
#: Bytes of memory for a state during a run: initial and final state, labels.
_BYTES_PER_STATE = 120


class Stroboscope:
    """Map of many states over whole cycles of the excitation of a model."""

    def __init__(self, model, tuning: float, *, max_events=MAX_EVENTS, threads=None):
        """Create the map of a `gearlib` model at a tuning, mesh frequency over natural frequency.

        A run stops if a mesh period has more than `max_events` contact events. `threads` is the
        number of threads, by default one for each processor.
        """
        # Raises ValueError unless a method supports the model.
        choose_method(model, name=None, options=None)
        self.model, self.tuning, self.max_events = model, tuning, max_events
        self.propagator = model.propagator(tuning)
        self.threads = threads or os.cpu_count() or 1
        self.mesh_periods_per_cycle = model.repeats
        #: Matrices from full states to states without the free rotation (rigid-body motion) of all
        #: shafts, and back.
        self._reduction, self.lift = model.reduction()
        #: Factors by which velocities become comparable with displacements.
        self.weights = np.repeat([1.0, self.tuning], len(self._reduction) // 2)

    def start(self, states: np.ndarray) -> np.ndarray:
        """Return the full states, shape (k, n), of displacements and velocities, shape (k, 2)."""
        return np.array([self.propagator.initial_state(state) for state in states])

    def scaled(self, states: np.ndarray) -> np.ndarray:
        """Return states without the free rotation, with velocities scaled to displacements."""
        return states @ self._reduction.T * self.weights

    def size(self, states: np.ndarray) -> np.ndarray:
        """Return the largest scaled coordinate of each state, shape (k,); infinite for NaN."""
        size = np.abs(self.scaled(states)).max(axis=-1)
        return np.where(np.isnan(size), np.inf, size)

    def follow_growth(self, states, previous_sizes, bounds: np.ndarray, periods: int) -> tuple:
        """Propagate large growing states, shape (k, n), until they stop growing or exceed a bound.

        `previous_sizes` are their sizes some mesh periods earlier (0: all have grown), `bounds`
        their limits, shape (k,). Growth is checked again every `periods` mesh periods,
        rounded up to whole cycles. Return (mask of the states above their bounds, states).
        """
        states, sizes = states.copy(), self.size(states)
        is_growing = sizes > _MIN_RELATIVE_SIZE * self.model.extent
        is_growing &= sizes > _MIN_GROWTH * previous_sizes
        cycles = -(-periods // self.mesh_periods_per_cycle)
        while (mask := is_growing & (sizes <= bounds)).any():
            ends, codes = self(states[mask], cycles)
            has_failed = ~np.isin(codes, (status.OK, status.OVERFLOW))
            new_sizes = np.where(has_failed, 0.0, self.size(ends))
            has_grown = new_sizes > _MIN_GROWTH * sizes[mask]
            is_growing[mask] = has_grown
            states[mask] = np.where(has_grown[:, None], ends, states[mask])
            sizes[mask] = new_sizes
        return sizes > bounds, states

    def cycle_maps(self, state: np.ndarray, cycles: int) -> np.ndarray:
        """Return the Jacobian matrices of the cycles after a full state, shape (cycles, n, n).

        They refer to the coordinates of `scaled`.
        """
        periods = cycles * self.mesh_periods_per_cycle
        _, period_maps, code = self.propagator.maps(state, periods, self.max_events)
        if code != status.OK:
            raise RuntimeError(status.MESSAGES[code])
        reduced = self._reduction @ period_maps @ self.lift
        scaled = reduced * self.weights[:, None] / self.weights
        by_cycle = scaled.reshape(cycles, self.mesh_periods_per_cycle, *scaled.shape[1:])
        return np.array([compose(maps_of_cycle) for maps_of_cycle in by_cycle])

    def __call__(self, states: np.ndarray, cycles: int) -> tuple[np.ndarray, np.ndarray]:
        """Propagate full states, shape (k, n), over cycles; return (final states, status codes)."""
        ends = np.full(states.shape, np.nan)
        codes = np.zeros(len(states), np.int64)
        periods = cycles * self.mesh_periods_per_cycle
        size = max(1, min(self.propagator.chunk_size, -(-len(states) // self.threads)))
        chunks = [slice(i, i + size) for i in range(0, len(states), size)]

        def propagate(chunk: slice) -> None:
            """Fill the final states and status codes of a chunk of the states."""
            ends[chunk], codes[chunk] = self.propagator.propagate_many(
                states[chunk], periods, self.max_events
            )

        # The kernels release the interpreter lock, and each chunk fills different rows.
        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(propagate, chunks))
        ends[codes != status.OK] = np.nan
        return ends, codes


def check_one_mesh(model: Any) -> None:
    """Raise ValueError if a model has several meshes: its state has more than two components.

    The message refers to the model by the name `model` of the argument of the callers.
    """
    allowed = "of one mesh, whose displacement and velocity are the initial state"
    checks.require(not model.mesh_names, "model", type(model).__name__, allowed)


def grid_axes(grid: Any) -> tuple[np.ndarray, ...]:
    """Return the (displacements, velocities) of a grid of initial states as float arrays.

    Each of the two axes of `grid` is a tuple (first, last, count) or an array of values; invalid
    ones raise ValueError.
    """
    try:
        displacement_axis, velocity_axis = grid
    except (TypeError, ValueError):
        raise checks.refusal(
            "grid", grid, "two, displacements and velocities, each (first, last, count) or an array"
        ) from None
    axes = {"grid displacements": displacement_axis, "grid velocities": velocity_axis}
    counts = [
        parameters.check(f"count of the {name}", axis[2], Count)
        if _is_range(axis)
        else float_array(axis).size
        for name, axis in axes.items()
    ]
    # The number of states is checked before arrays are allocated.
    state_count = math.prod(counts)
    if state_count > MAX_STATES:
        raise ValueError(
            f"grid of {counts[0]:,} x {counts[1]:,} = {state_count:,} initial states is not "
            f"allowed: they would take some {state_count * _BYTES_PER_STATE / 2**30:,.0f} GiB of "
            f"memory; there must be at most {MAX_STATES:,}, so take parts of the grid one after "
            "the other"
        )
    return tuple(_axis_values(name, axis) for name, axis in axes.items())


def _is_range(axis: Any) -> bool:
    """Return whether an axis of a grid is a tuple (first, last, count)."""
    return isinstance(axis, tuple) and len(axis) == 3


def _axis_values(name: str, axis: Any) -> np.ndarray:
    """Return the values of a grid axis that is a tuple (first, last, count) or distinct numbers.

    `name` is the name of the axis in error messages.
    """
    if not _is_range(axis):
        return distinct_values(name, axis)
    first = parameters.check(f"first of the {name}", axis[0], Finite)
    last = parameters.check(f"last of the {name}", axis[1], Finite)
    if last < first or (last == first) != (axis[2] == 1):
        raise ValueError(
            f"{name} = {axis!r} is not allowed: the last must be greater than the first, or "
            "equal to it with count 1"
        )
    return np.linspace(first, last, axis[2])


def distinct_values(name: str, values: Any) -> np.ndarray:
    """Return a sequence of distinct finite numbers as an array; otherwise raise ValueError.

    `name` is the name of the argument in error messages.
    """
    array = np.atleast_1d(float_array(values))
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise checks.refusal(name, values, "a non-empty sequence of finite numbers")
    if np.unique(array).size < array.size:
        raise ValueError(f"{name} = {values!r} is not allowed: its values must be all different")
    return array


def grid_states(displacements: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """Return all states (displacement, velocity) of a grid, shape (n m, 2).

    The velocity varies fastest.
    """
    axes = np.meshgrid(displacements, velocities, indexing="ij")
    return np.stack([axis.ravel() for axis in axes], axis=1)
