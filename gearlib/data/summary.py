"""Variables of an orbit from the summary table of an engine."""

import math

import numpy as np

from gearlib.engines import orbit


def summary_variables(model, dims, table, final_states, periods_and_statuses, record_periods):
    """Return the summary variables of one or more runs as a dict of name -> (dims, values).

    `dims` are the dimensions over the runs, () for one run. `table`, shape (..., columns), for
    trains (..., meshes, columns), has the extrema and times in contact over `record_periods` mesh
    periods, in the columns of `gearlib.engines.orbit`; `periods_and_statuses`, shape (..., 2), are
    the period of each orbit and the status of each run.
    """
    span = 2.0 * math.pi * record_periods
    columns = {
        "displacement_max": table[..., orbit.X_MAX],
        "displacement_min": table[..., orbit.X_MIN],
        "dynamic_force_max": table[..., orbit.FORCE_MAX],
        "dynamic_force_min": table[..., orbit.FORCE_MIN],
        "fraction_normal": table[..., orbit.TIME_NORMAL] / span,
        "fraction_backlash": table[..., orbit.TIME_BACKLASH] / span,
        "fraction_inverse": table[..., orbit.TIME_INVERSE] / span,
        "fraction_min_stiffness": table[..., orbit.TIME_LOW] / span,
        "bounces": table[..., orbit.BOUNCES] / record_periods,
    }
    mesh_dims = (*dims, "mesh") if model.mesh_names else dims
    return {
        **{name: (mesh_dims, values) for name, values in columns.items()},
        **model.extra_summary_variables(mesh_dims, table, span),
        "period": (dims, periods_and_statuses[..., 0].astype(np.int32)),
        "status": (dims, periods_and_statuses[..., 1].astype(np.int8)),
        "final_state": ((*dims, "component"), final_states),
    }


def largest_force(table):
    """Return the largest mesh forces in summaries, without their signs, shape (...)."""
    return np.maximum(table[..., orbit.FORCE_MAX], -table[..., orbit.FORCE_MIN])


def max_displacement(table):
    """Return the largest absolute displacement of all meshes in a summary table."""
    return float(np.abs(table[..., [orbit.X_MAX, orbit.X_MIN]]).max())
