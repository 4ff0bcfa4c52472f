"""What quantities are of each mesh, and which of several meshes counts."""

from typing import Any, NamedTuple

import numpy as np

from gearlib.kernels import orbit as columns
from gearlib.models.trains.statics import branches

#: Shares of the load.
SHARES = {"load_sharing", "least_load_sharing"}
#: Of several meshes the least value counts.
_LEAST = {"contact_margin", "least_load_sharing", "onset_of_contact_loss"}


class _Orbit(NamedTuple):
    """What `mean_forces` takes of an orbit."""

    pair: Any
    tuning: float
    period: int
    state: np.ndarray


def worst(name, values):
    """Return which mesh a quantity is of, shape (...), of values by mesh, shape (..., m)."""
    # There are no dynamic factors without load.
    if name in _LEAST:
        return np.argmin(np.where(np.isnan(values), np.inf, values), axis=-1)
    return np.argmax(np.where(np.isnan(values), -np.inf, values), axis=-1)


def measured(name, model, summary):
    """Return (number of a mesh, value) of all meshes that may count from a summary, SI."""
    table = np.atleast_2d(summary)
    meshes = range(len(table))
    if name == "transmission_error" and model.mesh_names:
        meshes = [model.mesh_names.index(model.reference)]
    found = []
    for mesh in meshes:
        row, scale = measure(name, model, mesh)
        found.append((mesh, row @ table[mesh, :4] * scale))
    return found


def share_slopes(model, tuning, z, period, names, moved):
    """Return the derivatives of the load sharing of every mesh of a train, shape (m, k)."""
    from gearlib.analysis.orbits.mean_forces import mean_forces

    forces, slopes = mean_forces(_Orbit(model, tuning, period, z), names, moved)
    groups, found = branches(model), np.empty_like(slopes)
    for group in set(groups):
        own = [j for j, other in enumerate(groups) if other == group]
        mean, rate = forces[own].mean(), slopes[own].mean(axis=0)
        found[own] = (slopes[own] - np.outer(forces[own] / mean, rate)) / mean
    return found


def measure(name, model, mesh):
    """Return what a quantity is of the extrema of a mesh, (4,), and its scale in SI."""
    row = np.zeros(4)
    if name in ("peak", "transmission_error"):
        row[columns.X_MAX] = 1.0
    if name in ("contact_margin", "transmission_error"):
        row[columns.X_MIN] = 1.0 if name == "contact_margin" else -1.0
    if row.any():
        return row, model.static_deflection
    row[columns.FORCE_MAX] = 1.0
    if name == "force":
        return row, model.load
    return row, 1.0 / model.mean_forces[mesh] if model.mesh_names else 1.0
