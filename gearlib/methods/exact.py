"""The exact propagator: closed forms between events, for linear damping and rectangular stiffness.

One degree of freedom goes by scalar closed forms (`gearlib.kernels.closed_form.run`); with harmonic
excitation, and six degrees of freedom, by matrix exponentials
(`gearlib.kernels.piecewise_linear.run`).
"""

import numpy as np

from gearlib.kernels.closed_form import many_runs as many
from gearlib.kernels.closed_form import run as core_run
from gearlib.kernels.closed_form.mesh import mesh
from gearlib.kernels.piecewise_linear import run as linear
from gearlib.kernels.piecewise_linear.system import ORDER as _ORDER
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.methods.each import run_each
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.oscillator import OneDegree
from gearlib.models.pair import GearPair
from gearlib.models.six_degrees import SixDegreePair
from gearlib.models.stiffness import levels, stretches

ORDER = None
EVENTS = "phases end at switches and crossings, which are isolated by proof"
MODELS = "linear damping with rectangular stiffness, one or six degrees of freedom"
OPTIONS = {}
#: Below, the rest position of the softer stretch lies so far away that the scalar closed forms,
#: which are written about it, lose more than four digits.
_LEAST_STIFFNESS_RATIO = 1e-4
_TO_BERNSTEIN = bernstein_matrix(_ORDER)


def takes(pair):
    """Return whether the phases of a model have closed forms."""
    if isinstance(pair, OneDegree):
        return pair.is_piecewise_linear()
    return isinstance(pair, (GearPair, SixDegreePair))


def ratios(pair):
    """Return the dimensionless ratios of a `GearPair`, shape (7,), in the order of `mesh`."""
    return np.array(
        [
            *levels(pair.contact_ratio, pair.stiffness_ratio),
            *stretches(pair.contact_ratio),
            pair.damping_ratio,
            pair.backlash_damping_ratio,
            pair.backlash_ratio,
        ]
    )


def run(pair, tuning, state, *arguments):
    """Run one tuning; see `gearlib.methods`."""
    # Closed forms evaluate no right-hand side: 0.
    if _is_scalar(pair):
        return *core_run.run(mesh(ratios(pair), tuning), *state, *arguments), 0
    pair = _with_matrices(pair)
    system, outputs = pair.system(tuning)
    z = pair.initial(system, state)
    part = pair.part(system)
    return *linear.run_linear(system, part, outputs, _TO_BERNSTEIN, z, *arguments), 0


def run_many(pair, tunings, order, state, *arguments):
    """Run many tunings; see `gearlib.methods`."""
    if _is_scalar(pair):
        many.run_many(ratios(pair), tunings, order, np.array(state), *arguments)
    else:
        _run_many_linear(_with_matrices(pair), tunings, order, state, *arguments)


def _is_scalar(pair):
    return isinstance(pair, GearPair) and pair.stiffness_ratio >= _LEAST_STIFFNESS_RATIO


def _with_matrices(pair):
    return OneDegreePair(pair=pair) if isinstance(pair, GearPair) else pair


def _run_many_linear(pair, tunings, order, state, *arguments):
    z, first = None, 0

    def run_one(tuning, current, periods, *rest):
        nonlocal z, first
        system, outputs = pair.system(tuning)
        # All coordinates are carried along, not only the two of the final state, and the gears stay
        # where they have turned to.
        if current is state:
            z, first = pair.initial(system, state), 0
        system = system._replace(first=first)
        first = (first + periods) % pair.repeats
        part = pair.part(system)
        return *linear.run_linear(system, part, outputs, _TO_BERNSTEIN, z, periods, *rest), 0

    run_each(run_one, tunings, order, state, *arguments)
