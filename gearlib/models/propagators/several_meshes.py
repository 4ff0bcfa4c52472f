"""Gear trains: matrix exponentials between the events of all meshes."""

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.codes import OK
from gearlib.kernels.piecewise_linear.system import ORDER
from gearlib.kernels.polynomial import bernstein_matrix
from gearlib.kernels.several_meshes.combinations import (
    Combinations,
    combinations,
    forget,
    forget_lengths,
)
from gearlib.kernels.several_meshes.grid import grid_of
from gearlib.kernels.several_meshes.run import run_train
from gearlib.models.propagators.base import Base

_TO_BERNSTEIN = bernstein_matrix(ORDER)


class Propagator(Base):
    """A gear train at one tuning; its tables fill as it runs, so that threads need one each."""

    words = "matrix exponentials"
    chunk = 1

    def __init__(self, model, tuning, other=None):
        super().__init__(model, tuning)
        self.system = system = model.system(tuning)
        self.grid = grid_of(system)
        m, n = system.near.shape
        lengths = int(self.grid.kind.max()) + 1
        self.components, self.pieces = n, int(self.grid.substeps.sum())
        # Between coordinates and their rates by phase, and those by theta of the kernels.
        self.scale = np.repeat([1.0, tuning], model.size // 2)
        if other is not None and other.tables.at.shape[1] >= lengths:
            self.tables: Combinations = other.tables
            fields = ("free", "near", "push", "grip")
            pairs = [(getattr(system, name), getattr(other.system, name)) for name in fields]
            if all(np.array_equal(new, old) for new, old in pairs):
                forget_lengths(self.tables.known, self.tables.at)
            else:
                forget(self.tables.known, self.tables.slots, self.tables.at)
        else:
            self.tables = combinations(n, model.size // 2, m, lengths)

    def at(self, tuning):
        """Return the propagator of another tuning; it takes the tables over, see `Base.at`."""
        return Propagator(self.model, tuning, self)

    def start(self, state):
        """Return the state z; see `Base.start`."""
        return self.model.start_state(state)

    def _go(self, z, periods, record_periods, samples, events, limit, summary, maps, first):
        full = np.zeros(self.components)
        full[: z.size] = z * self.scale
        system = self.system._replace(first=first)
        done = run_train(
            system,
            self.grid,
            self.tables,
            _TO_BERNSTEIN,
            full,
            periods,
            record_periods,
            samples,
            events,
            limit,
            summary,
            maps,
        )
        z[:] = full[: z.size] / self.scale
        return done

    def run(self, z, periods, record_periods, samples, events, limit, summary, first=0):
        """Run from z; see `Base.run`. Samples have the columns of `GearTrain.room`."""
        m, n = self.system.near.shape
        raw = np.empty((len(samples), n + m + 1))
        none = np.empty((0, z.size, z.size))
        period, events, found, code = self._go(
            z, periods, record_periods, raw, events, limit, summary, none, first
        )
        if code == OK and len(samples):
            self.fill(raw, samples)
        half = z.size // 2
        return z[:half].copy(), z[half:].copy(), period, events, found, code, 0

    def fill(self, raw, samples):
        """Fill samples, shape (k, 6 m + N), from states, contact codes and segments."""
        system, nu = self.system, self.system.tuning
        m, n = system.near.shape
        state, code, p = raw[:, :n], raw[:, n : n + m].astype(int), raw[:, -1].astype(int)
        effect = np.take_along_axis(system.effect[:, p, :], code[None] + 1, axis=0)[0]
        which = np.arange(m)
        push, grip = system.push[which, effect], system.grip[which, effect]
        forces = np.einsum("kjtn,kn->kjt", grip, state)
        rate = state @ system.free.T + np.einsum("kjt,kjtn->kn", forces, push)
        stiffness = np.take_along_axis(system.stiffness[:, p, :], code[None] + 1, axis=0)[0]
        near, far = state @ system.near.T, state @ system.far.T
        columns = samples[:, : 6 * m].reshape(-1, m, 6)
        columns[..., orbit.SAMPLE_X] = near
        columns[..., orbit.SAMPLE_V] = state @ self.grid.rate.T / nu
        columns[..., orbit.SAMPLE_A] = rate @ self.grid.rate.T / nu**2
        columns[..., orbit.SAMPLE_CONTACT] = code
        columns[..., orbit.SAMPLE_STIFFNESS] = stiffness
        distance = np.where(code == 1, near, np.where(code == -1, far, 0.0))
        columns[..., orbit.SAMPLE_FORCE] = stiffness * distance
        samples[:, 6 * m :] = state[:, : self.model.size // 2]

    def vary(self, z, periods, limit, maps, first):
        """Fill the maps; see `Base.vary`."""
        samples, events, summary = self.model.room(events=0)
        *_, code = self._go(z, periods, 0, samples, events, limit, summary, maps, first)
        # Deviations of rates count by phase, as rates do.
        maps *= self.scale[None, :] / self.scale[:, None]
        return code
