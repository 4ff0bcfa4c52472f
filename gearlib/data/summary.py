"""Variables of an orbit from the summary table of an engine."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.summary_columns import COLUMNS, COUNT, LARGEST, LEAST, SUM

_COMBINATIONS = {LARGEST: np.maximum, LEAST: np.minimum, SUM: np.add, COUNT: np.add}


def summary_variables(model, dims, table, final_states, periods_and_statuses, record_periods):
    """Return the summary variables of one or more runs as a dict of name -> (dims, values).

    `dims` are the dimensions over the runs, () for one run. `table`, shape (..., columns), for
    trains (..., meshes, columns), has the summaries of `record_periods` mesh periods;
    `periods_and_statuses`, shape (..., 2), are the period of each orbit and the status of each run.
    """
    span = 2.0 * math.pi * record_periods
    mesh_dims = (*dims, "mesh") if model.mesh_names else dims
    columns = column_values(table, span, record_periods)
    return {
        **{
            column.name: (mesh_dims, columns[column.name])
            for column in COLUMNS
            if model.mesh_names or not column.trains_only
        },
        **model.extra_summary_variables(mesh_dims, table, span),
        "period": (dims, periods_and_statuses[..., 0].astype(np.int32)),
        "status": (dims, periods_and_statuses[..., 1].astype(np.int8)),
        "final_state": ((*dims, "component"), final_states),
    }


def column_values(table, phase_span, periods) -> dict:
    """Return the values of summaries, shape (..., columns), as a dict of name -> values.

    Integrals are divided by the `phase_span` and numbers of events by the mesh `periods` of the
    record, both numbers or arrays of shape (...).
    """
    divisors = {LARGEST: 1.0, LEAST: 1.0, SUM: phase_span, COUNT: periods}
    return {column.name: table[..., k] / divisors[column.kind] for k, column in enumerate(COLUMNS)}


def combined(table, first_rows):
    """Return the summary of each group of successive records.

    `table`, shape (records, ..., columns), has their summaries; `first_rows` are the first rows of
    the groups.
    """
    columns = [
        _COMBINATIONS[column.kind].reduceat(table[..., k], first_rows)
        for k, column in enumerate(COLUMNS)
    ]
    return np.stack(columns, axis=-1)


def largest_force(table):
    """Return the largest mesh forces in summaries, without their signs, shape (...)."""
    return np.maximum(table[..., orbit.FORCE_MAX], -table[..., orbit.FORCE_MIN])


def max_displacement(table):
    """Return the largest absolute displacement of all meshes in a summary table."""
    return float(np.abs(table[..., [orbit.X_MAX, orbit.X_MIN]]).max())
