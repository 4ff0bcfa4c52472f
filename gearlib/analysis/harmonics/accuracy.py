"""Errors of a periodic motion over harmonics, against the exact orbit."""

from typing import NamedTuple

import numpy as np

from gearlib.analysis.orbits.shooting import periodic_orbit
from gearlib.runs.simulation import simulate

#: Phases per mesh period at which courses are compared: at least, and for each harmonic. The
#: error of many harmonics lies within a wavelength of the last from the jumps of the stiffness.
_PHASES, _PER_HARMONIC = 512, 16


class Errors(NamedTuple):
    """Largest differences from the exact orbit."""

    displacement: float  #: over the period, static deflections
    velocity: float  #: of dx/dtau over the period
    state: float  #: at tau = 0, the larger of displacement and dx/dtau
    event: float  #: of the phases of flank crossings, rad; NaN if there are none, or others
    multiplier: float  #: of the largest |Floquet multiplier|


def errors(solution, orbit=None):
    """Return the `Errors` of a `PeriodicSolution`.

    Against the exact `Orbit`, by default the one that shooting finds from its state, or
    NoOrbit.
    """
    if orbit is None:
        orbit = periodic_orbit(
            solution.pair, solution.tuning, guess=solution.state, period=solution.period
        )
    count = max(_PHASES, _PER_HARMONIC * solution.harmonics // solution.period)
    x, v, phases, kinds = exact_course(orbit, count)
    found_x, found_v = solution.courses(count)
    found_phases, found_kinds = solution.crossings()
    event = np.nan
    if phases.size and found_kinds.shape == kinds.shape and (found_kinds == kinds).all():
        event = float(np.abs(found_phases - phases).max())
    largest = np.abs(orbit.multipliers).max()
    return Errors(
        float(np.abs(found_x - x).max()),
        float(np.abs(found_v - v).max()),
        float(np.abs(solution.state - orbit.state).max()),
        event,
        float(abs(np.abs(solution.multipliers).max() - largest)),
    )


def exact_course(orbit, samples_per_period):
    """Return displacement and dx/dtau over the period of an orbit, its events and their codes."""
    run = simulate(
        orbit.pair,
        orbit.tuning,
        periods=orbit.period,
        record_periods=orbit.period,
        samples_per_period=samples_per_period,
        initial_state=tuple(orbit.state),
    )
    kinds = np.column_stack([run.event_from.values, run.event_to.values])
    return run.displacement.values, run.velocity.values, run.event_phase.values, kinds
