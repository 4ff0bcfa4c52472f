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
    COVERED_PERIODS,
    EVENT_ROWS,
    PERIOD,
    TrainSystem,
    allocate_run_state,
    run_constants,
)
from gearlib.engines.orbit import Record
from gearlib.engines.protocol import Engine

#: Number of mesh periods whose segments are computed at a time if the excitation period is longer.
_PERIODS_AT_A_TIME = 512
#: Number of samples whose forces are computed at a time.
_SAMPLES_AT_A_TIME = 1024
#: Largest size in bytes of tables that a model keeps when its propagators are deleted.
_MAX_KEPT_BYTES = 2**25
#: Largest rate of the fastest motion, relative to the fastest harmonic of the excitation. Above it,
#: the computation of a mesh period would take minutes.
_MAX_RATE = 20_000.0


def _check_rates(model: Any, system: TrainSystem) -> None:
    """Raise ValueError if a model is so stiff that each mesh period would take minutes to compute.

    `model` is a gear train or a model with one mesh, and `system` is its linear system z' = A z.
    The matrix norm |A| times ``system.max_step`` is `matrices.MAX_NORM`, which gives the rate of
    the fastest motion.
    """
    fastest_harmonic = np.abs(system.harmonics * system.tuning).max(initial=1.0)
    rate = matrices.MAX_NORM / system.max_step
    # A model with one coordinate (size 2) has no shafts or supports that could be too stiff.
    if model.size > 2 and rate > _MAX_RATE * fastest_harmonic:
        raise ValueError(
            "support_stiffness, shaft_stiffness or damping of this model is too large for a run: "
            f"its fastest motion is {rate:.2g} times as fast as the motion of the mesh, and at "
            f"most {_MAX_RATE:,.0f} times are allowed; stiffer parts must be rigid (infinity)"
        )


class Propagator(Engine):
    """Engine of a gear train at one tuning.

    A run fills mode tables for the combinations of contacts that occur, and later runs reuse them.
    """

    description = "modes of every combination of contacts"
    chunk_size = 1

    def __init__(self, model, tuning, other=None):
        """Build the linear system of a model at a tuning (mesh frequency over natural frequency).

        If `other`, a propagator of the same model at another tuning, is given, its mode tables are
        reused.
        """
        super().__init__(model, tuning)
        # With run-out the excitation repeats only after many mesh periods. Their stiffness segments
        # are then computed during a run, a limited number at a time.
        self.has_long_excitation_period = model.repeats > _PERIODS_AT_A_TIME and hasattr(
            model, "segments_of"
        )
        period_range = (0, _PERIODS_AT_A_TIME) if self.has_long_excitation_period else ()
        #: Linear system with the first segments of the excitation period, see `complete_system`.
        self.system = system = model.system(tuning, *period_range)
        _check_rates(model, system)
        self.constants = run_constants(system)
        self.components, self.segment_count = len(system.base_matrix), len(self.constants.lengths)
        self.frame = other.frame if other and not self.depends_on_tuning else self.find_frame()
        # Kernels use derivatives by theta as velocities, all other code derivatives by mesh phase.
        self.scale = np.repeat([1.0, tuning], model.size // 2)
        #: Pairs (system, tables) that are not in use by a run. Runs pop and append them, which is
        #: thread-safe for lists. All propagators of a frame share small tables.
        self.unused_tables: list[tuple] = other.unused_tables if other else self.frame.unused_tables
        self.unused_large_tables: list[tuple] = other.unused_large_tables if other else []

    def acquire_tables(self):
        """Return mode tables for a run, from an earlier run if possible.

        The tables keep their modes if the matrices of the system have not changed since that run;
        otherwise they are cleared. The mode factors of segments are also cleared if the tuning has
        changed.
        """
        (m, n), system = self.system.drive_distance_rows.shape, self.system
        length_count = min(int(self.constants.length_index.max()) + 1, MAX_SEGMENT_LENGTHS)
        combinations = combination_count(system)
        # Each entry has the system for which the tables were filled.
        try:
            table_system, tables = (self.unused_large_tables or self.unused_tables).pop()
        except IndexError:
            return allocate_modes(n, m, length_count, combinations)
        if tables.segment_factor_rows.shape[1] < length_count:
            return allocate_modes(n, m, length_count, combinations)
        if self.has_long_excitation_period:
            clear_segment_factors(tables)
        if table_system is not system:
            fields = ["base_matrix", "drive_distance_rows", "coast_distance_rows"]
            fields += ["force_input", "force_output"]
            matrices = [(getattr(system, name), getattr(table_system, name)) for name in fields]
            is_same_matrix = all(np.array_equal(new, old) for new, old in matrices)
            if is_same_matrix:
                clear_segment_factors(tables)
            else:
                clear_tables(tables)
        return tables

    create_frame = ModalFrame.for_train

    def find_frame(self) -> ModalFrame:
        """Return the `ModalFrame`, the modal coordinates, which the model stores.

        If the matrices depend on the tuning, the frame belongs to this propagator only and is not
        stored.
        """
        if self.depends_on_tuning:
            return self.create_frame(self.model, self.system)
        attributes = vars(self.model)
        # If several threads create a frame at once, all of them use the first one.
        frame = attributes.get("_frame") or self.create_frame(self.model, self.system)
        return attributes.setdefault("_frame", frame)

    @property
    def depends_on_tuning(self):
        """Whether the state matrix depends on the tuning, apart from the harmonics."""
        return self.model.gyroscopic

    def complete_system(self):
        """Return (`TrainSystem`, `RunConstants`) with the stiffness segments of all mesh periods.

        If the excitation period is long, `self.system` holds only the first segments.
        """
        if not self.has_long_excitation_period:
            return self.system, self.constants
        system = self.model.system(self.tuning)
        return system, run_constants(system)

    def next_segments(self, first_period, periods_done, period_counts):
        """Return (system, constants, end) with the next segments of a run, up to mesh period `end`.

        The run started `periods_done` mesh periods ago in mesh period `first_period` of the
        excitation period. `period_counts` are its numbers of all and of recorded mesh periods. If
        the excitation period is long, stiffness segments are provided in parts. All recorded
        periods belong to one part, because samples refer to segments by their index in one
        `TrainSystem`.
        """
        periods, unrecorded = period_counts[0], period_counts[0] - period_counts[1]
        if not self.has_long_excitation_period:
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
        """Return the state z, shape (2 N,), for a `state` or "static", the static equilibrium."""
        return self.model.start_state(state)

    def run_system(
        self, z, samples, events, max_events, summary, period_counts, maps=None, first_period=0
    ):
        """Run from the state z, shape (2 N,), and fill samples, events, summary and maps.

        z changes in place. `period_counts` are the numbers of all and of recorded mesh periods,
        each with at most `max_events` events; the run starts in mesh period `first_period` of the
        excitation period. `samples` has the columns of `sampling.sample_motion`, `summary` has a
        row per mesh. `maps`, shape (periods, 2 N, 2 N), if not None, is filled with the Jacobian
        matrices of the period maps. Returns (period of the motion, events, number of events,
        status, `TrainSystem` with the segments of the samples).
        """
        system, constants, end = self.next_segments(first_period, 0, period_counts)
        (periods, record_periods), size = period_counts, z.size
        maps = np.empty((0, size, size)) if maps is None else maps
        tables = self.acquire_tables()
        _, _, m, n, points = tables.distance_polynomials.shape
        padded, with_series = tables.from_modes.shape[2], constants.nonzero_columns.size > 0
        starts_with_modes, rows_before = not tables.mode_cost[0], tables.combination_count[0]
        run = allocate_run_state(n, padded, m, points - 1, with_series)
        run.state[:size] = z * self.scale
        orbit.clear_summary(summary[0])
        summary[1:] = summary[0]
        stored_states = orbit.stored_state_count(system.excitation_period)
        strobe_count = min(periods, stored_states) if record_periods else 0
        strobe_states = np.empty((m, strobe_count + 1, 2))
        perturbations = np.empty((size if len(maps) else 0, run.state.size))
        run.counters[COVERED_PERIODS] = end
        status = start_run(system, constants, run)
        # Serve the requests of the kernel, which then continues from where it stopped.
        while status == OK:
            record = samples, events, max_events, summary, strobe_states, perturbations, maps
            status = run_train(system, constants, tables, run, periods, record_periods, *record)
            if status == COMBINATION_MISSING:
                is_full = with_series and tables.combination_count[0] == len(tables.keys)
                if starts_with_modes and is_full and rows_before:
                    # Rows of earlier runs occupy the tables. The run restarts without them, so
                    # that its result does not depend on other runs.
                    clear_tables(tables)
                    self.unused_large_tables.append((self.system, tables))
                    arguments = samples, events, max_events, summary, period_counts, maps
                    return self.run_system(z, *arguments, first_period=first_period)
                if starts_with_modes and is_full and not tables.mode_cost[0]:
                    # Most combinations occur only once or twice, so their modes do not pay off.
                    tables.mode_cost[0] = mode_cost_in_steps(n, min_components=0)
                else:
                    add_modes(tables, system, self.frame, run.force_indices)
            elif status == SEGMENTS_MISSING:
                system, constants, run.counters[COVERED_PERIODS] = self.next_segments(
                    first_period, int(run.counters[PERIOD]), period_counts
                )
                clear_segment_factors(tables)
            elif status == EVENTS_FULL:
                free_rows = np.empty((len(events) + 16 * m, events.shape[1]))
                events = np.concatenate([events, free_rows])
            else:
                break
            status = OK
        if starts_with_modes and tables.mode_cost[0]:
            tables.mode_cost[0] = 0
            clear_tables(tables)
        row_bytes = 2 * tables.to_modes[0].nbytes + tables.distance_polynomials[0].nbytes
        is_small = tables.combination_count[0] * row_bytes < _MAX_KEPT_BYTES
        (self.unused_tables if is_small else self.unused_large_tables).append((self.system, tables))
        z[:] = run.state[:size] / self.scale
        is_complete = status == OK and record_periods > 0
        period = motion_period(system, strobe_states, summary) if is_complete else 0
        return period, events, int(run.counters[EVENT_ROWS]), status, system

    def empty_raw_samples(self, count: int) -> np.ndarray:
        """Return an empty table of `count` samples with the columns of `sampling.sample_motion`."""
        m, n = self.system.drive_distance_rows.shape
        return np.empty((count, n + m + 1))

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z, fill the tables and return the `Record`; z becomes the final state.

        `span` has the number of mesh periods, the number of recorded periods and the largest number
        of events per period. The run starts in mesh period `first_period` of the excitation period.
        `samples`, `events` and `summary`, with a row per mesh, are empty tables from
        `GearTrain.empty_record`.
        """
        raw_samples = self.empty_raw_samples(len(samples))
        arguments = events, span.max_events, summary, span[:2]
        # The kernel records raw samples: states, contact states and segments.
        result = self.run_system(z, raw_samples, *arguments, first_period=first_period)
        period, events, event_count, status, system = result
        if status == OK and len(samples):
            self.fill_samples(raw_samples, samples, system)
        return Record(z, z, period, samples, events[:event_count], summary, status)

    def fill_samples(self, raw_samples: np.ndarray, samples: np.ndarray, system) -> None:
        """Fill `samples`, shape (k, 6 m + N): six columns per mesh, then N coordinates.

        The six columns are displacement, velocity, acceleration, contact state, stiffness and mesh
        force. `raw_samples`, shape (k, n + m + 1), has the state, the contact states of the meshes,
        and the index of the stiffness segment in the `TrainSystem` `system`.
        """
        m, count = len(self.system.drive_distance_rows), orbit.SAMPLE_COLUMNS
        self.fill_mesh_samples(raw_samples, samples[:, : m * count].reshape(-1, m, count), system)
        samples[:, m * count :] = raw_samples[:, : self.model.size // 2]

    def fill_mesh_samples(self, raw_samples: np.ndarray, columns: np.ndarray, system) -> None:
        """Fill the sample columns of m meshes, `columns`, shape (k, m, 6), from raw samples.

        The columns are displacement, velocity, acceleration, contact state, stiffness and mesh
        force. `raw_samples`, (k, n + m + 1), has the state z, the contact states (1, 0, -1), and
        the index of the stiffness segment in the `TrainSystem` `system`.
        """
        nu = system.tuning
        m, n = system.drive_distance_rows.shape
        state, segment = raw_samples[:, :n], raw_samples[:, -1].astype(int)
        contact = raw_samples[:, n : n + m].astype(int)
        contact_index = contact[None] + 1
        force_index = np.take_along_axis(system.force_index[:, segment], contact_index, axis=0)[0]
        meshes = np.arange(m)
        # dz/dtheta without contact, to which the loop adds the forces of all meshes.
        rate = state @ system.base_matrix.T
        # The force vectors of all samples at once would take gigabytes.
        for i in range(0, len(raw_samples), _SAMPLES_AT_A_TIME):
            rows = slice(i, i + _SAMPLES_AT_A_TIME)
            matrices = system.force_output[meshes, force_index[rows]]
            forces = np.einsum("kjtn,kn->kjt", matrices, state[rows])
            matrices = system.force_input[meshes, force_index[rows]]
            rate[rows] += np.einsum("kjt,kjtn->kn", forces, matrices)
        stiffness = np.take_along_axis(system.stiffness[:, segment], contact_index, axis=0)[0]
        drive_distance = state @ system.drive_distance_rows.T
        coast_distance = state @ system.coast_distance_rows.T
        columns[..., orbit.SAMPLE_X] = drive_distance
        columns[..., orbit.SAMPLE_V] = state @ self.constants.drive_velocity_rows.T / nu
        columns[..., orbit.SAMPLE_A] = rate @ self.constants.drive_velocity_rows.T / nu**2
        columns[..., orbit.SAMPLE_CONTACT] = contact
        columns[..., orbit.SAMPLE_STIFFNESS] = stiffness
        distance = np.where(contact == -1, coast_distance, 0.0)
        distance = np.where(contact == 1, drive_distance, distance)
        columns[..., orbit.SAMPLE_FORCE] = stiffness * distance

    def fill_maps(self, z, periods, max_events, maps, first_period):
        """Fill the Jacobian matrices of all period maps of a run from the state z; return a status.

        `maps` has the shape (periods, 2 N, 2 N); a matrix is the derivative of the state after a
        mesh period with respect to the state before it. z becomes the final state. The run starts
        in mesh period `first_period` of the excitation period, and each period has at most
        `max_events` events.
        """
        tables = self.empty_raw_samples(0), np.empty((0, EVENT_COLUMNS)), max_events
        summary = np.empty((len(self.system.drive_distance_rows), orbit.SUMMARY_COLUMNS))
        status = self.run_system(z, *tables, summary, (periods, 0), maps, first_period)[3]
        # Convert from velocities by theta (dimensionless time) to velocities by mesh phase.
        maps *= self.scale[None, :] / self.scale[:, None]
        return status


class SingleMeshPropagator(Propagator):
    """Engine of a piecewise-linear model with one mesh at one tuning."""

    description, chunk_size, depends_on_tuning = "closed forms", 16, False
    create_frame = ModalFrame.for_mesh

    def __init__(self, model, tuning, other=None):
        """Build the linear system of a model with one mesh at a tuning (mesh / natural frequency).

        If `other`, a propagator of the same model at another tuning, is given, its mode tables are
        reused.
        """
        super().__init__(model, tuning, other)
        self.segment_count = 0
        # Displacement at which the drive-side flanks touch, the zero of displacements in kernels.
        self.drive_line = model.flank_lines[0]
        #: Displacement and dx/dtau of the mesh minus those of the coordinate at the start of a mesh
        #: period, due to the deviation of the flanks from the involute.
        self.flank_deviation = np.zeros(model.size)
        # If the model is given by an equation, its state z is the state of the mesh.
        if model.equation is not None:
            # At the start of a mesh period all cosines of the state are 1 and all sines are 0.
            cosines = slice(model.size + 1, None, 2)
            rate = self.system.drive_distance_rows[0] @ self.system.base_matrix
            self.flank_deviation[0] = self.system.drive_distance_rows[0, cosines].sum()
            self.flank_deviation[1] = rate[cosines].sum() / self.system.tuning

    def initial_state(self, state):
        """Return the state z, shape (2 N,), for a `state` of the mesh, shape (2,), or of the model.

        A state of the mesh is (displacement, dx/dtau), for which the model finds its coordinates. A
        `state` with all 2 N components of a model with several coordinates is returned unchanged.
        """
        if len(state) == self.model.size > 2:
            return np.array(state, float)
        return self.model.full_state(self.system, state)[: self.model.size]

    def fill_record(self, z, span, samples, events, summary, first_period):
        """Run from the state z, (2 N,), fill the tables and return the `Record` of the run.

        z becomes the final state. `span` has the number of mesh periods, the number of recorded
        periods and the largest number of events per period; the run starts in mesh period
        `first_period` of the excitation period. The empty tables are `samples`, `events` and
        `summary` (extrema and contact times).
        """
        # The coordinates of the kernel exclude the deviation of the flanks from the involute.
        z -= self.flank_deviation
        raw_samples = self.empty_raw_samples(len(samples))
        event_rows = np.empty((len(events), EVENT_COLUMNS))
        arguments = event_rows, span.max_events, summary[None], span[:2]
        period, event_rows, event_count, status, system = self.run_system(
            z, raw_samples, *arguments, first_period=first_period
        )
        summary[[orbit.X_MAX, orbit.X_MIN]] += self.drive_line
        # Append the constant 1 and the harmonics at the end of the run to the final state.
        state = np.ones(self.components)
        state[: z.size] = z * self.scale
        phase = 2.0 * math.pi * (first_period + span.periods) * self.system.harmonics
        state[z.size + 1 :: 2], state[z.size + 2 :: 2] = np.cos(phase), np.sin(phase)
        x = float(self.system.drive_distance_rows[0] @ state) + self.drive_line
        v = float(self.constants.drive_velocity_rows[0] @ state) / self.system.tuning
        if not status and len(samples):
            self.fill_samples(raw_samples, samples, system)
        z += self.flank_deviation
        events = event_rows[:event_count, : orbit.EVENT_COLUMNS]
        return Record(z, np.array([x, v]), period, samples, events, summary, status)

    def fill_maps(self, z, *arguments):
        """Fill the Jacobian matrices of all period maps of a run from the state z; return a status.

        `arguments` are passed to `Propagator.fill_maps`: the numbers of mesh periods and events,
        the table and the first mesh period. The coordinates of the kernel exclude the deviation of
        the flanks from the involute.
        """
        z -= self.flank_deviation
        status = super().fill_maps(z, *arguments)
        z += self.flank_deviation
        return status

    def fill_samples(self, raw_samples, samples, system):
        """Fill `samples`, (k, 6 + e): six columns of the mesh, then e output variables.

        The six columns are displacement, velocity, acceleration, contact state, stiffness and mesh
        force. `raw_samples`, (k, n + 2), has the state z, the contact state (1, 0, -1), and the
        index of the stiffness segment in the `TrainSystem` `system`.
        """
        n, count = self.components, orbit.SAMPLE_COLUMNS
        self.fill_mesh_samples(raw_samples, samples[:, :count].reshape(-1, 1, count), system)
        samples[:, orbit.SAMPLE_X] += self.drive_line
        state = raw_samples[:, :n].copy()
        state[:, : self.scale.size] /= self.scale
        contact, segment = raw_samples[:, n].astype(int), raw_samples[:, -1].astype(int)
        output_vectors = self.model.output_rows(system)[:, contact + 1, segment]
        samples[:, count:] = np.einsum("ekn,kn->ke", output_vectors, state)
