"""Scalar closed forms between events: a `GearPair`."""

import numpy as np

from gearlib.kernels.closed_form import many_runs, map_rates, run, sections, sensitivity
from gearlib.kernels.closed_form.mesh import mesh
from gearlib.kernels.closed_form.variation import vary
from gearlib.models.propagators.base import Base
from gearlib.models.stiffness import levels, segment_lengths


def ratios(pair):
    """Return the dimensionless ratios of a `GearPair`, shape (7,), in the order of `mesh`."""
    return np.array(
        [
            *levels(pair.contact_ratio, pair.stiffness_ratio),
            *segment_lengths(pair.contact_ratio),
            pair.damping_ratio,
            pair.backlash_damping_ratio,
            pair.backlash_ratio,
        ]
    )


def slopes(pair, directions):
    """Return what the constants of the mesh change by, shape (k, 8): those of `mesh`, the tuning.

    `directions`, shape (k, 6): the same for `GearPair.RATIOS` and the tuning.
    """
    contact, stiffness, *rest = np.transpose(directions)
    high = levels(pair.contact_ratio, pair.stiffness_ratio)[0]
    mean = (1.0 - pair.stiffness_ratio) * contact + (2.0 - pair.contact_ratio) * stiffness
    higher = -high * high * mean
    lower = pair.stiffness_ratio * higher + high * stiffness
    return np.column_stack([higher, lower, np.pi * contact, -2.0 * np.pi * contact, *rest])


class Propagator(Base):
    """A `GearPair` at one tuning."""

    chunk = 2048

    def __init__(self, model, tuning):
        super().__init__(model, tuning)
        self.mesh = mesh(ratios(model), tuning)

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        *z[:], period, events, found, code = run.run(self.mesh, *z, *arguments)
        # Closed forms evaluate no right-hand side: 0.
        return *z, period, events, found, code, 0

    @staticmethod
    def run_many(model, tunings, order, state, *arguments):
        """Run many tunings in one call of the kernel."""
        many_runs.run_many(ratios(model), tunings, order, np.array(state), *arguments)

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        *z[:], code = vary(self.mesh, *z, periods, limit, maps)
        return code

    def differentiate(self, z, directions, tangents, *arguments):
        """Differentiate a run from z; see `Base.differentiate`."""
        constants = slopes(self.model, directions)
        return sensitivity.differentiate(self.mesh, constants, *z, tangents, *arguments)

    def tangents(self, z, directions, tangents, periods, limit):
        """Take tangents through mesh periods; see `Base.differentiate`."""
        constants = slopes(self.model, directions)
        return sensitivity.go_through(self.mesh, constants, *z, tangents, periods, limit)

    def map_rates(self, z, directions, tangents, periods, limit):
        """Return (map of all periods, its rates, status); see `Base.differentiate`."""
        matrix, rates = np.empty((2, 2)), np.empty((len(directions), 2, 2))
        constants = slopes(self.model, directions)
        *_, code = map_rates.vary_along(
            self.mesh, constants, *z, tangents, periods, limit, matrix, rates
        )
        return matrix, rates, code

    def skip(self, states, periods, limit, ends, codes):
        """Take many states on; see `Base.skip`."""
        many_runs.skip_many(self.mesh, np.ascontiguousarray(states), periods, limit, ends, codes)

    def sections(self, *arguments):
        """Fill the states at one phase of every period."""
        sections.section(self.mesh, *arguments)
