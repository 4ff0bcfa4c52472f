"""The exact propagator: closed forms between events."""

import numpy as np

from gearlib.core import run as core_run
from gearlib.core.mesh import mesh
from gearlib.pair import GearPair
from gearlib.stiffness import levels, stretches


def takes(pair):
    """Return whether the phases of a model have the closed forms."""
    return isinstance(pair, GearPair)


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
    return core_run.run(mesh(ratios(pair), tuning), *state, *arguments)


def run_many(pair, tunings, order, state, *arguments):
    """Run many tunings; see `gearlib.methods`."""
    core_run.run_many(ratios(pair), tunings, order, np.array(state), *arguments)
