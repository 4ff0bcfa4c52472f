"""Quantities of each mesh, and which of several meshes counts."""

import numpy as np

from gearlib.kernels import orbit as columns

#: Shares of the load.
SHARES = {"load_sharing", "least_load_sharing"}
#: Of several meshes the least value counts.
_LEAST = {"contact_margin", "least_load_sharing"}


def worst(name, values):
    """Return the number of the mesh that counts for a quantity, of its values by mesh, (m,)."""
    # There are no dynamic factors without load.
    if name in _LEAST:
        return np.argmin(np.where(np.isnan(values), np.inf, values))
    return np.argmax(np.where(np.isnan(values), -np.inf, values))


def measured(name, model, summary):
    """Return the values of a quantity of all meshes that may count, from a summary, SI."""
    table = np.atleast_2d(summary)
    meshes = range(len(table))
    if name == "transmission_error" and model.mesh_names:
        meshes = [model.mesh_names.index(model.reference)]
    return [_measure(name, model, mesh, table[mesh]) for mesh in meshes]


def _measure(name, model, mesh, row):
    """Return the value of a quantity of one mesh, from its row of a summary."""
    if name == "contact_margin":
        return row[columns.X_MIN] * model.static_deflection
    if name == "transmission_error":
        return (row[columns.X_MAX] - row[columns.X_MIN]) * model.static_deflection
    if name == "force":
        return row[columns.FORCE_MAX] * model.load
    return row[columns.FORCE_MAX] / (model.mean_forces[mesh] if model.mesh_names else 1.0)
