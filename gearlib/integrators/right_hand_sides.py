"""Dimensionless right-hand sides of models as functions of phase, for step-by-step methods.

A branch of a model is one stiffness segment with one contact state for each of its m meshes. If the
phase t is an array, shape (k,), states have the shape (k, size), and results have a row for each
phase. Both classes have the attributes

``segment_bounds, first_segment``
    phases that bound the segments, and the index of the first segment of each mesh period;
``below_mean``
    whether the stiffness is below its mean, by contact state + 1, segment and mesh;
``excitation_period``
    number of mesh periods after which the excitation repeats;
``backlashes, may_jam``
    backlash of each mesh in static deflections, and whether both flanks may touch at once.
"""

from typing import Any

import numpy as np

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.linear.train_run import set_initial_contacts
from gearlib.engines.linear.train_system import (
    allocate_run_state,
    set_harmonics,
    system_matrix,
)
from gearlib.engines.pair.motion import contact_state_with_lines
from gearlib.integrators.steps import equation_of_motion
from gearlib.integrators.steps.equation_of_motion import SAME_PHASE_TOLERANCE

#: Indices of the flanks of a mesh in arrays of distances.
DRIVE_FLANK, COAST_FLANK = 0, 1


def right_hand_side(model, tuning: float) -> "OneDegree | PiecewiseLinear":
    """Return the right-hand side of a model at a tuning (mesh frequency / natural frequency)."""
    return PiecewiseLinear(model, tuning) if model.equation is None else OneDegree(model, tuning)


def contact_states_at(flank_distances: np.ndarray) -> np.ndarray:
    """Return the contact states of m meshes, shape (..., m), for their flank distances.

    A contact state is 1 (contact on the drive flank), 0 (no contact) or -1 (coast flank).
    `flank_distances`, shape (..., 2, m), are signed distances from the drive and the coast flank; a
    drive flank touches at a distance >= 0, a coast flank at a distance <= 0.
    """
    drive_distances = flank_distances[..., DRIVE_FLANK, :]
    coast_states = np.where(flank_distances[..., COAST_FLANK, :] <= 0.0, COAST, NO_CONTACT)
    return np.where(drive_distances >= 0.0, DRIVE, coast_states)


class _RightHandSide:
    """Base class of right-hand sides: stiffness segments and contact states."""

    segment_bounds: Any
    flank_distances: Any
    flank_distance_rates: Any

    def segment_after(self, t: float | np.ndarray) -> np.ndarray:
        """Return the index of the segment of constant stiffness just after the mesh phase t.

        A phase at a stiffness switch, up to rounding, belongs to the segment that begins there.
        """
        phase = (t + SAME_PHASE_TOLERANCE) % self.segment_bounds[-1]
        next_bound = np.searchsorted(self.segment_bounds, phase, side="right")
        return np.minimum(next_bound, len(self.segment_bounds) - 1) - 1

    def segment_before(self, t: float | np.ndarray) -> np.ndarray:
        """Return the index of the segment of constant stiffness just before the phase t."""
        return self.segment_after(t - 2.0 * SAME_PHASE_TOLERANCE)

    def contact_states(self, t: float | np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the contact states of the meshes, shape (..., m), in a state at the phase t."""
        return contact_states_at(self.flank_distances(t, state))

    def reached_crossing(self, t: float, state, crossings: list, tolerance: float) -> int | None:
        """Return the index of the first flank crossing that a state has reached, or None.

        Each of the `crossings` is a zero of the distance of a mesh from a flank in one direction. A
        state at the mesh phase t has reached it if it moves in this direction and the distance has
        changed sign or is smaller than `tolerance`.
        """
        # The rates are expensive, so they are computed only if a distance is small.
        distances, rates = self.flank_distances(t, state).tolist(), None
        for i, crossing in enumerate(crossings):
            distance = distances[crossing.flank][crossing.mesh]
            if crossing.direction * distance > -tolerance:
                rates = self.flank_distance_rates(t, state) if rates is None else rates
                if crossing.direction * rates[crossing.flank][crossing.mesh] > 0.0:
                    return i
        return None


class OneDegree(_RightHandSide):
    """Right-hand side with one degree of freedom and the state (x, x').

    With a `sharpness` above 0, per static deflection, the contact law is smoothed.
    """

    def __init__(self, model, tuning: float, sharpness: float = 0.0):
        """Store the equation of motion of a model at a tuning (mesh / natural frequency).

        If `sharpness`, per static deflection, is positive, the contact law is smoothed.
        """
        self.mesh = mesh = model.nonlinear_mesh(tuning)
        self.contact_law = equation_of_motion.create_contact_law(mesh, sharpness)
        self.segment_bounds = mesh.segment_bounds
        # The excitation repeats after one mesh period with the segments 0 ... n - 1.
        self.excitation_period, self.first_segment = 1, np.array([0, len(mesh.below_mean)])
        # Equal for the contact states -1, 0 and 1; shape (3, segments, 1 mesh).
        self.below_mean = np.repeat(mesh.below_mean[None, :, None], 3, axis=0)
        # The backlash is constant, so that both flanks cannot touch at once.
        self.backlashes, self.may_jam = np.array([mesh.backlash_ratio]), np.array([False])
        #: Displacements at which drive and coast flank begin to touch, static deflections.
        self._contact_displacements = np.array([mesh.drive_line, mesh.coast_line])
        self.tuning = tuning

    def initial_state(self, state) -> tuple[np.ndarray, np.ndarray]:
        """Return (state, contact states) at phase 0 for a state (displacement, dx/dtau)."""
        contact_state = contact_state_with_lines(*self._contact_displacements, *state)
        return np.array(state, dtype=float), np.array([contact_state])

    def final_state(self, t: float, state: np.ndarray) -> tuple[float, float]:
        """Return displacement and velocity of a state as reported in results."""
        return float(state[0]), float(state[1])

    def flank_distances(self, t: float | np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the distances of the mesh from drive and coast flank, shape (..., 2, 1)."""
        return (state[..., :1] - self._contact_displacements)[..., None]

    def flank_distance_rates(self, t: float, state: np.ndarray) -> np.ndarray:
        """Return the derivatives of the flank distances by phase, shape (2, 1)."""
        return np.full((2, 1), state[1])

    def mesh_motion(self, t: float | np.ndarray, state: np.ndarray) -> tuple:
        """Return (displacement, velocity) of the mesh, each of shape (..., 1)."""
        return state[..., :1], state[..., 1:]

    def set_distance(self, t: float, state, mesh: int, flank: int, distance: float) -> None:
        """Move a state in place such that the mesh has the given distance from a flank."""
        state[0] += distance - (state[0] - self._contact_displacements[flank])

    def is_jammed(self, t: float, state: np.ndarray) -> bool:
        """Return False, because with one degree of freedom both flanks cannot touch at once."""
        return False

    def branch_derivative(self, t: float, state, segment: int, contact_states) -> np.ndarray:
        """Return the derivative of a state by mesh phase, for a segment and contact states.

        `contact_states` has one entry, 1 (drive flank), 0 (no contact) or -1 (coast flank).
        """
        arguments = np.array([t]), state[None], np.array([segment]), contact_states[None]
        _, _, accelerations = self._stiffness_and_acceleration(*arguments)
        return np.array([state[1], accelerations[0]])

    def derivative(self, t: float, state: np.ndarray) -> np.ndarray:
        """Return the derivative of a state (x, x') by mesh phase; x determines the contact."""
        x, v = state
        acceleration = equation_of_motion.mesh_acceleration(self.contact_law, self.mesh, t, x, v)
        return np.array([v, acceleration])

    def _stiffness_and_acceleration(self, t, states, segments, contact_states) -> np.ndarray:
        """Return mesh stiffness, mesh force over stiffness, and acceleration of k states, (3, k).

        Mesh phases t and indices of stiffness `segments` have shape (k,), `states` (x, x') the
        shape (k, 2), and `contact_states` (1, 0, -1) the shape (k, 1).
        """
        # Numba compiles a kernel for each memory layout, so all arrays get the same layout.
        arguments = [
            np.ascontiguousarray(array) for array in (t, segments, contact_states[:, 0], states)
        ]
        evaluate = equation_of_motion.forces_and_accelerations
        return evaluate(self.contact_law, self.mesh, *arguments).T

    def rates_at_step_ends(self, start, states, end, new_states) -> np.ndarray:
        """Return the derivatives of the states at the starts and ends of k steps, shape (2, k, 2).

        The steps lead from `states` at the mesh phases `start`, (k,), to `new_states` at the phases
        `end`, (k,). If the stiffness jumps at an end of a step, the value inside the step is used.
        """
        start_contact_states = self.contact_states(start, states)
        _, _, start_acceleration = self._stiffness_and_acceleration(
            start, states, self.segment_after(start), start_contact_states
        )
        end_contact_states = self.contact_states(end, new_states)
        _, _, end_acceleration = self._stiffness_and_acceleration(
            end, new_states, self.segment_before(end), end_contact_states
        )
        velocities = [states[:, 1], new_states[:, 1]]
        return np.stack([velocities, [start_acceleration, end_acceleration]], axis=-1)

    def mesh_forces(self, t, states, segments, contact_states) -> tuple[np.ndarray, np.ndarray]:
        """Return (dimensionless elastic mesh forces, zeros) of k states, both of shape (k, 1).

        Phases t and indices of stiffness `segments` have shape (k,), `states` (k, 2), and
        `contact_states` (1, 0, -1) (k, 1). The zeros stand for the derivatives of the forces, which
        only the mean force of trains needs.
        """
        stiffness, force_over_stiffness, _ = self._stiffness_and_acceleration(
            t, states, segments, contact_states
        )
        # In the equation in mesh phase the stiffness is divided by (mesh frequency)^2. Times
        # tuning^2 it is the stiffness over its mean.
        forces = (self.tuning**2 * stiffness * force_over_stiffness)[:, None]
        return forces, np.zeros_like(forces)

    def fill_samples(self, samples, t, states, segments, contact_states) -> None:
        """Fill the sample table, (k, 6), from k states (x, x') at the mesh phases t.

        Indices of stiffness `segments` have shape (k,), `states` (k, 2), and `contact_states` (1,
        0, -1) (k, 1).
        """
        stiffness, force_over_stiffness, acceleration = self._stiffness_and_acceleration(
            t, states, segments, contact_states
        )
        # Times tuning^2, the stiffness of the equation in mesh phase is the stiffness over its
        # mean.
        stiffness = self.tuning**2 * stiffness
        (x, v), contact, force = states.T, contact_states[:, 0], stiffness * force_over_stiffness
        # Columns: displacement, velocity, acceleration, contact state, stiffness, elastic force.
        samples[:] = np.stack([x, v, acceleration, contact, stiffness, force], axis=1)


class PiecewiseLinear(_RightHandSide):
    """Right-hand side of a piecewise linear system with constant and harmonic excitation.

    A full state is a state followed by the constant 1 and the harmonics of the mesh phase.
    Derivatives are with respect to phase, except in a `TrainSystem`, where they are with respect to
    theta = reference frequency * time.
    """

    def __init__(self, model, tuning: float):
        """Store the linear system of a model at a tuning (mesh / natural frequency).

        The distances of the meshes from their flanks are linear in the full state: the state, the
        constant 1 and the harmonics of the mesh phase.
        """
        self.propagator = model.propagator(tuning)
        self.system, self._constants = self.propagator.complete_system()
        system, size = self.system, model.size
        self.segment_bounds, self.first_segment = system.starts, system.first_segment
        self.below_mean = system.below_mean
        # Displacements at which drive flanks (row 0) and coast flanks (row 1) touch, shape (2, m).
        contact_displacements = np.reshape(model.flank_lines, (2, -1))
        self.backlashes = contact_displacements[0] - contact_displacements[1]
        self.may_jam, self.excitation_period = self._constants.may_jam, system.excitation_period
        # Only gear trains have mesh names.
        self.tuning, self.size, self._is_train = tuning, size, bool(model.mesh_names)
        # Factors that convert full states to states of the `TrainSystem` with velocities by theta.
        self.scale = np.ones(len(system.base_matrix))
        if not self._is_train:
            self.scale[:size] = self.propagator.scale
        #: Row vectors whose products with the full state are the flank distances, shape (2, m, n).
        self.distances = self.scale * np.stack(
            [system.drive_distance_rows, system.coast_distance_rows]
        )
        self._distance_columns = np.moveaxis(self.distances, 2, 1).copy()
        rates = np.stack([self._constants.drive_velocity_rows, self._constants.coast_velocity_rows])
        self._distance_rates = self.scale * rates / tuning
        self._matrices: dict = {}
        self._meshes = np.arange(len(system.drive_distance_rows))
        # Each column of a pseudo-inverse, (size / 2, m), is a displacement of the coordinates that
        # changes the distance of one mesh by 1 and no other distance.
        self._separate_moves = [
            np.linalg.pinv(distance_rows[:, : size // 2]) for distance_rows in self.distances
        ]

    def full_state(self, t: float | np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the full state (state, constant 1, harmonics) at the mesh phase t.

        If t is an array, shape (k,), the result has a row for each phase.
        """
        full = np.empty((*np.shape(t), self.scale.size))
        full[..., : self.size] = state
        if full.ndim == 1:
            set_harmonics(self.system.harmonics, full, t)
        else:
            equation_of_motion.set_harmonics_of_states(self.system.harmonics, full, t)
        return full

    def initial_state(self, state) -> tuple[np.ndarray, np.ndarray]:
        """Return (state, contact states) at phase 0 for an initial state of the model.

        Contact states are 1 (drive flank), 0 (no contact) or -1 (coast flank).
        """
        # The state of the system is both the state of the propagator times `propagator.scale` and
        # the state z of this class times `state_scale`.
        state_scale = self.scale[: self.size]
        z = self.propagator.initial_state(state) * (self.propagator.scale / state_scale)
        full_size, mesh_count = self.scale.size, self._meshes.size
        run_state = allocate_run_state(n=full_size, padded=full_size, m=mesh_count)
        run_state.state[:] = self.scale * self.full_state(0.0, z)
        set_initial_contacts(self.system, self._constants.no_coast_side, run_state, segment=0)
        return z, run_state.contact.copy()

    def final_state(self, t: float, state: np.ndarray) -> tuple:
        """Return (displacements, velocities) at the mesh phase t as reported in results.

        They are arrays of all coordinates for a train, and floats for a single mesh.
        """
        if self._is_train:
            half = self.size // 2
            scaled_state = state / self.propagator.scale
            return scaled_state[:half], scaled_state[half:]
        return tuple(float(values[0]) for values in self.mesh_motion(t, state))

    def flank_distances(self, t: float | np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return distances of the meshes from drive and coast flank, shape (..., 2, m)."""
        distances = self.full_state(t, state) @ self._distance_columns
        return np.moveaxis(distances, 0, 1) if isinstance(t, np.ndarray) else distances

    def flank_distance_rates(self, t: float, state: np.ndarray) -> np.ndarray:
        """Return the derivatives of the flank distances by phase, shape (2, m)."""
        return self._distance_rates @ self.full_state(t, state)

    def mesh_motion(self, t: float | np.ndarray, state: np.ndarray) -> tuple:
        """Return (displacements, velocities) of the meshes, each of shape (..., m)."""
        full = self.full_state(t, state)
        return full @ self.distances[DRIVE_FLANK].T, full @ self._distance_rates[DRIVE_FLANK].T

    def set_distance(self, t: float, state, mesh: int, flank: int, distance: float) -> None:
        """Move a state in place such that a mesh has the given `distance` from a flank at phase t.

        `flank` is DRIVE_FLANK or COAST_FLANK. The coordinates move such that no other mesh is
        affected.
        """
        current_distance = float(self.distances[flank, mesh] @ self.full_state(t, state))
        direction = self._separate_moves[flank][:, mesh]
        state[: self.size // 2] += direction * (distance - current_distance)

    def is_jammed(self, t: float, state: np.ndarray) -> bool:
        """Return whether both flanks of a mesh touch at once in a state at the mesh phase t."""
        system_state = state * self.scale[: self.size]
        return equation_of_motion.is_jammed(self.system, self.may_jam, t, system_state)

    def nonzero_entries(self) -> np.ndarray:
        """Return a mask of the entries of `branch_matrix` that may be nonzero.

        The branch matrix maps full states to derivatives of the state.
        """
        system = self.system
        # Each force adds the outer product of its input and output vectors. The indices of their
        # arrays are mesh, force case, kind of force (elastic with damping, or friction), component.
        force_input = system.force_input[..., : self.size, None]
        force_output = system.force_output[..., None, :]
        has_force = (force_input * force_output != 0.0).any(axis=(0, 1, 2))
        return (system.base_matrix[: self.size] != 0.0) | has_force

    def branch_matrix(self, segment: int, contact_states: np.ndarray) -> np.ndarray:
        """Return the matrix that maps full states to derivatives of the state by mesh phase.

        It holds on one stiffness segment with the contact states of all meshes (1, 0, -1), and is
        kept for later calls. A full state is the state, the constant 1 and the harmonics.
        """
        branch = segment, contact_states.tobytes()
        if branch not in self._matrices:
            # `force_index` holds the force case of a mesh: no contact, or contact at some
            # stiffness.
            force_cases = self.system.force_index[contact_states + 1, segment, self._meshes]
            matrix = system_matrix(self.system, force_cases)
            # Division by the tuning converts derivatives by theta to derivatives by mesh phase.
            scaled_matrix = matrix[: self.size] / self.scale[: self.size, None]
            self._matrices[branch] = scaled_matrix * self.scale / self.tuning
        return self._matrices[branch]

    def branch_derivative(self, t: float, state, segment: int, contact_states) -> np.ndarray:
        """Return the derivative of a state by mesh phase, for a segment and contact states."""
        return self.branch_matrix(segment, contact_states) @ self.full_state(t, state)

    def derivative(self, t: float, state: np.ndarray) -> np.ndarray:
        """Return the derivative of a state by mesh phase; the state determines the contacts."""
        # These factors convert states to those of the `TrainSystem`, with velocities by theta.
        scale = self.scale[: self.size]
        return equation_of_motion.train_derivative(self.system, t, state * scale) / scale

    def rates_at_step_ends(self, start, states, end, new_states) -> np.ndarray:
        """Return the mean rates of change over k steps, twice, shape (2, k, size).

        The steps lead from `states` at the mesh phases `start`, (k,), to `new_states` at the phases
        `end`, (k,). With mean rates instead of the rates at both ends, Hermite interpolation
        becomes linear.
        """
        return np.stack(2 * [(new_states - states) / (end - start)[:, None]])

    def mesh_forces(self, t, states, segments, contact_states) -> np.ndarray:
        """Return (elastic forces of m meshes, their derivatives by mesh phase), shape (2, k, m).

        Phases t and indices of stiffness `segments` have shape (k,), `states` (k, size), and
        `contact_states` (1 drive flank, 0 no contact, -1 coast flank) (k, m).
        """
        full = self.full_state(t, states)
        stiffness = self.system.stiffness[contact_states + 1, segments[:, None], self._meshes]
        stiffness = stiffness * (contact_states != NO_CONTACT)
        # Distances from both flanks and their derivatives by phase, each of shape (2, k, m).
        distances, rates = self.distances, self._distance_rates
        drive = np.stack([full @ distances[DRIVE_FLANK].T, full @ rates[DRIVE_FLANK].T])
        coast = np.stack([full @ distances[COAST_FLANK].T, full @ rates[COAST_FLANK].T])
        # If there is no coast flank, its distance is infinite and never selected.
        return stiffness * np.where(contact_states == DRIVE, drive, coast)

    def fill_samples(self, samples, t, states, segments, contact_states) -> None:
        """Fill the sample table of the model, with k rows, from k states at the mesh phases t.

        Indices of stiffness `segments` have shape (k,), `states` (k, size), and `contact_states`
        (1, 0, -1) (k, m).
        """
        system_states = self.scale * self.full_state(t, states)
        # These are the columns of the raw samples from which the propagator computes the table.
        table = np.concatenate([system_states, contact_states, segments[:, None]], axis=1)
        self.propagator.fill_samples(table, samples, self.system)
