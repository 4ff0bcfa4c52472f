"""Runs over many tunings and initial states; states of many orbits at a phase of every period."""

import math

import numpy as np

from gearlib.engines import orbit
from gearlib.engines.codes import EVENT_LIMIT, OK, OVERFLOW
from gearlib.engines.jit import kernel
from gearlib.engines.orbit import is_within_range
from gearlib.engines.pair import sampling
from gearlib.engines.pair.events import ARC_COLUMNS, START
from gearlib.engines.pair.motion import contact_of, mesh_at_tuning
from gearlib.engines.pair.pair_run import (
    period_status,
    run_unrecorded,
    run_whole_period,
    run_with_storage,
)
from gearlib.engines.pair.whole_periods import new_work, set_mesh, set_start


@kernel
def run_many(
    pair_parameters, tunings, order, state, warm_start, span, max_x, summaries, ends, outcomes
):
    """Run a gear pair at the tunings ``tunings[order]`` and fill a row of each table per tuning.

    `pair_parameters`, shape (7,), are those of `mesh_at_tuning`. Each run lasts a `Span` and starts
    from `state`, shape (2,), or, with `warm_start`, from the end of the last run unless that has
    failed. A displacement beyond `max_x` gives the status OVERFLOW. The tables have a row for each
    run: `summaries`, final states `ends`, (n, 2), and `outcomes`, int, (n, 2): period and status.
    """
    samples = np.empty((0, orbit.SAMPLE_COLUMNS))
    events = np.empty((0, orbit.EVENT_COLUMNS))
    work = new_work()
    x, v = state[0], state[1]
    for i in order:
        mesh = mesh_at_tuning(pair_parameters, tunings[i])
        set_mesh(work, mesh)
        arguments = samples, events, span.max_events, summaries[i]
        x, v, period, _, _, status = run_with_storage(
            mesh, work, x, v, span.periods, span.recorded, *arguments
        )
        if status == OK and max(summaries[i, orbit.X_MAX], -summaries[i, orbit.X_MIN]) > max_x:
            status = OVERFLOW
        if status != OK:
            summaries[i, :] = math.nan
            ends[i, :] = math.nan
        else:
            ends[i, 0], ends[i, 1] = x, v
        if status != OK or not warm_start:
            x, v = state[0], state[1]
        outcomes[i, 0], outcomes[i, 1] = period, status


@kernel
def run_many_states(mesh, states, periods, max_arcs, ends, statuses):
    """Run a `PairConstants` from many `states`, shape (k, 2), through a number of mesh periods from
    tau = 0.

    Fills the final states `ends`, shape (k, 2), and `statuses`, shape (k,). A period with more than
    `max_arcs` arcs ends a run.
    """
    work = new_work()
    set_mesh(work, mesh)
    for i in range(states.shape[0]):
        x, v = states[i, 0], states[i, 1]
        status = OVERFLOW
        if is_within_range(x, v):
            set_start(work, x, v)
            _, x, v, status, _, _ = run_unrecorded(
                mesh, work, contact_of(mesh.backlash_ratio, x, v), x, v, periods, max_arcs
            )
        ends[i, 0], ends[i, 1], statuses[i] = x, v, status


@kernel
def fill_sections(mesh, states, settle_periods, phase, max_arcs, table, ends, statuses):
    """Fill `table`, shape (n, periods, 2), with states of n motions at one phase of each period.

    The motions of the `PairConstants` start from `states`, shape (n, 2), at tau = 0;
    `settle_periods` pass before the first row. `phase` lies in [0, 2 pi). Final states go to
    `ends`, shape (n, 2), and `statuses`, shape (n,), are filled. A period with more than `max_arcs`
    arcs ends a motion; its later rows stay unchanged.
    """
    work, arcs = new_work(), np.empty((16, ARC_COLUMNS))
    set_mesh(work, mesh)
    for j in range(states.shape[0]):
        x, v, status = states[j, 0], states[j, 1], OVERFLOW
        if is_within_range(x, v):
            set_start(work, x, v)
            contact = contact_of(mesh.backlash_ratio, x, v)
            contact, x, v, status, _, _ = run_unrecorded(
                mesh, work, contact, x, v, settle_periods, max_arcs
            )
            for row in range(table.shape[1]):
                if status != OK:
                    break
                contact, x, v, arc_count, arcs = run_whole_period(
                    mesh, work, settle_periods + row, contact, x, v, max_arcs, arcs
                )
                status = period_status(x, v, arc_count, max_arcs)
                if status == EVENT_LIMIT:
                    break
                i = 0
                while i + 1 < arc_count and arcs[i + 1, START] <= phase:
                    i += 1
                table[j, row, 0], table[j, row, 1], _, _ = sampling.state_in_arc(
                    mesh, arcs[i], phase
                )
        ends[j, 0], ends[j, 1], statuses[j] = x, v, status
