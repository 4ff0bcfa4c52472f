"""Variables of an orbit from the summary table of an engine."""

import math

import numpy as np

from gearlib.engines import orbit


def variables(model, dims, table, ends, codes, record_periods):
    """Return name -> (dims, values) of orbits, whose variables lead with `dims`, () for one run.

    `table`, shape (..., 9) or (..., meshes, 10), has the summaries of `Model.empty_record` over the
    recorded periods; `ends`, shape (..., k), are final states; `codes`, shape (..., 2), are periods
    of the orbits and statuses.
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
        "period": (dims, codes[..., 0].astype(np.int32)),
        "status": (dims, codes[..., 1].astype(np.int8)),
        "final_state": ((*dims, "component"), ends),
    }


def reach(table):
    """Return the largest distance from the flank line in a summary, of all meshes."""
    return float(np.abs(table[..., [orbit.X_MAX, orbit.X_MIN]]).max())
