"""Summary variables of runs from the summary table of an engine."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.summary_columns import COLUMNS, COUNT, LARGEST, LEAST, SUM

#: Kind of a summary column -> ufunc that combines the values of two records.
_COMBINING_UFUNCS = {LARGEST: np.maximum, LEAST: np.minimum, SUM: np.add, COUNT: np.add}


def summary_variables(model, dims, table, final_states, periods_and_statuses, record_periods):
    """Return the summary variables of one or more runs as a dict of name -> (dims, values).

    `dims` are the dimensions over the runs, () for one run. `table` has extrema and sums over the
    `record_periods` recorded mesh periods, shape (..., columns), or (..., meshes, columns) for
    trains. `final_states`, shape (..., components), are the states at the end of the runs.
    `periods_and_statuses`, shape (..., 2), has for each run the number of mesh periods after which
    the motion repeats, and the status code.
    """
    phase_span = 2.0 * math.pi * record_periods
    mesh_dims = (*dims, "mesh") if model.mesh_names else dims
    values = normalize_columns(table, phase_span, record_periods)
    variables = {}
    for column in COLUMNS:
        if model.mesh_names or not column.trains_only:
            variables[column.name] = mesh_dims, values[column.name]
    variables |= model.extra_summary_variables(mesh_dims, table, phase_span)
    variables["period"] = dims, periods_and_statuses[..., 0].astype(np.int32)
    variables["status"] = dims, periods_and_statuses[..., 1].astype(np.int8)
    variables["final_state"] = (*dims, "component"), final_states
    return variables


def normalize_columns(table, phase_span, periods) -> dict:
    """Convert integrals of a summary table to means; return a dict of name -> values, shape (...).

    `table` has the shape (..., columns). Integrals are divided by `phase_span`, the length of the
    record in rad, and counts by `periods`, its number of mesh periods; both are numbers or have the
    shape (...). Extrema are unchanged.
    """
    divisors = {LARGEST: 1.0, LEAST: 1.0, SUM: phase_span, COUNT: periods}
    return {column.name: table[..., k] / divisors[column.kind] for k, column in enumerate(COLUMNS)}


def combine_records(table, start_rows):
    """Combine the summaries of consecutive records; return shape (groups, ..., columns).

    `table` has one summary per record, shape (records, ..., columns). Groups of records start at
    the rows `start_rows`. Integrals and counts are added; of extrema, the extremum is taken.
    """
    columns = []
    for k, column in enumerate(COLUMNS):
        ufunc = _COMBINING_UFUNCS[column.kind]
        columns.append(ufunc.reduceat(table[..., k], start_rows))
    return np.stack(columns, axis=-1)


def largest_force(table):
    """Return the largest absolute mesh forces in a summary table (..., columns), shape (...)."""
    return np.maximum(table[..., orbit.FORCE_MAX], -table[..., orbit.FORCE_MIN])


def max_displacement(table):
    """Return the largest absolute displacement in a summary table, over all runs and meshes."""
    return float(np.abs(table[..., [orbit.X_MAX, orbit.X_MIN]]).max())
