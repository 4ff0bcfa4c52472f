"""What propagators by matrix exponentials share: derivatives, by a second way along the motion."""

import numpy as np

from gearlib.kernels.codes import OK
from gearlib.kernels.slopes.turning_points import FOUND, TOUCHING
from gearlib.models.propagators.base import Base
from gearlib.models.propagators.tangents import Walk

#: A distance this small, as a share of its parts, is zero.
_ON_LINE = 1e-14


class Matrices(Base):
    """A subclass gives `slopes_along`, `motion` and `start_tangents`."""

    _last: tuple = (None, None)

    def slopes_along(self, along):
        """Return the `MatrixSlopes` of directions, dicts of `Model.direction`."""
        raise NotImplementedError

    def slopes(self, along):
        """Return the same; that of the last directions is kept."""
        if self._last[0] is not along:
            self._last = along, self.slopes_along(along)
        return self._last[1]

    def motion(self, z, periods, limit):
        """Return (`Motion` from z on, status)."""
        raise NotImplementedError

    def _walk(self, z, along, tangents, periods, limit, rates=False):
        motion, code = self.motion(np.array(z, float), periods, limit)
        return (Walk(self.slopes(along), motion, tangents, rates) if code == OK else None), code

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

    def differentiate(self, z, along, tangents, span, record):
        """Differentiate a run from z; see `Base.differentiate`."""
        (periods, recorded, limit), (samples, events, extrema, times) = span, record
        walk, code = self._walk(z, along, tangents, periods, limit)
        if not walk:
            return 0, code, False, False, None
        one_sided = walk.on_a_line(_ON_LINE)
        tables = walk.go(periods - recorded, len(samples) // recorded, len(events))
        samples[:], events[:] = np.swapaxes(tables.samples, 1, 2), tables.events
        extrema[:] = tables.extrema.reshape(extrema.shape)
        times[:] = tables.times.reshape(times.shape)
        grazing = walk.grazing or bool(tables.counts[TOUCHING])
        return int(tables.counts[FOUND]), code, grazing, one_sided, self.final(walk)

    def final(self, walk):
        """Return the derivatives of the final state of a run, as it is recorded."""
        return walk.tangents
