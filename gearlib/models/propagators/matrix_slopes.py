"""The matrices of a piecewise-linear model and what they change by, for every direction.

Stacks of arrays have the model itself first, and then, for each direction, the model a little off
the real axis, see `gearlib.models.derivatives`. States are by phase: coordinates, their rates by
tau, and what drives them, the constant 1 and harmonics.
"""

import numpy as np

from gearlib.kernels.codes import INVERSE, NORMAL
from gearlib.kernels.slopes.itinerary import Places
from gearlib.models.derivatives import STEP


def parts(stack):
    """Return (values, slopes) of a stack, of shapes (...) and (k, ...)."""
    return stack[0].real.copy(), stack[1:].imag / STEP


class MatrixSlopes:
    """What `gearlib.models.propagators.tangents` asks for.

    Parameters
    ----------
    systems : list of TrainSystem
        That of the model, and those off the real axis, k of them.
    size : int
        Components that move.
    switches : ndarray, shape (m, k)
        By what the switches of each mesh move, those at which it becomes softer.
    outputs : list of ndarray, shape (e, 3, p, n)
        Further functionals that are recorded, of each system.
    position : ndarray, shape (k + 1, m, n), optional
        Displacements that are recorded; by default the distances from the drive-side flanks.
    """

    def __init__(self, systems, size, switches, outputs, position=None):
        self.system, self.size, self.switches = systems[0], size, switches
        self.course = np.zeros(len(systems) - 1)
        one = self.system
        self.tuning, self.repeats = one.tuning, one.repeats
        #: Phase of the longest step of a Taylor series, |A| times it being REACH.
        self.longest = one.longest * one.tuning
        #: Where the stiffness switches, and what distinguishes matrices.
        self.places = Places(one.effect, one.low.astype(bool), one.starts, one.first_segment)
        self._free, self._push, self._grip, self._stiffness, self.near, self.far = (
            np.array([getattr(one, name) for one in systems]) + 0j
            for name in ("free", "push", "grip", "stiffness", "near", "far")
        )
        self.position = self.near if position is None else position
        half, every = size // 2, np.array([one.tuning for one in systems])
        # From rates by theta to rates by phase.
        scale = np.ones(self.near.shape[::2], complex)
        scale[:, half : 2 * half] = every[:, None]
        self._scale = scale[:, None, :] / scale[:, :, None] / every[:, None, None]
        self._free *= self._scale
        self._outputs = np.array(outputs) + 0j
        # An infinite backlash stays infinite.
        self._outputs[~np.isfinite(self._outputs).all(axis=-1)] = 0.0
        #: Code of a flank -> (functionals, slopes), shapes (m, n), (k, m, n).
        self.lines = {NORMAL: parts(self.near), INVERSE: parts(self.far)}
        self._added: dict = {}

    def _of_mesh(self, mesh, effect):
        """Return (what a mesh adds to the matrix, its slopes, the stack of both)."""
        if (mesh, effect) not in self._added:
            push, grip = self._push[:, mesh, effect], self._grip[:, mesh, effect]
            stack = (np.swapaxes(push, 1, 2) @ grip) * self._scale
            self._added[mesh, effect] = *parts(stack), stack
        return self._added[mesh, effect]

    def effects(self, codes, segments):
        """Return what distinguishes the matrix, (m,), for codes and segments of all meshes."""
        return self.places.effect[np.add(codes, 1), segments, np.arange(len(codes))].tolist()

    def matrix(self, codes, segments):
        """Return (matrix, slopes), shapes (n, n) and (k, n, n)."""
        matrix, slopes = parts(self._free)
        for mesh, effect in enumerate(self.effects(codes, segments)):
            if effect:
                more, moved, _ = self._of_mesh(mesh, effect)
                matrix += more
                slopes += moved
        return matrix, slopes

    def stiffness(self, codes, segments):
        """Return the stack of the stiffness of all meshes, shape (k + 1, m)."""
        return self._stiffness[:, np.add(codes, 1), segments, np.arange(len(codes))]

    def rows(self, codes, segments):
        """Return the functionals that are recorded, and their slopes, (r, n) and (k, r, n).

        Displacement, velocity, acceleration and force of all meshes, m rows each; `outputs`.
        """
        matrix, over = self._free.copy(), np.array(codes)[:, None]
        for mesh, effect in enumerate(self.effects(codes, segments)):
            matrix += self._of_mesh(mesh, effect)[2]
        speed = self.position @ matrix
        line = np.where(over == NORMAL, self.near, np.where(over == INVERSE, self.far, 0.0))
        force = self.stiffness(codes, segments)[:, :, None] * line
        # Outputs of several meshes do not depend on contact and segment.
        outputs = self._outputs[:, :, codes[0] + 1, segments[0]]
        every = self.position, speed, speed @ matrix, force, outputs
        return parts(np.concatenate(every, axis=1))

    def speed(self, flank, mesh):
        """Return the rate of a distance from a flank, whatever the contacts, shape (n,)."""
        return (self.lines[flank][0][mesh] @ self._free[0]).real

    def jump(self, flank, mesh, before, after):
        """Return by what dz/dtau falls at a flank line, over the speed, and its slopes.

        `before` and `after` are effects of the mesh. The mesh force is zero on the line; the
        damping, which jumps, is proportional to the speed d' = row A z: so it is (A - A+) y with
        row y = 0 and row A y = 1, whatever z. Shapes (n,) and (k, n).
        """
        row = (self.near if flank == NORMAL else self.far)[:, mesh]
        both = np.stack([row, (row[:, None] @ self._free)[:, 0]], axis=1)
        turned = np.swapaxes(both, 1, 2)
        y = turned @ np.linalg.inv(both @ turned)[:, :, 1:]
        fall = self._of_mesh(mesh, before)[2] - self._of_mesh(mesh, after)[2]
        return parts((fall @ y)[:, :, 0])

    def difference(self, mesh, before, after):
        """Return by what the matrix falls where a mesh goes from one effect to another."""
        return self._of_mesh(mesh, before)[0] - self._of_mesh(mesh, after)[0]

    def moves(self, code, mesh, before, after):
        """Return by what the switch of a mesh in contact between two segments moves, shape (k,).

        Where friction turns, the stiffness stays, and the phase too.
        """
        low = self.places.low[code + 1, :, mesh].astype(float)
        return self.switches[mesh] * (low[after] - low[before])
