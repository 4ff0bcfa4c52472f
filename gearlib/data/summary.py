"""Summary variables of orbits from the summary table of an engine."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.summary_columns import COLUMNS, COUNT, LARGEST, LEAST, SUM

#: Kind of a summary column -> function that combines the values of two records.
_COMBINATIONS = {LARGEST: np.maximum, LEAST: np.minimum, SUM: np.add, COUNT: np.add}


def summary_variables(model, dims, table, final_states, periods_and_statuses, record_periods):
    """Return the summary variables of one or more runs as a dict of name -> (dims, values).

    `dims` are the dimensions over the runs, () for one run. `table`, shape (..., columns), for
    trains (..., meshes, columns), has extrema and sums over the recorded `record_periods` mesh
    periods. `final_states`, shape (..., components), are the states at the end of the runs, and
    `periods_and_statuses`, shape (..., 2), hold the number of mesh periods after which each motion
    repeats and the status code of each run.
    """
    phase_span = 2.0 * math.pi * record_periods
    mesh_dims = (*dims, "mesh") if model.mesh_names else dims
    values = column_values(table, phase_span, record_periods)
    variables = {}
    for column in COLUMNS:
        if model.mesh_names or not column.trains_only:
            variables[column.name] = mesh_dims, values[column.name]
    variables |= model.extra_summary_variables(mesh_dims, table, phase_span)
    variables["period"] = dims, periods_and_statuses[..., 0].astype(np.int32)
    variables["status"] = dims, periods_and_statuses[..., 1].astype(np.int8)
    variables["final_state"] = (*dims, "component"), final_states
    return variables


def column_values(table, phase_span, periods) -> dict:
    """Return the columns of a summary table as a dict of name -> values, shape (...).

    `table` has the shape (..., columns). Columns with extrema are returned as they are, integrals
    are divided by `phase_span`, the length of the record in rad, and numbers of events by
    `periods`, the number of its mesh periods; both are numbers or arrays of shape (...).
    """
    divisors = {LARGEST: 1.0, LEAST: 1.0, SUM: phase_span, COUNT: periods}
    return {column.name: table[..., k] / divisors[column.kind] for k, column in enumerate(COLUMNS)}


def combined(table, start_rows):
    """Combine the summaries of successive records to one for each group, (groups, ..., columns).

    `table`, shape (records, ..., columns), has the summaries of the records, and `start_rows` are
    the indices of the rows at which groups start. Extrema are combined to extrema; integrals and
    counts are added.
    """
    columns = []
    for k, column in enumerate(COLUMNS):
        combination = _COMBINATIONS[column.kind]
        columns.append(combination.reduceat(table[..., k], start_rows))
    return np.stack(columns, axis=-1)


def largest_force(table):
    """Return the largest absolute mesh forces in a summary table (..., columns), shape (...)."""
    return np.maximum(table[..., orbit.FORCE_MAX], -table[..., orbit.FORCE_MIN])


def max_displacement(table):
    """Return the largest absolute displacement of all runs and meshes in a summary table."""
    return float(np.abs(table[..., [orbit.X_MAX, orbit.X_MIN]]).max())
