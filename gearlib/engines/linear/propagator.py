"""Exact runs of gear trains, and of piecewise-linear models with one mesh by the same kernels.

Between events the motion is a sum of the modes of the present combination of contacts.
"""

import math
from typing import Any

import numpy as np

from gearlib.engines import matrices, orbit
from gearlib.engines.codes import OK
from gearlib.engines.linear.modal_arcs import (
    MAX_SEGMENT_LENGTHS,
    allocate_modes,
    clear_segment_factors,
    clear_tables,
)
from gearlib.engines.linear.modal_frame import ModalFrame, add_modes
from gearlib.engines.linear.periods import (
    COMBINATION_MISSING,
    EVENT_COLUMNS,
    EVENTS_FULL,
    SEGMENTS_MISSING,
)
from gearlib.engines.linear.sparse_series import combination_count, mode_cost_in_steps
from gearlib.engines.linear.train_run import motion_period, run_train, start_run
from gearlib.engines.linear.train_system import (
    EVENT_ROWS,
    KNOWN_PERIODS,
    PERIOD,
    TrainSystem,
    allocate_run_storage,
    run_constants,
)
from gearlib.engines.matrices import enlarge_table
from gearlib.engines.orbit import Record
from gearlib.engines.protocol import Base

#: Number of mesh periods for which segments are computed at a time, if they repeat after more.
_PERIODS_AT_A_TIME = 512
#: Number of samples whose forces are computed at a time.
_SAMPLES_AT_A_TIME = 1024
#: Largest size in bytes of tables that a model keeps when its propagators are deleted.
_MAX_KEPT_BYTES = 2**25
#: Largest rate of the fastest motion, over the rate of the fastest harmonic of the excitation. With
#: faster motions a mesh period would take minutes.
_MAX_RATE = 20_000.0


def _check_rates(model: Any, system: TrainSystem) -> None:
    """Raise ValueError if a model is so stiff that each mesh period would take minutes to compute.

    The model is a gear train or a model with one mesh. The matrix norm |A| times
    ``system.max_step`` of its linear system z' = A z is `matrices.MAX_NORM`, which gives the rate
    of the fastest motion.
    """
    fastest_harmonic = np.abs(system.harmonics * system.tuning).max(initial=1.0)
    rate = matrices.MAX_NORM / system.max_step
    # A model with one coordinate (size 2) has no shafts or supports that could be too stiff.
    if model.size > 2 and rate > _MAX_RATE * fastest_harmonic:
        raise ValueError(
            "support_stiffness, shaft_stiffness or damping of this model is not allowed in a run: "
            f"its fastest motion is {rate:.2g} times as fast as the motion of the mesh, and at "
            f"most {_MAX_RATE:,.0f} times are allowed; stiffer parts must be rigid (infinity)"
        )


class Propagator(Base):
    """Engine of a gear train at one tuning.

    A run fills tables of modes for the combinations of contacts that occur, and the next run reuses
    the tables.
    """

    description = "modes of every combination of contacts"
    chunk_size = 1

    def __init__(self, model, tuning, other=None):
        """Build the linear system of a model at a tuning (mesh frequency over natural frequency).

        `other` is a propagator of the same model at another tuning, whose mode tables are reused,
        or None.
        """
        super().__init__(model, tuning)
        # With run-out the excitation repeats only after `repeats` mesh periods. If these are many,
        # their segments of constant stiffness are computed part by part during a run.
        self.long_run_out = model.repeats > _PERIODS_AT_A_TIME and hasattr(model, "segments_of")
        period_range = (0, _PERIODS_AT_A_TIME) if self.long_run_out else ()
        #: The system; it has only the first segments of a long run-out, see `complete_system`.
        self.system = system = model.system(tuning, *period_range)
        _check_rates(model, system)
        self.constants = run_constants(system)
        self.components, self.pieces = len(system.base_matrix), len(self.constants.lengths)
        self.frame = other.frame if other and not self.depends_on_tuning else self.find_frame()
        # The kernels use velocities by theta, all other code uses velocities by phase.
        self.scale = np.repeat([1.0, tuning], model.size // 2)
        #: Pairs (system, tables) of tables that no run is using. Runs pop and append them, which
        #: needs no lock in a list. All propagators of the frame share small tables.
        self.unused_tables: list[tuple] = other.unused_tables if other else self.frame.unused_tables
        self.unused_large_tables: list[tuple] = other.unused_large_tables if other else []

    def take_tables(self):
        """Return tables for the modes of a run: tables of an earlier run if possible, or new ones.

        Modes in them remain if the matrices of the system are the same as in the earlier run;
        otherwise the tables are emptied. Factors of modes over segments are also emptied if the
        tuning has changed.
        """
        # m meshes, n components of a state.
        (m, n), system = self.system.drive_lines.shape, self.system
        length_count = min(int(self.constants.length_index.max()) + 1, MAX_SEGMENT_LENGTHS)
        combinations = combination_count(system)
        # Tables come with the system for which they were filled.
        try:
            table_system, tables = (self.unused_large_tables or self.unused_tables).pop()
        except IndexError:
            return allocate_modes(n, m, length_count, combinations)
        if tables.segment_factor_rows.shape[1] < length_count:
            return allocate_modes(n, m, length_count, combinations)
        if self.long_run_out:
            clear_segment_factors(tables)
        if table_system is not system:
            fields = "base_matrix", "drive_lines", "coast_lines", "force_input", "force_output"
            matrices = [(getattr(system, name), getattr(table_system, name)) for name in fields]
            is_same_matrix = all(np.array_equal(new, old) for new, old in matrices)
            (clear_segment_factors if is_same_matrix else clear_tables)(tables)
        return tables

    create_frame = ModalFrame.for_train

    def find_frame(self) -> ModalFrame:
        """Return the `ModalFrame`, the modal coordinates of the model, which the model keeps.

        If the matrices depend on the tuning, it belongs to this propagator only and the model does
        not keep it.
        """
        if self.depends_on_tuning:
            return self.create_frame(self.model, self.system)
        attributes = vars(self.model)
        # If several threads create a frame at once, all of them use the first one.
        frame = attributes.get("_frame") or self.create_frame(self.model, self.system)
        return attributes.setdefault("_frame", frame)

    @property
    def depends_on_tuning(self):
        """Whether the matrices depend on the tuning, apart from the harmonics."""
        return self.model.gyroscopic

    def complete_system(self):
        """Return (`TrainSystem`, `RunConstants`) with the stiffness segments of all mesh periods.

        If the excitation repeats only after many mesh periods, `self.system` holds only the first
        ones.
        """
        if not self.long_run_out:
            return self.system, self.constants
        system = self.model.system(self.tuning)
        return system, run_constants(system)

    def next_segments(self, first_period, periods_done, period_counts):
        """Return (system, constants, end): stiffness segments of a run up to mesh period `end`.

        The run began `periods_done` mesh periods ago in mesh period `first_period` of the
        excitation, and `period_counts` are its numbers of all and of recorded mesh periods. If the
        excitation repeats only after many mesh periods, segments are provided in parts. All
        recorded periods form one part, because samples refer to the segments by their numbers in
        one `TrainSystem`.
        """
        periods, unrecorded = period_counts[0], period_counts[0] - period_counts[1]
        if not self.long_run_out:
            return self.system._replace(first_period=first_period), self.constants, periods
        end = periods
        if periods_done < unrecorded:
            end = min(periods_done + _PERIODS_AT_A_TIME, unrecorded)
        system = self.model.system(self.tuning, first_period + periods_done, end - periods_done)
        system = system._replace(first_period=first_period)
        return system, run_constants(system), end

    def at(self, tuning: float) -> "Propagator":
        """Return the propagator of the same model at another tuning, which reuses the tables."""
        return type(self)(self.model, tuning, self)

    def initial_state(self, state):
        """Return the state z, shape (2 N,), for a `state` or "static", the static deflection."""
        return self.model.start_state(state)

    def run_system(
        self, z, samples, events, max_events, summary, period_counts, maps=None, first_period=0
    ):
        """Run from the state z, shape (2 N,), and fill samples, events, summary and maps.

        z changes in place. `period_counts` are the numbers of all and of recorded mesh periods,
        each with at most `max_events` events; the run begins in period `first_period` of the
        excitation. `samples` has the columns of `sampling.sample_motion`, `summary` a row for each
        mesh; `maps`, shape (periods, 2 N, 2 N), or None, is filled with the derivatives of the
        period maps. Returns (period of the motion, events, number of events, status, `TrainSystem`
        with the segments of the samples).
        """
        system, constants, end = self.next_segments(first_period, 0, period_counts)
        (periods, record_periods), size = period_counts, z.size
        maps = np.empty((0, size, size)) if maps is None else maps
        tables = self.take_tables()
        _, _, m, n, points = tables.curves.shape
        padded, with_series = tables.from_modes.shape[2], constants.nonzero_columns.size > 0
        by_modes, rows_before = not tables.mode_cost[0], tables.combination_count[0]
        work = allocate_run_storage(n, padded, m, points - 1, with_series)
        work.state[:size] = z * self.scale
        orbit.clear_summary(summary[0])
        summary[1:] = summary[0]
        strobe_count = min(periods, orbit.strobe_periods(system.repeats)) if record_periods else 0
        strobes = np.empty((m, strobe_count + 1, 2))
        vectors = np.empty((size if len(maps) else 0, work.state.size))
        work.counters[KNOWN_PERIODS] = end
        status = start_run(system, constants, work)
        # Some statuses are requests of the kernel. It continues from where it stopped.
        while status == OK:
            record = samples, events, max_events, summary, strobes, vectors, maps
            status = run_train(system, constants, tables, work, periods, record_periods, *record)
            if status == COMBINATION_MISSING:
                is_full = with_series and tables.combination_count[0] == len(tables.keys)
                if by_modes and is_full and rows_before:
                    # Rows of earlier runs take room in the tables. The run starts again without
                    # them, so that its result does not depend on other runs.
                    clear_tables(tables)
                    self.unused_large_tables.append((self.system, tables))
                    arguments = samples, events, max_events, summary, period_counts, maps
                    return self.run_system(z, *arguments, first_period=first_period)
                if by_modes and is_full and not tables.mode_cost[0]:
                    # Most combinations occur once or twice, so that their modes do not pay off.
                    tables.mode_cost[0] = mode_cost_in_steps(n, fewest=0)
                else:
                    add_modes(tables, system, self.frame, work.effects)
            elif status == SEGMENTS_MISSING:
                system, constants, work.counters[KNOWN_PERIODS] = self.next_segments(
                    first_period, int(work.counters[PERIOD]), period_counts
                )
                clear_segment_factors(tables)
            elif status == EVENTS_FULL:
                events = enlarge_table(events, 2 * len(events) + 16 * m)
            else:
                break
            status = OK
        if by_modes and tables.mode_cost[0]:
            tables.mode_cost[0] = 0
            clear_tables(tables)
        row_bytes = 2 * tables.to_modes[0].nbytes + tables.curves[0].nbytes
        is_small = tables.combination_count[0] * row_bytes < _MAX_KEPT_BYTES
        (self.unused_tables if is_small else self.unused_large_tables).append((self.system, tables))
        z[:] = work.state[:size] / self.scale
        is_complete = status == OK and record_periods > 0
        period = motion_period(system, strobes, summary) if is_complete else 0
        return period, events, int(work.counters[EVENT_ROWS]), status, system

    def empty_raw_samples(self, count: int) -> np.ndarray:
        """Return an empty table of `count` samples with the columns of `sampling.sample_motion`."""
        m, n = self.system.drive_lines.shape
        return np.empty((count, n + m + 1))

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z, fill the tables and return the `Record`; z becomes the final state.

        `span` has the numbers of all and of recorded mesh periods and the largest number of events
        in one. The run begins in mesh period `first_period` of the excitation.
        `GearTrain.empty_record` returns the empty tables: `samples`, `events` and, with a row for
        each mesh, `summary` (extrema and contact times).
        """
        raw = self.empty_raw_samples(len(samples))
        arguments = events, span.max_events, summary, span[:2]
        # The kernel records raw samples: states, contact codes and segments.
        result = self.run_system(z, raw, *arguments, first_period=first_period)
        period, events, event_count, status, system = result
        if status == OK and len(samples):
            self.fill_samples(raw, samples, system)
        return Record(z, z, period, samples, events[:event_count], summary, status)

    def fill_samples(self, raw: np.ndarray, samples: np.ndarray, system: TrainSystem) -> None:
        """Fill `samples`, shape (k, 6 m + N): six columns for each of m meshes, then N coordinates.

        The six columns are displacement, velocity, acceleration, contact code, stiffness and mesh
        force. The columns of `raw`, shape (k, n + m + 1), are the state, the contact codes of the
        meshes, and the index of the stiffness segment in the `TrainSystem` `system`.
        """
        m, count = len(self.system.drive_lines), orbit.SAMPLE_COLUMNS
        self.fill_mesh_samples(raw, samples[:, : m * count].reshape(-1, m, count), system)
        samples[:, m * count :] = raw[:, : self.model.size // 2]

    def fill_mesh_samples(self, raw: np.ndarray, columns: np.ndarray, system: TrainSystem) -> None:
        """Fill the sample columns of m meshes, `columns`, shape (k, m, 6), from raw samples.

        The columns are displacement, velocity, acceleration, contact code, stiffness and mesh
        force. Those of `raw`, (k, n + m + 1), are the state z, the contact codes (1, 0, -1), and
        the index of the stiffness segment in the `TrainSystem` `system`.
        """
        nu = system.tuning
        m, n = system.drive_lines.shape
        state, code, segment = raw[:, :n], raw[:, n : n + m].astype(int), raw[:, -1].astype(int)
        # The effect numbers the contact and stiffness level of a mesh; code + 1 is an index from 0
        # to 2.
        effect = np.take_along_axis(system.effect[:, segment, :], code[None] + 1, axis=0)[0]
        meshes = np.arange(m)
        # dz/dtheta: the part without contact, to which the loop adds the forces of all meshes.
        rate = state @ system.base_matrix.T
        # The samples are taken in parts, since the force vectors of all of them would take
        # gigabytes.
        for i in range(0, len(raw), _SAMPLES_AT_A_TIME):
            rows = slice(i, i + _SAMPLES_AT_A_TIME)
            matrices = system.force_output[meshes, effect[rows]]
            forces = np.einsum("kjtn,kn->kjt", matrices, state[rows])
            matrices = system.force_input[meshes, effect[rows]]
            rate[rows] += np.einsum("kjt,kjtn->kn", forces, matrices)
        stiffness = np.take_along_axis(system.stiffness[:, segment, :], code[None] + 1, axis=0)[0]
        drive_distance = state @ system.drive_lines.T
        coast_distance = state @ system.coast_lines.T
        columns[..., orbit.SAMPLE_X] = drive_distance
        columns[..., orbit.SAMPLE_V] = state @ self.constants.drive_rates.T / nu
        columns[..., orbit.SAMPLE_A] = rate @ self.constants.drive_rates.T / nu**2
        columns[..., orbit.SAMPLE_CONTACT] = code
        columns[..., orbit.SAMPLE_STIFFNESS] = stiffness
        distance = np.where(code == -1, coast_distance, 0.0)
        distance = np.where(code == 1, drive_distance, distance)
        columns[..., orbit.SAMPLE_FORCE] = stiffness * distance

    def fill_maps(self, z, periods, max_events, maps, first_period):
        """Fill the period maps of a run from the state z, and return the status of the run.

        A period map is the derivative of the state after a mesh period with respect to the state
        before it; `maps` has the shape (periods, 2 N, 2 N). z becomes the final state. The run
        begins in mesh period `first_period` of the excitation, and each period has at most
        `max_events` events.
        """
        tables = self.empty_raw_samples(0), np.empty((0, EVENT_COLUMNS)), max_events
        summary = np.empty((len(self.system.drive_lines), orbit.SUMMARY_COLUMNS))
        status = self.run_system(z, *tables, summary, (periods, 0), maps, first_period)[3]
        # The kernel has computed the maps for velocities by theta (dimensionless time); here
        # velocities are derivatives by mesh phase.
        maps *= self.scale[None, :] / self.scale[:, None]
        return status


class SingleMeshPropagator(Propagator):
    """Engine of a piecewise-linear model with one mesh at one tuning."""

    description, chunk_size, depends_on_tuning = "closed forms", 16, False
    create_frame = ModalFrame.for_mesh

    def __init__(self, model, tuning, other=None):
        """Build the linear system of a model with one mesh at a tuning (mesh / natural frequency).

        `other` is a propagator of the same model at another tuning, whose mode tables are reused,
        or None.
        """
        super().__init__(model, tuning, other)
        self.pieces = 0
        # Displacement at which the drive-side flanks touch; kernels count displacements from there.
        self.drive_line = model.flank_lines[0]
        #: Displacement and dx/dtau of the mesh less displacement and dx/dtau of the coordinate, at
        #: the start of a mesh period: the deviation of the flanks from the involute there.
        self.flank_deviation = np.zeros(model.size)
        # If a model is given by an equation, its state z is the state of the mesh.
        if model.equation is not None:
            # At the start of a mesh period all cosines of the state are 1 and all sines are 0.
            cosines = slice(model.size + 1, None, 2)
            rate = self.system.drive_lines[0] @ self.system.base_matrix
            self.flank_deviation[0] = self.system.drive_lines[0, cosines].sum()
            self.flank_deviation[1] = rate[cosines].sum() / self.system.tuning

    def initial_state(self, state):
        """Return the state z, shape (2 N,), for a `state` of the mesh, shape (2,), or of the model.

        A state of the mesh is (displacement, dx/dtau); the model finds coordinates for it. A
        `state` with all 2 N components of a model of several coordinates is returned as it is.
        """
        if len(state) == self.model.size > 2:
            return np.array(state, float)
        return self.model.full_state(self.system, state)[: self.model.size]

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z, (2 N,), fill the tables and return the `Record` of the run.

        z becomes the final state. `span` has the numbers of all and of recorded mesh periods and
        the largest number of events in one; the run begins in mesh period `first_period` of the
        excitation. The tables are `samples`, `events` and `summary`, the extrema and contact times.
        """
        # The coordinates of the kernel leave out the deviation of the flanks from the involute.
        z -= self.flank_deviation
        raw = self.empty_raw_samples(len(samples))
        event_rows = np.empty((len(events), EVENT_COLUMNS))
        period, event_rows, event_count, status, system = self.run_system(
            z, raw, event_rows, span.max_events, summary[None], span[:2], first_period=first_period
        )
        summary[[orbit.X_MAX, orbit.X_MIN]] += self.drive_line
        # The final state, with the constant 1 and the harmonics at the end of the run.
        state = np.ones(self.components)
        state[: z.size] = z * self.scale
        phase = 2.0 * math.pi * (first_period + span.periods) * self.system.harmonics
        state[z.size + 1 :: 2], state[z.size + 2 :: 2] = np.cos(phase), np.sin(phase)
        x = float(self.system.drive_lines[0] @ state) + self.drive_line
        v = float(self.constants.drive_rates[0] @ state) / self.system.tuning
        if not status and len(samples):
            self.fill_samples(raw, samples, system)
        z += self.flank_deviation
        events = event_rows[:event_count, : orbit.EVENT_COLUMNS]
        return Record(z, np.array([x, v]), period, samples, events, summary, status)

    def fill_maps(self, z, *arguments):
        """Fill the period maps of a run from the state z, and return the status of the run.

        The `arguments` are those of `Propagator.fill_maps`: numbers of mesh periods and events, the
        table and the first mesh period. The kernel leaves out the deviation of the flanks from the
        involute.
        """
        z -= self.flank_deviation
        status = super().fill_maps(z, *arguments)
        z += self.flank_deviation
        return status

    def fill_samples(self, raw, samples, system):
        """Fill `samples`, (k, 6 + e): six columns of the mesh, e output variables of the model.

        The six columns are displacement, velocity, acceleration, contact code, stiffness and mesh
        force. Those of `raw`, (k, n + 2), are the state z, the contact code (1, 0, -1), and the
        index of the stiffness segment in the `TrainSystem` `system`.
        """
        n, count = self.components, orbit.SAMPLE_COLUMNS
        self.fill_mesh_samples(raw, samples[:, :count].reshape(-1, 1, count), system)
        samples[:, orbit.SAMPLE_X] += self.drive_line
        state = raw[:, :n].copy()
        state[:, : self.scale.size] /= self.scale
        contact, segment = raw[:, n].astype(int), raw[:, -1].astype(int)
        output_vectors = self.model.output_rows(system)[:, contact + 1, segment]
        samples[:, count:] = np.einsum("ekn,kn->ke", output_vectors, state)
