"""Stroboscopic map of a model for many states at once, and grids of initial states.

A *cycle* is the period of the equations of motion: one mesh period or, with run-out, the number of
mesh periods until the same teeth meet again. A periodic orbit of n cycles has n stroboscopic
points.
"""

import math
import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from gearlib import checks, parameters
from gearlib.analysis.orbits.shooting import compose
from gearlib.data import status
from gearlib.data.motions import as_float_array
from gearlib.integrators import choose_method
from gearlib.parameters import Count, Finite
from gearlib.runs.run_arguments import MAX_EVENTS

#: Motions larger than this, relative to the extent of the model, may grow without bound.
_MIN_RELATIVE_SIZE = 1e2
#: Factor by which such a motion must grow between two checks to be propagated further.
_MIN_GROWTH = 1.5
#: Largest number of initial states in a call; all of them are held in memory.
MAX_STATES = 50_000_000
#: Bytes of memory per state during a run: initial and final state, labels.
_BYTES_PER_STATE = 120


class Stroboscope:
    """Map of many states over whole cycles of the excitation of a model."""

    def __init__(self, model, tuning: float, *, max_events=MAX_EVENTS, threads=None):
        """Create the map of a `gearlib` model at a tuning (mesh frequency / natural frequency).

        A run stops if a mesh period has more than `max_events` contact events. `threads` is the
        number of threads, by default one per processor.
        """
        # The call raises ValueError unless a method supports the model.
        choose_method(model, name=None, options=None)
        self.model, self.tuning, self.max_events = model, tuning, max_events
        self.propagator = model.propagator(tuning)
        self.threads = threads or os.cpu_count() or 1
        self.mesh_periods_per_cycle = model.repeats
        #: Matrices that map full states to reduced states (without rigid-body rotation) and back.
        self._reduction, self.lift = model.reduction()
        #: Factors by which velocities become comparable with displacements.
        self.weights = np.repeat([1.0, self.tuning], len(self._reduction) // 2)

    def full_states(self, states: np.ndarray) -> np.ndarray:
        """Extend initial displacements and velocities, shape (k, 2), to full states, shape (k, n).

        A full state contains all coordinates and velocities. Additional coordinates, e.g. of
        bearings, start from their static deflections.
        """
        return np.array([self.propagator.initial_state(state) for state in states])

    def reduce_and_scale(self, states: np.ndarray) -> np.ndarray:
        """Remove the rigid-body rotation from full states and scale the velocities.

        The velocities dx/dtau of the `states`, shape (..., n), are multiplied by the tuning (mesh
        frequency / natural frequency), which makes them comparable with displacements.
        """
        return states @ self._reduction.T * self.weights

    def state_sizes(self, states: np.ndarray) -> np.ndarray:
        """Return the largest magnitude of the scaled components of each state, shape (k,).

        `states`, shape (k, n), are full states. The result is infinite for NaN, the state of a
        failed run.
        """
        largest = np.abs(self.reduce_and_scale(states)).max(axis=-1)
        return np.where(np.isnan(largest), np.inf, largest)

    def propagate_growing_motions(
        self, states, previous_sizes, bounds: np.ndarray, periods: int
    ) -> tuple:
        """Propagate large growing motions until they stop growing or exceed a bound.

        `states`, shape (k, n), are full states. `previous_sizes` are the `state_sizes` of these
        motions some mesh periods earlier, or 0 to treat all of them as growing. Motions with sizes
        above the `bounds`, shape (k,), are unbounded. Growth is checked every `periods` mesh
        periods, rounded up to whole cycles of the excitation. Small motions are not propagated.
        Return (mask of the unbounded motions, final states).
        """
        states, sizes = states.copy(), self.state_sizes(states)
        is_growing = sizes > _MIN_RELATIVE_SIZE * self.model.extent
        is_growing &= sizes > _MIN_GROWTH * previous_sizes
        cycles = -(-periods // self.mesh_periods_per_cycle)  # rounded up
        while (mask := is_growing & (sizes <= bounds)).any():
            final_states, status_codes = self(states[mask], cycles)
            has_failed = ~np.isin(status_codes, (status.OK, status.OVERFLOW))
            # A run that failed for another reason is not treated as growth.
            new_sizes = np.where(has_failed, 0.0, self.state_sizes(final_states))
            has_grown = new_sizes > _MIN_GROWTH * sizes[mask]
            is_growing[mask] = has_grown
            states[mask] = np.where(has_grown[:, None], final_states, states[mask])
            sizes[mask] = new_sizes
        return sizes > bounds, states

    def cycle_jacobians(self, state: np.ndarray, cycles: int) -> np.ndarray:
        """Return the Jacobian matrices of the map over each of the next cycles from a full state.

        A cycle is the period of the excitation. The matrices, shape (cycles, n, n), refer to the
        reduced and scaled states of `reduce_and_scale`. Raise RuntimeError if the run fails.
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
        """Propagate full states, shape (k, n), over a number of cycles in several threads.

        A cycle is the period of the excitation. Return (final states, status codes of
        `gearlib.data.status`, 0 if a run succeeds). The final state of a failed run is NaN.
        """
        final_states = np.full(states.shape, np.nan)
        status_codes = np.zeros(len(states), np.int64)
        periods = cycles * self.mesh_periods_per_cycle
        chunk_size = max(1, min(self.propagator.chunk_size, -(-len(states) // self.threads)))
        chunks = [slice(i, i + chunk_size) for i in range(0, len(states), chunk_size)]

        def propagate(chunk: slice) -> None:
            """Propagate a chunk of states and store its final states and status codes."""
            final_states[chunk], status_codes[chunk] = self.propagator.propagate_many(
                states[chunk], periods, self.max_events
            )

        # The kernels release the interpreter lock, and each chunk fills different rows.
        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(propagate, chunks))
        final_states[status_codes != status.OK] = np.nan
        return final_states, status_codes


def check_one_mesh(model: Any) -> None:
    """Raise ValueError if a model has several meshes.

    The displacement and velocity of a single mesh do not define the state of such a model.
    """
    allowed = "a model with one mesh, whose displacement and velocity are the initial state"
    checks.require(not model.mesh_names, "model", type(model).__name__, allowed)


def check_grid(grid: Any) -> tuple[np.ndarray, ...]:
    """Check a grid of initial states and return its axes (displacements, velocities) as arrays.

    `grid` is a pair of axes, each a tuple (first, last, count) or an array of values. Raise
    ValueError if an axis is invalid, or if the grid has more than `MAX_STATES` states.
    """
    try:
        displacement_axis, velocity_axis = grid
    except (TypeError, ValueError):
        raise checks.InputError(
            "grid",
            grid,
            "a pair of displacements and velocities, each (first, last, count) or an array",
        ) from None
    axes = {"grid displacements": displacement_axis, "grid velocities": velocity_axis}
    counts = []
    for name, axis in axes.items():
        if _is_range(axis):
            counts.append(parameters.check(f"count of the {name}", axis[2], Count))
        else:
            counts.append(as_float_array(axis).size)
    # The number of states is checked before arrays are allocated.
    state_count = math.prod(counts)
    if state_count > MAX_STATES:
        raise ValueError(
            f"grid of {counts[0]:,} x {counts[1]:,} = {state_count:,} initial states is not "
            f"allowed: it would need about {state_count * _BYTES_PER_STATE / 2**30:,.0f} GiB of "
            f"memory; at most {MAX_STATES:,} states are allowed, so split the grid"
        )
    return tuple(_axis_values(name, axis) for name, axis in axes.items())


def _is_range(axis: Any) -> bool:
    """Return whether an axis of a grid is a tuple (first, last, count)."""
    return isinstance(axis, tuple) and len(axis) == 3


def _axis_values(name: str, axis: Any) -> np.ndarray:
    """Check an axis of a grid of initial states and return its values as a float array.

    The axis is a tuple (first, last, count), which defines equidistant values, or a sequence of
    distinct numbers. `name` is its name in error messages. Raise ValueError if it is invalid.
    """
    if not _is_range(axis):
        return check_distinct_values(name, axis)
    first = parameters.check(f"first of the {name}", axis[0], Finite)
    last = parameters.check(f"last of the {name}", axis[1], Finite)
    if last < first or (last == first) != (axis[2] == 1):
        raise ValueError(
            f"{name} = {axis!r} is not allowed: last must be greater than first, or equal to first "
            "if count = 1"
        )
    return np.linspace(first, last, axis[2])


def check_distinct_values(name: str, values: Any) -> np.ndarray:
    """Check that a sequence contains distinct finite numbers and return it as an array, (n,).

    Raise ValueError otherwise; `name` is the name of the sequence in the message.
    """
    array = np.atleast_1d(as_float_array(values))
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise checks.InputError(name, values, "a non-empty sequence of finite numbers")
    if np.unique(array).size < array.size:
        raise ValueError(f"{name} = {values!r} is not allowed: the values must be distinct")
    return array


def grid_states(displacements: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """Return the states (displacement, velocity) of a grid, one per row, shape (n m, 2).

    The axes contain n displacements and m velocities; the velocity varies fastest.
    """
    axes = np.meshgrid(displacements, velocities, indexing="ij")
    return np.stack([axis.ravel() for axis in axes], axis=1)
