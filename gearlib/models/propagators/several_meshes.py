"""Gear trains: between the events of all meshes their modes turn."""

import math

import numpy as np

from gearlib.kernels import orbit
from gearlib.kernels.arrays import enlarged
from gearlib.kernels.codes import OK
from gearlib.kernels.several_meshes.grid import FOUND, grid_of, work_of
from gearlib.kernels.several_meshes.modes import Modes, forget, forget_lengths, modes
from gearlib.kernels.several_meshes.periods import FULL, MISSING
from gearlib.kernels.several_meshes.run import begin, period_of, run_train
from gearlib.models.derivatives import STEP
from gearlib.models.propagators.matrices import Matrices
from gearlib.models.propagators.modes import Frame, add
from gearlib.models.propagators.tangents import Motion
from gearlib.models.propagators.varied import Varied


class VariedTrain(Varied):
    """A gear train."""

    def __init__(self, train, system, along):
        from gearlib.models.trains.system import train_system

        super().__init__()
        self.system, self.twins = system, [train.off_axis(slopes) for slopes in along]
        self._effects = system.effect.tolist()
        tunings = [system.tuning + 1j * STEP * slopes.get("tuning", 0.0) for slopes in along]
        pairs = zip(self.twins, tunings, strict=True)
        systems = [system, *(train_system(*pair) for pair in pairs)]
        self._free, self._push, self._grip, self._stiffness, self.near, self.far = (
            np.array([getattr(one, name) for one in systems]) + 0j
            for name in ("free", "push", "grip", "stiffness", "near", "far")
        )
        self.position = self.near
        self.size, self.tuning, self.repeats = train.size, system.tuning, system.repeats
        half, every = train.size // 2, np.array([system.tuning, *tunings])
        # From rates by theta to rates by phase.
        self._rate, self._scale = every[:, None, None], np.ones(self.near.shape[::2], complex)
        self._scale[:, half : 2 * half] = every[:, None]
        self._outputs = np.zeros((len(every), half, self.near.shape[2]))
        self._outputs[:, :, :half] = np.eye(half)
        slopes = [
            [one.get(("mesh", mesh.name, "contact_ratio"), 0.0) for one in along]
            for mesh in train.meshes
        ]
        rates = np.array([float(rate) for rate in train.rates])
        self.switches = math.pi * np.array(slopes) / rates[:, None]

    def stack(self, effects):
        """As of `Varied`."""
        a = self._free.copy()
        for j, effect in enumerate(effects):
            push, grip = self._push[:, j, effect], self._grip[:, j, effect]
            a += np.swapaxes(push, 1, 2) @ grip
        return a * self._scale[:, None, :] / self._scale[:, :, None] / self._rate

    def effects(self, codes, segments):
        """As of `Varied`."""
        places = range(len(codes))
        return tuple([self._effects[codes[j] + 1][segments[j]][j] for j in places])

    def stiffness(self, codes, segments):
        """As of `Varied`."""
        rows = enumerate(zip(codes, segments, strict=True))
        return np.stack([self._stiffness[:, code + 1, p, j] for j, (code, p) in rows], axis=1)

    def low(self, code, segment, mesh):
        """As of `Varied`."""
        return self.system.low[code + 1, segment, mesh]

    def longest(self, segments):
        """As of `Varied`."""
        return self.system.longest * self.tuning

    def cuts(self, number):
        """As of `Varied`."""
        first, last = self.system.first_segment[number : number + 2]
        starts = self.system.starts
        return [(starts[p] - starts[first], p) for p in range(first, last)]

    def outputs(self, codes, segments):
        """As of `Varied`."""
        return self._outputs


class Propagator(Matrices):
    """A gear train at one tuning; its tables fill as it runs, so that threads need one each."""

    words = "modes of every combination of contacts"
    chunk = 1

    def __init__(self, model, tuning, other=None):
        super().__init__(model, tuning)
        self.system = system = model.system(tuning)
        self.grid = grid_of(system)
        m, n = system.near.shape
        lengths = int(self.grid.kind.max()) + 1
        self.components, self.pieces = n, len(self.grid.length)
        self.frame = other.frame if other and not model.gyroscopic else Frame(model, system)
        # Between coordinates and their rates by phase, and those by theta of the kernels.
        self.scale = np.repeat([1.0, tuning], model.size // 2)
        if other is not None and other.tables.at.shape[1] >= lengths:
            self.tables: Modes = other.tables
            fields = ("free", "near", "push", "grip")
            pairs = [(getattr(system, name), getattr(other.system, name)) for name in fields]
            if all(np.array_equal(new, old) for new, old in pairs):
                forget_lengths(self.tables)
            else:
                forget(self.tables)
        else:
            self.tables = modes(n, m, lengths)

    def at(self, tuning):
        """Return the propagator of another tuning; it takes the tables over, see `Base.at`."""
        return Propagator(self.model, tuning, self)

    def start(self, state):
        """Return the state z; see `Base.start`."""
        return self.model.start_state(state)

    def _go(self, z, periods, record_periods, samples, events, limit, summary, maps, first):
        system, m = self.system._replace(first=first), self.system.near.shape[0]
        w = work_of(self.components, self.tables.out.shape[2], m)
        w.z[: z.size] = z * self.scale
        for row in summary:
            orbit.clear_summary(row)
        kept = min(periods, orbit.strobe_periods(system.repeats)) if record_periods else 0
        strobes = np.empty((m, kept + 1, 2))
        vectors = np.empty((z.size if len(maps) else 0, w.z.size))
        code = begin(system, self.grid, w)
        while code == OK:
            code = run_train(
                system,
                self.grid,
                self.tables,
                w,
                periods,
                record_periods,
                samples,
                events,
                limit,
                summary,
                strobes,
                vectors,
                maps,
            )
            if code == MISSING:
                add(self.tables, system, self.grid, self.frame, w.effects)
            elif code == FULL:
                events = enlarged(events, 2 * len(events) + 16 * m)
            else:
                break
            code = OK
        z[:] = w.z[: z.size] / self.scale
        done = code == OK and record_periods > 0
        period = period_of(system, strobes, summary) if done else 0
        return period, events, int(w.place[FOUND]), code

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

    def vary_along(self, along):
        """Return what the train changes by; see `Matrices`."""
        return VariedTrain(self.model, self.system, along)

    def motion(self, z, periods, limit):
        """Return the motion with all of its events; see `Matrices.motion`."""
        m, n = self.system.near.shape
        raw, (_, events, summary) = np.empty((periods, n + m + 1)), self.model.room()
        none = np.empty((0, z.size, z.size))
        done = self._go(z.copy(), periods, periods, raw, events, limit, summary, none, 0)
        _, events, found, code = done
        if code != OK:
            return None, code
        events, codes = events[:found], raw[0, n : n + m].astype(int)
        for row in events[::-1]:
            codes[int(row[orbit.EVENT_COLUMNS])] = row[orbit.EVENT_FROM]
        raw[:, : z.size] /= self.scale
        return Motion(raw[:, :n], tuple(codes.tolist()), events), code

    def start_tangents(self, state, along):
        """Return what the start changes by, shape (size, k); see `Matrices.start_tangents`."""
        from gearlib.models.trains.derivatives import static_state

        names = [f"initial_state of {component}" for component in self.model.components]
        found = np.array([[slopes.get(name, 0.0) for slopes in along] for name in names])
        twins = self.varied(along).twins
        if isinstance(state, str):
            moved = [static_state(self.model, twin).imag / STEP for twin in twins]
            found += np.array(moved).T
        return found

    def switches(self, mesh):
        """Return the phases of switches of a mesh, rising; see `Base.differentiate`."""
        system = self.system
        own = system.low[:, :, mesh]
        new = np.append((own != np.roll(own, 1, axis=1)).any(axis=0), True)
        new[system.first_segment] = True
        return system.starts[new]
