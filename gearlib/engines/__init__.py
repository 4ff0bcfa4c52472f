"""Engines: exact runs from event to event, and maps of mesh periods.

==================  ========================================================================
name                responsibility
==================  ========================================================================
``protocol``        common interface of all engines
``pair``            one degree of freedom, linear damping: closed forms with and without contact
``linear``          several coordinates and meshes: modes of each combination of contacts
``taylor``          nonlinear mesh, pairs of teeth: Taylor steps of order 20
``matrices``        copies, matrix exponentials, growth of perturbations under period maps
``codes``           contact states of a mesh, statuses of a run
``summary_columns`` columns of the summary of a run, with their names in datasets
``stable_repeats``  proof that a motion converges to a periodic orbit
``polynomial``      proven first crossing and largest value of a polynomial
``orbit``           record of an orbit: extrema, contact times, samples, events, period
``jit``             decorators that compile kernels, and the folder of their machine code
==================  ========================================================================

Displacements are in units of the static deflection, and the time is the mesh phase tau (2 pi per
mesh period). Kernels do not check their arguments; their callers do.
"""


def warm_up() -> str:
    """Compile or load the kernels of `simulate` and `sweep` for a `GearPair`; return a source hash.

    A kernel is a function that numba compiles. Nearly all runs need these kernels, and without
    machine code each parallel process would compile them. Other kernels are compiled on first use,
    because an edit of a kernel that is compiled here reruns every job of a workflow.
    """
    import numpy as np

    from gearlib.engines.jit import source_hash
    from gearlib.engines.orbit import EVENT_COLUMNS, SAMPLE_COLUMNS, SUMMARY_COLUMNS, Span
    from gearlib.engines.pair.motion import pair_constants_at_tuning
    from gearlib.engines.pair.pair_run import run, run_many
    from gearlib.engines.pair.whole_periods import allocate_workspace

    # Both stiffness levels, their lengths in phase, both damping ratios and the backlash. Only the
    # types of the values matter.
    pair_parameters = np.array([1.2, 0.7, 1.8, 2.7, 0.06, 0.06, 4.0])
    tuning, span = 0.9, Span(periods=2, recorded=1, max_events=100)
    # Tables with one row: summary, final state, and period with status.
    outcomes = np.empty((1, 2), dtype=np.int64)
    result_tables = np.empty((1, SUMMARY_COLUMNS)), np.empty((1, 2)), outcomes
    tunings, order, state = np.array([tuning]), np.argsort([tuning]), np.zeros(2)
    warm_start, max_x = False, np.inf
    workspace = allocate_workspace()
    run_many(
        pair_parameters, workspace, tunings, order, state, warm_start, span, max_x, *result_tables
    )
    samples, events = np.empty((4, SAMPLE_COLUMNS)), np.empty((4, EVENT_COLUMNS))
    tables = samples, events, span.max_events, result_tables[0][0]
    run(
        pair_constants_at_tuning(pair_parameters, tuning),
        workspace,
        *state,
        span.periods,
        span.recorded,
        *tables,
    )
    return source_hash()
