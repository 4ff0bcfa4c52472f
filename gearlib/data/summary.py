"""From the summary table of the kernels to named variables."""

import math

import numpy as np

from gearlib.data.motion_words import not_settled
from gearlib.engines import orbit


def variables(pair, dims, table, ends, codes, record_periods):
    """Return name -> (dims, values) of orbit summaries.

    `dims` lead those of the variables, () for one run; `table` are summaries as of
    `Model.empty_record`, shape (..., 9) or (..., m, 10) of m meshes, over so many recorded periods;
    `ends`, shape (..., k), are final states; `codes`, shape (..., 2), period of the orbit and
    status.
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
    over = (*dims, "mesh") if pair.mesh_names else dims
    named = {name: (over, values) for name, values in columns.items()}
    named |= pair.more_summary(over, table, span)
    named["period"] = (dims, codes[..., 0].astype(np.int32))
    named["status"] = (dims, codes[..., 1].astype(np.int8))
    named["final_state"] = ((*dims, "component"), ends)
    return named


def reach(table):
    """Return the largest distance from the flank line in a summary, of all meshes."""
    return float(np.abs(table[..., [orbit.X_MAX, orbit.X_MIN]]).max())


def in_words(run):
    """Return in a sentence what the motion of a run of `gearlib.simulate` is."""
    if int(run.status):
        return run.status.attrs["message"]
    period = int(run.period)
    motion = f"repeats every {period} mesh periods" if period > 1 else "repeats every mesh period"
    if not period:
        motion = f"has {not_settled(run)}"
    contact = "the flanks never part"
    if float(run.fraction_inverse) > 0.0:
        contact = "it strikes both flanks"
    elif float(run.bounces) > 0.0:
        times = f"{float(run.bounces):.3g} times"
        contact = f"it loses contact {'once' if times == '1 times' else times} per mesh period"
    return f"The motion from rest {motion}; {contact}."
