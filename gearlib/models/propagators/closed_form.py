"""Scalar closed forms between events: a `GearPair`."""

import numpy as np

from gearlib.kernels.closed_form import many_runs, map_rates, pair_run, sections, sensitivity
from gearlib.kernels.closed_form.mesh_constants import mesh
from gearlib.kernels.closed_form.pair_maps import vary
from gearlib.models.propagators.base import Base
from gearlib.models.stiffness import levels, segment_lengths

#: What a direction says of: `GearPair.RATIOS`, the tuning and the start.
_DIRECTIONS = (
    "contact_ratio",
    "stiffness_ratio",
    "damping_ratio",
    "backlash_damping_ratio",
    "backlash_ratio",
    "tuning",
    "initial_displacement",
    "initial_velocity",
)


def ratios(pair):
    """Return the dimensionless ratios of a `GearPair`, shape (7,), in the order of `mesh`.

    Of a pair whose numbers are arrays of shape (k,), shape (7, k).
    """
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

    `directions`, shape (k, 8): the same for `_DIRECTIONS`.
    """
    contact, stiffness, *rest = np.transpose(directions)[:6]
    high = levels(pair.contact_ratio, pair.stiffness_ratio)[0]
    mean = (1.0 - pair.stiffness_ratio) * contact + (2.0 - pair.contact_ratio) * stiffness
    higher = -high * high * mean
    lower = pair.stiffness_ratio * higher + high * stiffness
    return np.column_stack([higher, lower, np.pi * contact, -2.0 * np.pi * contact, *rest])


class Propagator(Base):
    """A `GearPair` at one tuning."""

    chunk, proves_periods = 2048, True
    nowhere = np.zeros(len(_DIRECTIONS))

    def __init__(self, model, tuning):
        super().__init__(model, tuning)
        self.mesh = mesh(ratios(model), tuning)

    def run(self, z, *arguments, first=0):
        """Run from z; see `Base.run`."""
        *z[:], period, events, found, code = pair_run.run(self.mesh, *z, *arguments)
        # Closed forms evaluate no right-hand side: 0.
        return *z, period, events, found, code, 0

    @staticmethod
    def run_many(model, tunings, order, state, carry, span, rows):
        """Run many tunings in one call of the kernel."""
        begin = np.array(state), carry
        many_runs.run_many(ratios(model), tunings, order, *begin, *span, *rows)

    @staticmethod
    def run_designs(pairs, tunings, order, states, carry, span, rows):
        """Run many pairs in one call of the kernel, see `Base.run_designs`."""
        table = np.ascontiguousarray(ratios(pairs).T)
        many_runs.run_designs(table, tunings, order, states, carry, *span, *rows)

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        *z[:], code = vary(self.mesh, *z, periods, limit, maps)
        return code

    @staticmethod
    def directions(model, names):
        """Return directions, shape (k, 8); see `Base.directions`."""
        found = np.zeros((len(names), len(_DIRECTIONS)))
        for row, name in zip(found, names, strict=True):
            if name in _DIRECTIONS[5:]:
                row[_DIRECTIONS.index(name)] = 1.0
            else:
                row[:5] = model.ratio_slopes(name)
        return found

    @staticmethod
    def along_branch(model, names):
        """Return directions, shape (k, 8): one ratio changes and the others stay."""
        own = {"damping": "damping_ratio", "backlash": "backlash_ratio"}
        own["backlash_damping"] = "backlash_damping_ratio"
        return np.eye(len(_DIRECTIONS))[[_DIRECTIONS.index(own.get(name, name)) for name in names]]

    def start_tangents(self, state, directions):
        """Return what the start changes by, shape (2, k); see `Base.differentiate`."""
        return directions[:, 6:].T.copy()

    def _one_sided(self, z, directions, tangents):
        pair = self.model
        if pair.damping_ratio == pair.backlash_damping_ratio or z[0] not in pair.flank_lines:
            return False
        return bool((tangents[0] + (directions[:, 4] if z[0] else 0.0)).any())

    def switches(self, mesh):
        """Return the phases of switches, rising, 2 pi the last; see `Base.differentiate`."""
        half_high, whole_low = segment_lengths(self.model.contact_ratio)
        return np.array([0.0, half_high, half_high + whole_low, 2.0 * np.pi])

    def differentiate(self, z, directions, tangents, span, record):
        """Differentiate a run from z; see `Base.differentiate`."""
        directions = np.asarray(directions)
        one_sided = self._one_sided(z, directions, tangents)
        constants = slopes(self.model, directions)
        found, code, grazing = sensitivity.differentiate(
            self.mesh, constants, *z, tangents, *span, *record
        )
        if self.model.contact_ratio in (1.0, 2.0):
            # A segment of the other stiffness appears, on which the force jumps.
            record[2][2:, directions[:, 0] != 0.0] = np.nan
        return found, code, grazing, one_sided, tangents

    def tangents(self, z, directions, tangents, periods, limit):
        """Take tangents through mesh periods; see `Base.differentiate`."""
        constants = slopes(self.model, directions)
        return sensitivity.go_through(self.mesh, constants, *z, tangents, periods, limit)

    def map_slopes(self, z, directions, periods, limit):
        """Return (map, derivatives of its end, status); see `Base.differentiate`."""
        both = np.vstack([np.zeros((2, len(_DIRECTIONS))), directions])
        tangents = np.hstack([np.eye(2), np.zeros((2, len(directions)))])
        code = self.tangents(z, both, tangents, periods, limit)
        return tangents[:, :2], tangents[:, 2:], code

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
