"""What propagators by matrix exponentials share: derivatives, by a second way along the motion."""

import numpy as np

from gearlib.kernels.codes import OK
from gearlib.models.propagators.base import Base
from gearlib.models.propagators.tangents import Walk

#: A distance this small, as a share of its parts, is zero.
_ON_LINE = 1e-14


class Matrices(Base):
    """A subclass gives `varied`, `motion` and `start_tangents`."""

    def varied(self, along):
        """Return the `Varied` of directions, dicts of `Model.direction`."""
        raise NotImplementedError

    def motion(self, z, periods, limit):
        """Return (`Motion` from z on, status)."""
        raise NotImplementedError

    def _walk(self, z, along, tangents, periods, limit, rates=False):
        motion, code = self.motion(np.array(z, float), periods, limit)
        return (Walk(self.varied(along), motion, tangents, rates) if code == OK else None), code

    def tangents(self, z, along, tangents, periods, limit):
        """Take tangents through mesh periods; see `Base.differentiate`."""
        walk, code = self._walk(z, along, tangents, periods, limit)
        if walk:
            walk.go()
            tangents[:] = walk.tangents
        return code

    def map_slopes(self, z, along, periods, limit):
        """Return (map of all periods, derivatives of its end by directions, status)."""
        n = len(z)
        tangents = np.hstack([np.eye(n), np.zeros((n, len(along)))])
        code = self.tangents(z, along, tangents, periods, limit)
        return tangents[:, :n], tangents[:, n:], code

    def map_rates(self, z, along, tangents, periods, limit):
        """Return (map of all periods, its rates, status); see `Base.differentiate`."""
        both = np.hstack([np.eye(len(z)), tangents])
        walk, code = self._walk(z, along, both, periods, limit, rates=True)
        if not walk:
            return None, None, code
        walk.go()
        return walk.tangents[:, : len(z)], walk.rates, code

    def differentiate(
        self, z, along, tangents, periods, recorded, limit, samples, events, extrema, times
    ):
        """Differentiate a run from z; see `Base.differentiate`."""
        walk, code = self._walk(z, along, tangents, periods, limit)
        if not walk:
            return 0, code, False, None
        record = walk.go(periods - recorded, len(samples) // recorded)
        if len(samples):
            samples[:] = record.samples
        for row, (phase, velocity) in zip(events, record.events, strict=False):
            row[:] = phase, velocity
        found, touching = record.extrema()
        extrema[:] = found.reshape(extrema.shape)
        times[:] = record.times.reshape(times.shape)
        return len(record.events), code, walk.grazing or touching, self.final(walk)

    def final(self, walk):
        """Return the derivatives of the final state of a run, as it is recorded."""
        return walk.tangents

    def one_sided(self, z, along, tangents):
        """Return whether a start on a flank line, where the damping jumps, moves off it."""
        varied = self.varied(along)
        motion, code = self.motion(np.array(z, float), 1, 10**6)
        if code != OK:
            return False
        return Walk(varied, motion, tangents).on_a_line(_ON_LINE)
