"""Exact runs of gear trains: modes of each combination of contacts between events."""

import math
from typing import Any

import numpy as np

from gearlib.engines import exponential, orbit
from gearlib.engines.codes import OK
from gearlib.engines.copies import enlarged
from gearlib.engines.linear.grid import EVENT_ROWS, KNOWN_PERIODS, PERIOD, grid_of, new_work
from gearlib.engines.linear.modal_arcs import (
    MAX_SEGMENT_LENGTHS,
    clear_segment_factors,
    clear_tables,
    modes,
)
from gearlib.engines.linear.modal_frame import Frame, add
from gearlib.engines.linear.periods import (
    COMBINATION_MISSING,
    EVENT_COLUMNS,
    EVENTS_FULL,
    SEGMENTS_MISSING,
)
from gearlib.engines.linear.record import SUMMARY_COLUMNS
from gearlib.engines.linear.train_run import period_of, run_train, start_run
from gearlib.engines.linear.train_system import TrainSystem
from gearlib.engines.orbit import Record
from gearlib.engines.protocol import Base

#: Number of mesh periods for which segments are computed at a time, if they repeat after more.
_PERIODS_AT_A_TIME = 512
#: Largest tables in bytes that a model keeps when its propagators are gone.
_MAX_KEPT_BYTES = 2**25
#: Largest rate of the fastest motion, over that of the mesh; a mesh period takes minutes beyond.
_MAX_RATE = 20_000.0


def _check_rates(model: Any, system: TrainSystem) -> None:
    """Raise ValueError if a motion of a model and its system is too fast for a run of minutes."""
    fastest_harmonic = np.abs(system.harmonics * system.tuning).max(initial=1.0)
    rate = exponential.MAX_NORM / system.longest
    if model.size > 2 and rate > _MAX_RATE * fastest_harmonic:
        raise ValueError(
            "support_stiffness, shaft_stiffness or damping of this model is not allowed in a run: "
            f"its fastest motion is {rate:.2g} times as fast as that of the mesh, it must be at "
            f"most {_MAX_RATE:,.0f} times; what is so stiff must be rigid (infinity)"
        )


class Propagator(Base):
    """Run a gear train at one tuning.

    A run fills tables of modes for the combinations of contacts that occur, and the next run reuses
    them.
    """

    description = "modes of every combination of contacts"
    chunk_size = 1

    def __init__(self, model, tuning, other=None):
        """Build the system of a model at a tuning; reuse tables of the propagator `other`."""
        super().__init__(model, tuning)
        self.long = model.repeats > _PERIODS_AT_A_TIME and hasattr(model, "segments_of")
        #: The system; it has only the first segments of a long run-out, see `whole`.
        self.system = system = model.system(tuning, *((0, _PERIODS_AT_A_TIME) if self.long else ()))
        _check_rates(model, system)
        self.grid = grid_of(system)
        self.components, self.pieces = len(system.base_matrix), len(self.grid.lengths)
        self.frame = other.frame if other and not self.turning else self.frame_of()
        # The kernels take velocities by theta, all other code takes velocities by phase.
        self.scale = np.repeat([1.0, tuning], model.size // 2)
        #: Pairs of a system and tables that no run uses at present. Runs pop and append them, which
        #: needs no lock in a list. Small tables are shared by all propagators of the frame.
        self.spare: list[tuple] = other.spare if other else self.frame.spare
        self.large: list[tuple] = other.large if other else []

    def taken(self):
        """Return mode tables for a run: new ones, or those of an earlier run less invalid rows."""
        (m, n), system = self.system.drive_lines.shape, self.system
        length_count = min(int(self.grid.length_index.max()) + 1, MAX_SEGMENT_LENGTHS)
        combination_count = system.force_input.shape[1] ** m
        try:
            table_system, tables = (self.large or self.spare).pop()
        except IndexError:
            return modes(n, m, length_count, combination_count)
        if tables.turn_index.shape[1] < length_count:
            return modes(n, m, length_count, combination_count)
        if self.long:
            clear_segment_factors(tables)
        if table_system is not system:
            fields = "base_matrix", "drive_lines", "coast_lines", "force_input", "force_output"
            matrices = [(getattr(system, name), getattr(table_system, name)) for name in fields]
            same_matrices = all(np.array_equal(new, old) for new, old in matrices)
            if same_matrices:
                clear_segment_factors(tables)
            else:
                clear_tables(tables)
        return tables

    create_frame = Frame.of_train

    def frame_of(self) -> Frame:
        """Return the `Frame` of the model, which keeps it if it does not depend on the tuning."""
        if self.turning:
            return self.create_frame(self.model, self.system)
        attributes = vars(self.model)
        # If several threads create a frame at once, all of them use the first one.
        frame = attributes.get("_frame") or self.create_frame(self.model, self.system)
        return attributes.setdefault("_frame", frame)

    @property
    def turning(self):
        """Whether the matrices depend on the tuning, apart from the harmonics."""
        return self.model.gyroscopic

    def whole(self):
        """Return the `TrainSystem` and its `Grid` with the segments of all mesh periods."""
        if not self.long:
            return self.system, self.grid
        system = self.model.system(self.tuning)
        return system, grid_of(system)

    def ahead(self, first, done, spans):
        """Return (system, grid, mesh period up to which they hold) after `done` periods of a run.

        The run begins in mesh period `first`; `spans` are its numbers of all and of recorded
        periods. All recorded periods get one system, because samples have its segment numbers.
        """
        periods, unrecorded = spans[0], spans[0] - spans[1]
        if not self.long:
            return self.system._replace(first=first), self.grid, periods
        end = min(done + _PERIODS_AT_A_TIME, unrecorded) if done < unrecorded else periods
        system = self.model.system(self.tuning, first + done, end - done)._replace(first=first)
        return system, grid_of(system), end

    def at(self, tuning: float) -> "Propagator":
        """Return the propagator of the model at another tuning, which reuses the tables."""
        return type(self)(self.model, tuning, self)

    def start(self, state):
        """Return the state z, shape (2 N,), for a state or 'static'; see `Base.start`."""
        return self.model.start_state(state)

    def run_system(
        self, z, samples, events, limit, summary, spans, maps=None, first=0, extrema=True
    ):
        """Run from the state z, shape (2 N,), and fill samples, events, summary and maps.

        z changes in place. `spans` are the numbers of all and of recorded mesh periods, `first` is
        the one in which the run begins and `limit` the most events of a period. Samples have the
        columns of `record.record`, `summary` has a row a mesh, without extrema unless `extrema`,
        and `maps`, shape (periods, 2 N, 2 N), get the derivatives of the period maps. Returns
        (period of the motion, events, number of events, status, system of the samples' segments).
        """
        (system, grid, end), m = self.ahead(first, 0, spans), self.system.drive_lines.shape[0]
        (periods, record_periods), size = spans, z.size
        maps = np.empty((0, size, size)) if maps is None else maps
        tables = self.taken()
        _, _, m, n, points = tables.curves.shape
        work = new_work(
            n, tables.from_modes.shape[2], m, points - 1, grid.chirp_frequencies.size > 0
        )
        work.state[:size] = z * self.scale
        orbit.clear_summary(summary[0])
        summary[1:] = summary[0]
        if not extrema:
            summary[:, orbit.X_MAX] = math.inf
        strobe_count = min(periods, orbit.strobe_periods(system.repeats)) if record_periods else 0
        strobes = np.empty((m, strobe_count + 1, 2))
        vectors = np.empty((size if len(maps) else 0, work.state.size))
        work.counters[KNOWN_PERIODS] = end
        code = start_run(system, grid, work)
        while code == OK:
            record = samples, events, limit, summary, strobes, vectors, maps
            code = run_train(system, grid, tables, work, periods, record_periods, *record)
            if code == COMBINATION_MISSING:
                add(tables, system, self.frame, work.effects)
            elif code == SEGMENTS_MISSING:
                system, grid, work.counters[KNOWN_PERIODS] = self.ahead(
                    first, int(work.counters[PERIOD]), spans
                )
                clear_segment_factors(tables)
            elif code == EVENTS_FULL:
                events = enlarged(events, 2 * len(events) + 16 * m)
            else:
                break
            code = OK
        used_bytes = tables.used[0] * (2 * tables.to_modes[0].nbytes + tables.curves[0].nbytes)
        (self.spare if used_bytes < _MAX_KEPT_BYTES else self.large).append((self.system, tables))
        z[:] = work.state[:size] / self.scale
        done = code == OK and record_periods > 0
        period = period_of(system, strobes, summary) if done else 0
        return period, events, int(work.counters[EVENT_ROWS]), code, system

    def raw(self, samples: int) -> np.ndarray:
        """Return an empty table for a number of samples, with the columns of `record.record`."""
        m, n = self.system.drive_lines.shape
        return np.empty((samples, n + m + 1))

    def fill_record(self, z, span, samples, events, summary, first):
        """Run from the state z and fill the tables of `GearTrain.empty_record`; see `Base`."""
        raw = self.raw(len(samples))
        done = self.run_system(z, raw, events, span.max_events, summary, span[:2], first=first)
        period, events, count, code, system = done
        if code == OK and len(samples):
            self.fill(raw, samples, system)
        return Record(z, z, period, samples, events[:count], summary, code)

    def fill(self, raw: np.ndarray, samples: np.ndarray, system: TrainSystem) -> None:
        """Fill samples, shape (k, 6 m + N), from the `raw` samples (k, n + m + 1) of a run.

        Raw samples have the columns: state, contact codes, segment of the `TrainSystem` `system`.
        """
        m = len(self.system.drive_lines)
        self.fill_meshes(raw, samples[:, : 6 * m].reshape(-1, m, 6), system)
        samples[:, 6 * m :] = raw[:, : self.model.size // 2]

    def fill_meshes(self, raw: np.ndarray, columns: np.ndarray, system: TrainSystem) -> None:
        """Fill the mesh samples, `columns`, shape (k, m, 6), from `raw` samples as in `fill`."""
        nu = system.tuning
        m, n = system.drive_lines.shape
        state, code, segment = raw[:, :n], raw[:, n : n + m].astype(int), raw[:, -1].astype(int)
        effect = np.take_along_axis(system.effect[:, segment, :], code[None] + 1, axis=0)[0]
        meshes = np.arange(m)
        force_input = system.force_input[meshes, effect]
        forces = np.einsum("kjtn,kn->kjt", system.force_output[meshes, effect], state)
        rate = state @ system.base_matrix.T + np.einsum("kjt,kjtn->kn", forces, force_input)
        stiffness = np.take_along_axis(system.stiffness[:, segment, :], code[None] + 1, axis=0)[0]
        drive_distance = state @ system.drive_lines.T
        coast_distance = state @ system.coast_lines.T
        columns[..., orbit.SAMPLE_X] = drive_distance
        columns[..., orbit.SAMPLE_V] = state @ self.grid.drive_rates.T / nu
        columns[..., orbit.SAMPLE_A] = rate @ self.grid.drive_rates.T / nu**2
        columns[..., orbit.SAMPLE_CONTACT] = code
        columns[..., orbit.SAMPLE_STIFFNESS] = stiffness
        distance = np.where(code == -1, coast_distance, 0.0)
        distance = np.where(code == 1, drive_distance, distance)
        columns[..., orbit.SAMPLE_FORCE] = stiffness * distance

    def fill_maps(self, z, periods, max_events, maps, first):
        """Fill the derivatives of the period maps, move z to the end and return the status.

        `maps` has the shape (periods, 2 N, 2 N); the run begins at z in mesh period `first` and has
        at most `max_events` events in each period.
        """
        tables = self.raw(0), np.empty((0, EVENT_COLUMNS)), max_events
        summary = np.empty((len(self.system.drive_lines), SUMMARY_COLUMNS))
        code = self.run_system(z, *tables, summary, (periods, 0), maps, first)[3]
        # The kernel computes maps for velocities by theta.
        maps *= self.scale[None, :] / self.scale[:, None]
        return code
