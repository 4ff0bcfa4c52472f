"""`poincare_section`: states at a fixed mesh phase; `bifurcation_diagram`: over a parameter."""

import math
from typing import Annotated

import numpy as np
from annotated_types import Ge, Lt

from gearlib import checks
from gearlib.analysis.global_dynamics.stroboscope import check_distinct_values, check_one_mesh
from gearlib.analysis.orbits.tracing import DimensionlessParameter, parameter_cases
from gearlib.data import status
from gearlib.data.motions import as_float_array
from gearlib.data.result import make_result
from gearlib.engines import orbit
from gearlib.integrators import choose_method
from gearlib.parameters import Count, State, Unit, WholeNumber, checked
from gearlib.progress import TimeLimit, with_progress_bar
from gearlib.runs.run_arguments import MAX_EVENTS, Direction, MaxSeconds, Tuning, check_memory

#: Largest number of recorded states of a section.
MAX_POINTS = 50_000_000
#: Largest number of motions whose sections are computed together.
_MAX_CHUNK_SIZE = 1024
#: Type of a mesh phase.
Phase = Annotated[float, Ge(0), Lt(2.0 * math.pi), Unit("rad")]


@checked
def poincare_section(
    model,
    tuning: Tuning,
    states,
    *,
    periods: Count,
    settle: WholeNumber = 0,
    phase: Phase = 0.0,
    max_events: Count = MAX_EVENTS,
    max_seconds: MaxSeconds = None,
):
    """Record the states of motions at a fixed phase of each mesh period.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
    tuning : float
        Ratio of mesh frequency to mean eigenfrequency, nu.
    states : array_like of float, shape (n, 2)
        Initial displacements in units of the static deflection and dx/dtau at tau = 0, one row per
        motion.
    periods : int
        Number of recorded mesh periods.
    settle : int, default 0
        Number of mesh periods of the transient, which is not recorded.
    phase : float, default 0
        Mesh phase of the section, from 0 to less than 2 pi; for models other than a `GearPair` a
        multiple of one degree.
    max_events : int
        Largest number of contact events in one mesh period.
    max_seconds : float, optional
        Time limit in seconds, after which the motions computed so far are returned, see
        `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        displacement, velocity (orbit, strobe); final_state (orbit, component) at the end of the
        last period, where tau is a multiple of 2 pi; status (orbit): if it is not 0, the run
        failed, and the states after the failure are NaN.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.
    """
    initial_states = np.atleast_2d(as_float_array(states))
    has_shape = initial_states.ndim == 2 and initial_states.shape[1] == 2 and len(initial_states)
    if not has_shape or not np.isfinite(initial_states).all():
        raise checks.InputError(
            "states",
            states,
            "rows of two finite numbers (displacement in units of the static deflection, dx/dtau)",
        )
    if len(initial_states) * periods > MAX_POINTS:
        raise ValueError(
            f"states x periods = {len(initial_states):,} x {periods:,} is not allowed: a section "
            f"can contain at most {MAX_POINTS:,} states"
        )
    time_limit = TimeLimit(max_seconds)
    method = choose_method(model, None, None)[0]
    # The time limit is checked between chunks; without a limit, large chunks are faster.
    chunk_size = 1 if time_limit.is_set else _MAX_CHUNK_SIZE
    chunks = [initial_states[i : i + chunk_size] for i in range(0, len(initial_states), chunk_size)]
    sections = [
        _compute_section(model, tuning, chunk, settle, periods, phase, max_events)
        for chunk in time_limit.iterate(with_progress_bar("chunks of states", chunks, len(chunks)))
    ]
    recorded = np.concatenate([section[0] for section in sections])
    final_states = np.concatenate([section[1] for section in sections])
    status_codes = np.concatenate([section[2] for section in sections])
    data = {
        "displacement": (("orbit", "strobe"), recorded[..., 0]),
        "velocity": (("orbit", "strobe"), recorded[..., 1]),
        "final_state": (("orbit", "component"), final_states),
        "status": ("orbit", status_codes.astype(np.int8)),
        "tuning": tuning,
        "phase": phase,
        **model.scales(),
    }
    coords = {
        "orbit": np.arange(len(status_codes)),
        "strobe": np.arange(settle, settle + periods),
        "component": ["displacement", "velocity"],
    }
    attributes = {"tuning": tuning, "phase": phase, "periods": periods, "settle": settle}
    title = "Poincare section of a gear mesh"
    dataset = make_result(title, model, data, coords, method=method, **attributes)
    return time_limit.record_missing(dataset, list(range(len(status_codes), len(initial_states))))


def _compute_section(model, tuning, initial_states, settle, periods, phase, max_events) -> tuple:
    """Compute the Poincare section of motions from `initial_states`, shape (n, 2).

    `tuning` is the ratio of mesh frequency to natural frequency. A state is (displacement x,
    dx/dtau) with the mesh phase tau. After a transient of `settle` mesh periods, states are
    recorded at the mesh phase `phase` in rad of each of `periods` mesh periods. A run fails if a
    mesh period has more than `max_events` contact events, or if the motion grows without bound.
    Return (recorded states, shape (n, periods, 2), final states, (n, 2), status codes, (n,)).
    States after a failure are NaN.
    """
    check_one_mesh(model)
    states = np.full((len(initial_states), periods, 2), math.nan)
    final_states = np.empty((len(initial_states), 2))
    status_codes = np.zeros(len(initial_states), np.int64)
    # The call fills its last three arguments.
    model.propagator(tuning).sections(
        initial_states, settle, phase, max_events, states, final_states, status_codes
    )
    for i, start in enumerate(initial_states):
        limit = model.displacement_limit(tuning, start)
        if status_codes[i] == status.OK and np.abs(states[i, :, 0]).max() > limit:
            states[i], status_codes[i] = math.nan, status.OVERFLOW
    final_states[status_codes != status.OK] = math.nan
    return states, final_states, status_codes


@checked
def bifurcation_diagram(
    model,
    values,
    *,
    parameter: DimensionlessParameter = "tuning",
    tuning: Tuning | None = None,
    direction: Direction = "cold",
    settle: WholeNumber = 500,
    strobes: Count = 64,
    phase: Phase = 0.0,
    initial_state: State = (0.0, 0.0),
    max_events: Count = MAX_EVENTS,
    max_seconds: MaxSeconds = None,
):
    """Record states of the steady motion at a fixed mesh phase for each value of a parameter.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or DeadZoneOscillator
    values : array_like of float, shape (n,)
        Values of the parameter, all different.
    parameter : {"tuning", "damping", "backlash_damping", "backlash_ratio", "contact_ratio", \
"stiffness_ratio"}
        Parameter that is varied; models other than a `GearPair` only have the tuning.
    tuning : float, optional
        Ratio of mesh frequency to mean eigenfrequency, if another parameter is varied.
    direction : {"cold", "up", "down"}
        With "cold", each run starts from the initial state; with "up" or "down", from the final
        state of the previous run for increasing or decreasing values. Six degrees of freedom allow
        only "cold".
    settle, strobes : int
        Numbers of mesh periods of the transient and of the record.
    phase : float, default 0
        Mesh phase at which states are recorded, as in `gearlib.poincare_section`.
    initial_state : tuple of float
        Displacement in units of the static deflection and dx/dtau.
    max_events : int
        Largest number of contact events in one mesh period.
    max_seconds : float, optional
        Time limit in seconds, after which the values computed so far are returned, see
        `gearlib.progress`.

    Returns
    -------
    xarray.Dataset
        Over a dimension with the name of the parameter, in the order of `values`: displacement,
        velocity (parameter, strobe); period in mesh periods, 0 if none; final_state; status.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.
    """
    method = choose_method(model, None, None)[0]
    values = check_distinct_values("values", values)
    allowed = "'cold' for six degrees of freedom, because the full final state is not recorded"
    checks.require(direction == "cold" or model.size == 2, "direction", direction, allowed)
    description = f"strobes = {strobes} at {values.size} values"
    check_memory(description, strobes * values.size, 2, "in all")
    cases = parameter_cases(model, tuning, parameter, values)
    section_arguments = settle, strobes, phase, max_events
    time_limit = TimeLimit(max_seconds)
    start_arguments = direction, section_arguments, initial_state
    states, final_states, table = _compute_diagram(cases, values, *start_arguments, time_limit)
    data = {
        "displacement": ((parameter, "strobe"), states[..., 0]),
        "velocity": ((parameter, "strobe"), states[..., 1]),
        "final_state": ((parameter, "component"), final_states),
        "period": (parameter, table[:, 0].astype(np.int32)),
        "status": (parameter, table[:, 1].astype(np.int8)),
    }
    coords = {
        parameter: values,
        "strobe": np.arange(settle, settle + strobes),
        "component": ["displacement", "velocity"],
    }
    attributes = {
        "parameter": parameter,
        "tuning": tuning,
        "direction": direction,
        "settle": settle,
    }
    attributes |= {"strobes": strobes, "phase": phase, "initial_state": initial_state}
    title = "Bifurcation diagram of a gear mesh"
    dataset = make_result(title, model, data, coords, method=method, **attributes)
    return time_limit.record_missing(dataset, **{parameter: table[:, 1] >= 0})


def _compute_diagram(
    cases, values, direction, section_arguments, initial_state, time_limit
) -> tuple:
    """Compute the Poincare section of the motion at each value of a parameter, v values.

    `cases` contains a (model, tuning) for each value. `section_arguments` are (mesh periods of the
    transient, recorded mesh periods, mesh phase in rad, largest number of contact events in a mesh
    period). With the direction "cold", each run starts from `initial_state`; with "up" or "down",
    it starts from the final state of the previous run, for increasing or decreasing values, or from
    `initial_state` if that run failed. Return (recorded states, shape (v, periods, 2), final
    states, (v, 2), table of orbit period and status code, (v, 2)). The status code is -1 for values
    that are not reached within the time limit.
    """
    _, periods, *_ = section_arguments
    states = np.full((values.size, periods, 2), math.nan)
    final_states, table = np.full((values.size, 2), math.nan), np.full((values.size, 2), -1)
    order = np.argsort(values)
    if direction == "down":
        order = order[::-1]
    state = initial_state
    for i in time_limit.iterate(with_progress_bar("values", order, order.size)):
        model, tuning = cases[i]
        section = _compute_section(model, tuning, np.array([state]), *section_arguments)
        states[i], final_states[i], code = (array[0] for array in section)
        displacement_range = float(np.ptp(states[i, :, 0]))
        period = 0
        if code == status.OK:
            period = orbit.orbit_period(states[i], tuning, displacement_range, model.repeats)
        table[i] = period, code
        is_warm_started = direction != "cold" and code == status.OK
        state = tuple(final_states[i]) if is_warm_started else initial_state
    return states, final_states, table
