"""`bifurcation_diagram`: stroboscopic states over a parameter, by brute force."""

import math

import numpy as np

from gearlib import checks, notebook
from gearlib.analysis.global_dynamics import grids
from gearlib.analysis.global_dynamics.poincare import check_phase, section
from gearlib.analysis.orbits.followed_parameters import name_parameter, varied
from gearlib.data import status
from gearlib.data.result import result
from gearlib.integrators import choose
from gearlib.kernels import orbit
from gearlib.runs.run_arguments import MAX_EVENTS, check_memory
from gearlib.runs.sweeping import DIRECTIONS


def bifurcation_diagram(
    pair,
    values,
    *,
    parameter="tuning",
    tuning=None,
    direction="cold",
    settle=500,
    strobes=64,
    phase=0.0,
    initial_state=(0.0, 0.0),
    max_events=MAX_EVENTS,
):
    """Record the stroboscopic states in which a mesh settles, over a parameter.

    Parameters
    ----------
    pair : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
    values : array_like of float, shape (n,)
        Of the parameter, all different.
    parameter : {"tuning", "damping", "backlash_damping", "backlash", "contact_ratio", \
"stiffness_ratio"}
        What is varied; a ratio other than the tuning is varied of a `GearPair`, the others held.
    tuning : float, optional
        Where another parameter is varied.
    direction : {"cold", "up", "down"}
        As of `gearlib.sweep`; six degrees of freedom go cold.
    settle, strobes : int
        Mesh periods before the record, and recorded.
    phase : float, default 0
        Mesh phase at which states are taken, as of `gearlib.poincare_section`.
    initial_state : tuple of float
    max_events : int
        As of `gearlib.simulate`.

    Returns
    -------
    xarray.Dataset
        Over the parameter under its name, in the order given: displacement, velocity
        (parameter, strobe); period as of `gearlib.sweep`, 0 if none; final_state; status.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    choose(pair, None, None)
    values = grids.values("values", values)
    checks.one_of("direction", direction, DIRECTIONS)
    if direction != "cold" and pair.size > 2:
        raise ValueError(
            f"direction = {direction!r} is not allowed for six degrees of freedom: it must be "
            "'cold', because only two of the states that would be carried along are known"
        )
    settle, strobes = checks.integer("settle", settle, 0), checks.integer("strobes", strobes, 1)
    initial_state = checks.state("initial_state", initial_state)
    phase, max_events = check_phase(phase), checks.integer("max_events", max_events, 1)
    words = f"strobes = {strobes} at {values.size} values"
    check_memory(words, strobes * values.size, 2, "in all")
    cases = varied(pair, tuning, parameter, values)
    states = np.full((values.size, strobes, 2), math.nan)
    ends, codes = np.empty((values.size, 2)), np.empty((values.size, 2), np.int64)
    order = np.argsort(values)
    if direction == "down":
        order = order[::-1]
    start = initial_state
    for i in notebook.counted("values", order, order.size):
        model, nu = cases[i]
        table, end, code = section(model, nu, np.array([start]), settle, strobes, phase, max_events)
        states[i], ends[i], codes[i, 1] = table[0], end[0], code[0]
        # Only whole records repeat; their range is the scale of the comparison.
        height = float(np.ptp(table[0, :, 0]))
        codes[i, 0] = 0 if code[0] else orbit.orbit_period(table[0], nu, height, model.repeats)
        start = tuple(end[0]) if direction != "cold" and code[0] == status.OK else initial_state
    data = {
        "displacement": ((parameter, "strobe"), states[..., 0]),
        "velocity": ((parameter, "strobe"), states[..., 1]),
        "final_state": ((parameter, "component"), ends),
        "period": (parameter, codes[:, 0].astype(np.int32)),
        "status": (parameter, codes[:, 1].astype(np.int8)),
    }
    coords = {
        parameter: values,
        "strobe": np.arange(settle, settle + strobes),
        "component": ["displacement", "velocity"],
    }
    dataset = result(
        "Bifurcation diagram of a gear mesh",
        pair,
        data,
        coords,
        method=choose(pair, None, None)[0],
        parameter=parameter,
        tuning=tuning,
        direction=direction,
        settle=settle,
        strobes=strobes,
        phase=phase,
        initial_state=initial_state,
    )
    return name_parameter(dataset, parameter)
