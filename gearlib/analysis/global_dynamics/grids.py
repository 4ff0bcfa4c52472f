"""Grids of initial states and sets of values: checked, with one sentence for what is wrong."""

import math

import numpy as np

from gearlib import checks
from gearlib.data.motions import floats

#: Most initial states of one call: all of them are held in memory.
MAX_STATES = 50_000_000
#: Bytes that a state takes while it is propagated: itself, its end, its labels.
_BYTES = 120


def check_one_mesh(model):
    """Refuse a model whose initial states are no pairs of numbers."""
    if model.mesh_names:
        raise ValueError(
            f"pair = {type(model).__name__} is not allowed here: it must have one mesh, whose "
            "displacement and velocity are the initial state"
        )


def initial_states(grid):
    """Return (displacements, velocities) of a grid of initial states, as float arrays.

    Too many states are refused before any is made.
    """
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
    if (states := math.prod(counts)) > MAX_STATES:
        raise ValueError(
            f"grid of {counts[0]:,} x {counts[1]:,} = {states:,} initial states is not allowed: "
            f"they would take some {states * _BYTES / 2**30:,.0f} GiB of memory; there must be at "
            f"most {MAX_STATES:,}, so take parts of the grid one after the other"
        )
    return tuple(_axis(name, axis) for name, axis in axes.items())


def _is_range(axis):
    """Return whether an axis of a grid is a tuple (first, last, count)."""
    return isinstance(axis, tuple) and len(axis) == 3


def _axis(name, axis):
    """Return one axis of a grid, (first, last, count) or different values, as a float array."""
    if not _is_range(axis):
        return values(name, axis)
    first, last = (
        checks.number(f"{word} of the {name}", value, "finite", math.isfinite)
        for word, value in zip(("first", "last"), axis, strict=False)
    )
    if last < first or (last == first) != (axis[2] == 1):
        raise ValueError(
            f"{name} = {axis!r} is not allowed: the last must be greater than the first, or "
            "equal to it with count 1"
        )
    return np.linspace(first, last, axis[2])


def values(name, given):
    """Return a non-empty sequence of different finite numbers as a float array."""
    array = np.atleast_1d(floats(given))
    if array.ndim != 1 or not array.size or not np.isfinite(array).all():
        raise checks.refusal(name, given, "a non-empty sequence of finite numbers")
    if np.unique(array).size < array.size:
        raise ValueError(f"{name} = {given!r} is not allowed: its values must be all different")
    return array


def region(given):
    """Return ((x0, x1), (v0, v1)) of a region of initial states, checked."""
    try:
        array = np.array([[low, high] for low, high in given], float)
        valid = array.shape == (2, 2) and np.isfinite(array).all() and (np.diff(array) > 0.0).all()
    except (TypeError, ValueError):
        valid = False
    if not valid:
        raise ValueError(
            f"region = {given!r} is not allowed: it must be ((lowest, highest displacement), "
            "(lowest, highest dx/dtau)), finite, the second greater"
        )
    return array


def mesh_states(displacements, velocities):
    """Return all states of a grid, shape (n m, 2), velocities running fastest."""
    both = np.meshgrid(displacements, velocities, indexing="ij")
    return np.stack([axis.ravel() for axis in both], axis=1)
