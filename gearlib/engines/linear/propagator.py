"""Gear trains: between the events of all meshes their modes turn."""

import math

import numpy as np

from gearlib.engines import exponential, orbit
from gearlib.engines.codes import OK
from gearlib.engines.copies import enlarged
from gearlib.engines.linear.grid import FOUND, PERIOD, UNTIL, grid_of, work_of
from gearlib.engines.linear.modal_arcs import TURNS, forget, forget_lengths, modes
from gearlib.engines.linear.modal_frame import Frame, add
from gearlib.engines.linear.periods import BEYOND, EVENT_COLUMNS, FULL, MISSING
from gearlib.engines.linear.record import SUMMARY_COLUMNS
from gearlib.engines.linear.train_run import begin, period_of, run_train
from gearlib.engines.orbit import Record
from gearlib.engines.protocol import Base

#: Mesh periods whose segments are made at once, where stiffness and run-out repeat after more.
_STRETCH = 512
#: Bytes of tables beyond which they end with their propagators, and are not kept by models.
_KEPT = 2**25
#: Rate of the fastest motion, over that of the mesh, beyond which a mesh period takes too long.
_MAX_RATE = 20_000.0


def _check_rates(model, system):
    """Refuse bearings or shafts so stiff or so damped that a mesh period takes minutes."""
    waves = np.abs(system.harmonics * system.tuning).max(initial=1.0)
    rate = exponential.REACH / system.longest
    if model.size > 2 and rate > _MAX_RATE * waves:
        raise ValueError(
            "support_stiffness, shaft_stiffness or damping of this model is not allowed in a run: "
            f"its fastest motion is {rate:.2g} times as fast as that of the mesh, it must be at "
            f"most {_MAX_RATE:,.0f} times; what is so stiff must be rigid (infinity)"
        )


class Propagator(Base):
    """A gear train at one tuning.

    Tables fill as a run goes on: each run has some of its own, and leaves them to the next one.
    """

    words = "modes of every combination of contacts"
    chunk = 1

    def __init__(self, model, tuning, other=None):
        super().__init__(model, tuning)
        self.long = model.repeats > _STRETCH and hasattr(model, "segments_of")
        #: Of a long run-out with the first segments only: `whole` has all.
        self.system = system = model.system(tuning, *((0, _STRETCH) if self.long else ()))
        _check_rates(model, system)
        self.grid = grid_of(system)
        self.components, self.pieces = len(system.free), len(self.grid.length)
        self.frame = other.frame if other and not self.turning else self.frame_of()
        # Between coordinates and their rates by phase, and those by theta of the kernels.
        self.scale = np.repeat([1.0, tuning], model.size // 2)
        #: Tables that no run has at present, with their systems; runs take them out and put them
        #: back, for which a list needs no lock. The frame has those that are small.
        self.spare: list[tuple] = other.spare if other else self.frame.spare
        self.large: list[tuple] = other.large if other else []

    def taken(self):
        """Return tables for one run: of an earlier one, without what does not hold here, or new."""
        (m, n), system = self.system.near.shape, self.system
        lengths = min(int(self.grid.kind.max()) + 1, TURNS)
        try:
            before, tables = (self.large or self.spare).pop()
        except IndexError:
            return modes(n, m, lengths, system.push.shape[1] ** m)
        if tables.at.shape[1] < lengths:
            return modes(n, m, lengths, system.push.shape[1] ** m)
        if self.long:
            forget_lengths(tables)
        if before is not system:
            fields = ("free", "near", "far", "push", "grip")
            pairs = [(getattr(system, name), getattr(before, name)) for name in fields]
            same = all(np.array_equal(new, old) for new, old in pairs)
            (forget_lengths if same else forget)(tables)
        return tables

    new_frame = Frame.of_train

    def frame_of(self):
        """Return the `Frame`; a model keeps it with its bases where they depend on no tuning."""
        if self.turning:
            return self.new_frame(self.model, self.system)
        kept = vars(self.model)
        # Threads may come at once: all take the one that is there first.
        new = kept.get("_frame") or self.new_frame(self.model, self.system)
        return kept.setdefault("_frame", new)

    @property
    def turning(self):
        """Whether the matrices without harmonics depend on the tuning."""
        return self.model.gyroscopic

    def whole(self):
        """Return the system and its grid with the segments of all mesh periods."""
        if not self.long:
            return self.system, self.grid
        system = self.model.system(self.tuning)
        return system, grid_of(system)

    def ahead(self, first, done, spans):
        """Return (system, grid, period they last to) for a run, `done` periods of it behind it.

        Periods that are recorded lie in one stretch: samples tell segments by their numbers.
        """
        periods, unseen = spans[0], spans[0] - spans[1]
        if not self.long:
            return self.system._replace(first=first), self.grid, periods
        end = min(done + _STRETCH, unseen) if done < unseen else periods
        system = self.model.system(self.tuning, first + done, end - done)._replace(first=first)
        return system, grid_of(system), end

    def at(self, tuning):
        """Return the propagator of another tuning; it takes the tables over, see `Base.at`."""
        return type(self)(self.model, tuning, self)

    def start(self, state):
        """Return the state z; see `Base.start`."""
        return self.model.start_state(state)

    def run_system(
        self, z, samples, events, limit, summary, spans, maps=None, first=0, extrema=True
    ):
        """Run from z; `spans` are all periods and those recorded, `summary` has a row a mesh.

        Returns (period, events, events found, status, system whose segments the samples have);
        samples as of `record.record`. Without `extrema` the summary is not filled.
        """
        (system, grid, end), m = self.ahead(first, 0, spans), self.system.near.shape[0]
        (periods, record_periods), size = spans, z.size
        maps = np.empty((0, size, size)) if maps is None else maps
        tables = self.taken()
        _, _, m, n, points = tables.curves.shape
        w = work_of(n, tables.out.shape[2], m, points - 1, grid.chirp.size > 0)
        w.z[:size] = z * self.scale
        orbit.clear_summary(summary[0])
        summary[1:] = summary[0]
        if not extrema:
            summary[:, orbit.X_MAX] = math.inf
        kept = min(periods, orbit.strobe_periods(system.repeats)) if record_periods else 0
        strobes = np.empty((m, kept + 1, 2))
        vectors = np.empty((size if len(maps) else 0, w.z.size))
        w.place[UNTIL] = end
        code = begin(system, grid, w)
        while code == OK:
            record = samples, events, limit, summary, strobes, vectors, maps
            code = run_train(system, grid, tables, w, periods, record_periods, *record)
            if code == MISSING:
                add(tables, system, self.frame, w.effects)
            elif code == BEYOND:
                system, grid, w.place[UNTIL] = self.ahead(first, int(w.place[PERIOD]), spans)
                forget_lengths(tables)
            elif code == FULL:
                events = enlarged(events, 2 * len(events) + 16 * m)
            else:
                break
            code = OK
        used = tables.known[0] * (2 * tables.into[0].nbytes + tables.curves[0].nbytes)
        (self.spare if used < _KEPT else self.large).append((self.system, tables))
        z[:] = w.z[:size] / self.scale
        done = code == OK and record_periods > 0
        period = period_of(system, strobes, summary) if done else 0
        return period, events, int(w.place[FOUND]), code, system

    def raw(self, samples):
        """Return empty samples as of `record.record`."""
        m, n = self.system.near.shape
        return np.empty((samples, n + m + 1))

    def go(self, z, span, samples, events, summary, first):
        """Run from z; see `Base.go`. Samples have the columns of `GearTrain.empty_record`."""
        raw = self.raw(len(samples))
        done = self.run_system(z, raw, events, span.max_events, summary, span[:2], first=first)
        period, events, count, code, system = done
        if code == OK and len(samples):
            self.fill(raw, samples, system)
        return Record(z, z, period, samples, events[:count], summary, code)

    def fill(self, raw, samples, system):
        """Fill samples, shape (k, 6 m + N), from states, contact codes and segments."""
        m = len(self.system.near)
        self.fill_meshes(raw, samples[:, : 6 * m].reshape(-1, m, 6), system)
        samples[:, 6 * m :] = raw[:, : self.model.size // 2]

    def fill_meshes(self, raw, columns, system):
        """Fill the samples of the meshes, shape (k, m, 6)."""
        nu = system.tuning
        m, n = system.near.shape
        state, code, p = raw[:, :n], raw[:, n : n + m].astype(int), raw[:, -1].astype(int)
        effect = np.take_along_axis(system.effect[:, p, :], code[None] + 1, axis=0)[0]
        which = np.arange(m)
        push, grip = system.push[which, effect], system.grip[which, effect]
        forces = np.einsum("kjtn,kn->kjt", grip, state)
        rate = state @ system.free.T + np.einsum("kjt,kjtn->kn", forces, push)
        stiffness = np.take_along_axis(system.stiffness[:, p, :], code[None] + 1, axis=0)[0]
        near, far = state @ system.near.T, state @ system.far.T
        columns[..., orbit.SAMPLE_X] = near
        columns[..., orbit.SAMPLE_V] = state @ self.grid.rate.T / nu
        columns[..., orbit.SAMPLE_A] = rate @ self.grid.rate.T / nu**2
        columns[..., orbit.SAMPLE_CONTACT] = code
        columns[..., orbit.SAMPLE_STIFFNESS] = stiffness
        distance = np.where(code == 1, near, np.where(code == -1, far, 0.0))
        columns[..., orbit.SAMPLE_FORCE] = stiffness * distance

    def fill_maps(self, z, periods, max_events, maps, first):
        """Fill the maps; see `Base.fill_maps`."""
        tables = self.raw(0), np.empty((0, EVENT_COLUMNS)), max_events
        summary = np.empty((len(self.system.near), SUMMARY_COLUMNS))
        code = self.run_system(z, *tables, summary, (periods, 0), maps, first)[3]
        # Deviations of rates count by phase, as rates do.
        maps *= self.scale[None, :] / self.scale[:, None]
        return code
