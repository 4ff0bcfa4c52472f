"""A piecewise-linear model with what its matrices change by, for every direction.

Stacks of arrays have the model itself first, and then, for each direction, the model a little off
the real axis, see `gearlib.models.derivatives`. States are by phase: coordinates, their rates by
tau, and what drives them, the constant 1 and harmonics.
"""

from functools import cached_property

import numpy as np

from gearlib.kernels.codes import BACKLASH, INVERSE, NORMAL
from gearlib.kernels.slopes.itinerary import Places
from gearlib.models.derivatives import STEP


def parts(stack):
    """Return (values, slopes) of a stack, of shapes (...) and (k, ...)."""
    return stack[0].real.copy(), stack[1:].imag / STEP


class Varied:
    """What `gearlib.models.propagators.tangents` asks for; subclasses say how matrices are made.

    Contact codes and segments of all meshes, a tuple of m each, say which matrix counts.
    """

    near: np.ndarray  #: stack of the displacements over the drive-side flanks, (k + 1, m, n)
    far: np.ndarray  #: and over the coast-side flanks
    position: np.ndarray  #: and of those that are recorded
    size: int  #: components that move
    tuning: float
    #: By what the switches of each mesh move, those at which it becomes softer, shape (m, k).
    switches: np.ndarray
    repeats: int  #: mesh periods after which the places repeat
    places: Places  #: where the stiffness switches, and what distinguishes matrices

    def __init__(self):
        self._matrices, self._rows, self._jumps = {}, {}, {}

    def stack(self, effects):
        """Return the stack of matrices dz/dtau of some `effects`, shape (k + 1, n, n)."""
        raise NotImplementedError

    def effects(self, codes, segments):
        """Return what distinguishes the matrix."""
        raise NotImplementedError

    def stiffness(self, codes, segments):
        """Return the stack of the stiffness of all meshes, shape (k + 1, m)."""
        raise NotImplementedError

    def low(self, code, segment, mesh):
        """Return whether a mesh in contact is at its lower stiffness."""
        raise NotImplementedError

    def longest(self, segments):
        """Return the phase of the longest step of a Taylor series, |A| times it being REACH."""
        raise NotImplementedError

    def cuts(self, number):
        """Return (phase, segment) of the segments of a mesh period, from its start on."""
        raise NotImplementedError

    def outputs(self, codes, segments):
        """Return a stack of further functionals that are recorded, shape (k + 1, e, n)."""
        raise NotImplementedError

    @cached_property
    def lines(self):
        """Code of a flank -> (functionals, slopes), shapes (m, n), (k, m, n)."""
        return {NORMAL: parts(self.near), INVERSE: parts(self.far)}

    def matrix(self, codes, segments):
        """Return (matrix, slopes), shapes (n, n) and (k, n, n)."""
        effects = self.effects(codes, segments)
        if effects not in self._matrices:
            self._matrices[effects] = parts(self.stack(effects))
        return self._matrices[effects]

    def rows(self, codes, segments):
        """Return the functionals that are recorded, and their slopes, (r, n) and (k, r, n).

        Displacement, velocity, acceleration and force of all meshes, m rows each; `outputs`.
        """
        key = codes, segments
        if key not in self._rows:
            matrix = self.stack(self.effects(codes, segments))
            speed = self.position @ matrix
            over = np.array(codes)[:, None]
            line = np.where(over == NORMAL, self.near, np.where(over == INVERSE, self.far, 0.0))
            force = self.stiffness(codes, segments)[:, :, None] * line
            every = self.position, speed, speed @ matrix, force, self.outputs(codes, segments)
            self._rows[key] = parts(np.concatenate(every, axis=1))
        return self._rows[key]

    def jump(self, before, after, flank, mesh):
        """Return by what dz/dtau falls at a flank line, over the speed, and its slopes.

        `before` and `after` are (codes, segments). The mesh force is zero on the line; the damping,
        which jumps, is proportional to the speed d' = row A z: so it is (A - A+) y with row y = 0
        and row A y = 1, whatever z. Shapes (n,) and (k, n).
        """
        one, other = self.effects(*before), self.effects(*after)
        key = one, other, flank, mesh
        if key not in self._jumps:
            matrix = self.stack(one)
            row = (self.near if flank == NORMAL else self.far)[:, mesh]
            both = np.stack([row, (row[:, None] @ matrix)[:, 0]], axis=1)
            turned = np.swapaxes(both, 1, 2)
            y = turned @ np.linalg.inv(both @ turned)[:, :, 1:]
            self._jumps[key] = parts(((matrix - self.stack(other)) @ y)[:, :, 0])
        return self._jumps[key]

    def moves(self, code, mesh, before, after):
        """Return by what the switch of a mesh between two segments moves, (k,); None: no switch."""
        if code == BACKLASH:
            return None
        first, last = self.low(code, before, mesh), self.low(code, after, mesh)
        if first == last:
            return None
        return self.switches[mesh] if last else -self.switches[mesh]
