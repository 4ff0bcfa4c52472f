"""Compiled kernels: floats and arrays only.

====================  =============================================================
module                responsibility
====================  =============================================================
``jit``               how every kernel is compiled
``cache``             where its machine code is kept, for any number of processes
``oscillator``        contact: closed form of the damped linear oscillator
``flight``            backlash: closed form of the free flight under load and oil drag
``crossing``          first crossing of a flank line, proven to be the first
``mesh``              all constants of one mesh at one tuning
``march``             the plain march: arc by arc through a stretch of constant stiffness
``transit``           the fast march through periods nobody looks at
``orbit``             what is recorded of an orbit: extrema, fractions, samples, events
``run``               a whole run: its periods gone through fast, those at its end recorded
``elementary``        exp, sine and cosine as plain arithmetic
``lanes``             many bouncing orbits in lockstep
``many``              runs over many tunings or states: one after the other, or in lanes
``polynomial``        first crossing and largest value of a polynomial, isolated
``series``            nonlinear mesh: Taylor series of its motion
``system``            many coordinates: matrices and Taylor series
``passage``           many coordinates: the fast march through periods nobody looks at
``linear``            many coordinates: the plain march, a whole run
``nonlinear``         nonlinear mesh: the march in Taylor steps, a whole run
``variation``         growth of small deviations, one degree of freedom
``linear_variation``  growth of small deviations, many coordinates
``growth``            growth of a deviation carried along by maps
``sections``          states of many orbits at one mesh phase of every period
``field``             nonlinear mesh: its equation of motion at one phase and state
``steps``             fixed steps over switches and contact, a whole run
``embedded``          an embedded pair under step control, a whole run
``recording``         what is recorded of a run in steps
====================  =============================================================

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

    from gearlib.core.cache import source_hash
    from gearlib.core.many import run_many
    from gearlib.core.mesh import mesh
    from gearlib.core.orbit import EVENT_COLUMNS, SAMPLE_COLUMNS, SUMMARY_COLUMNS
    from gearlib.core.run import run

    ratios = np.array([1.2, 0.7, 1.8, 2.7, 0.06, 0.06, 4.0])
    rows = np.empty((1, SUMMARY_COLUMNS)), np.empty((1, 2)), np.empty((1, 2), dtype=np.int64)
    run_many(ratios, np.array([0.9]), np.argsort([0.9]), np.zeros(2), False, 2, 1, 100, *rows)
    samples, events = np.empty((4, SAMPLE_COLUMNS)), np.empty((4, EVENT_COLUMNS))
    run(mesh(ratios, 0.9), 0.0, 0.0, 2, 1, samples, events, 100, rows[0][0])
    return source_hash()
