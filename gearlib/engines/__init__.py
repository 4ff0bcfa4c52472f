"""Engines: exact runs from event to event, and maps of mesh periods; a folder for each.

==================  ========================================================================
name                responsibility
==================  ========================================================================
``protocol``        what every engine offers
``pair``            one degree of freedom, linear damping: contact and flight in closed form
``linear``          many coordinates, events of all meshes: modes of their contacts
``taylor``          nonlinear mesh, pairs of teeth: Taylor steps of order 20
``exponential``     matrix exponentials by their series
``codes``           contact of a mesh, how a run ended
``polynomial``      first crossing and largest value of a polynomial, guaranteed
``orbit``           what is recorded of an orbit: extrema, fractions, samples, events
``copies``          copies between arrays
``growth``          growth of a small deviation under the maps of a run
``overflow``        states that are too large for floating-point numbers
``jit``             how every kernel is compiled
``cache``           folder of their machine code
==================  ========================================================================

Units: displacement in static deflections, time as mesh phase tau (2 pi per mesh period).
Kernels check nothing; the calls above them do.
"""


def warm_up():
    """Compile, or load, what `simulate` and `sweep` need for a `GearPair`; return the source hash.

    Parallel jobs that start without machine code would each compile these kernels, which nearly all
    share. The others are compiled by the first job that needs them: were they here, an edit of any
    of them would rerun every job.
    """
    import numpy as np

    from gearlib.engines.cache import source_hash
    from gearlib.engines.orbit import EVENT_COLUMNS, SAMPLE_COLUMNS, SUMMARY_COLUMNS
    from gearlib.engines.pair.many_runs import run_many
    from gearlib.engines.pair.motion import mesh
    from gearlib.engines.pair.pair_run import run

    ratios = np.array([1.2, 0.7, 1.8, 2.7, 0.06, 0.06, 4.0])
    rows = np.empty((1, SUMMARY_COLUMNS)), np.empty((1, 2)), np.empty((1, 2), dtype=np.int64)
    one = np.array([0.9]), np.argsort([0.9]), np.zeros(2)
    run_many(ratios, *one, False, 2, 1, 100, np.inf, *rows)
    samples, events = np.empty((4, SAMPLE_COLUMNS)), np.empty((4, EVENT_COLUMNS))
    run(mesh(ratios, 0.9), 0.0, 0.0, 2, 1, samples, events, 100, rows[0][0])
    return source_hash()
