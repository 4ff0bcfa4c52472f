"""Equations of motion at a given phase and state, for step-by-step methods.

With one degree of freedom, displacements in units of the static deflection, and the mesh phase tau,
the equation is

    x'' = F(tau) - e x - d1 x' - d2 |x'| x' - d3 x'^3 - c(tau) g(x),

with contact for x >= drive_x or x <= coast_x. In the smoothed contact law, spring force and damping
are multiplied by H1 = (1 + tanh(sharpness (x - drive_x))) / 2 on the drive side and by
H2 = (1 - tanh(sharpness (x - coast_x))) / 2 on the coast side.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.linear.train_system import TrainSystem, dot, is_past_coast_line, set_harmonics
from gearlib.engines.taylor.series import NonlinearMesh

#: A phase that is this close to a stiffness switch is treated as the switch. The tolerance is far
#: above the rounding error of a phase and far below any step.
SAME_PHASE_TOLERANCE = 1e-12


class ContactLaw(NamedTuple):
    """Contact law with plain floats, which kernels can pass at no cost."""

    drive_damping: tuple  #: d1, d2, d3 in drive-side contact
    backlash_damping: tuple  #: d1, d2, d3 in free flight
    coast_damping: tuple  #: d1, d2, d3 in coast-side contact
    nonlinear_stiffness: tuple  #: p2, p3: g = u + p2 |u| u + p3 u^3 for the elastic deflection u
    drive_x: float  #: displacement above which the drive side touches, static deflections
    coast_x: float  #: displacement below which the coast side touches, static deflections
    ground_stiffness: float  #: e, stiffness towards x = 0, which also acts without contact
    sharpness: float = 0.0  #: sharpness of the smoothed law, per static deflection; 0: not smoothed
    is_simple: bool = False  #: not smoothed, linear, equal damping of both flanks, e = 0


def create_contact_law(mesh: NonlinearMesh, sharpness: float = 0.0) -> ContactLaw:
    """Create the `ContactLaw` of a nonlinear mesh, smoothed if `sharpness` is positive."""
    arrays = mesh.drive_damping, mesh.backlash_damping, mesh.coast_damping, mesh.stiffness_powers
    drive, free, coast, stiffness = (tuple(coefficients.tolist()) for coefficients in arrays)
    is_linear = not any((*drive[1:], *free[1:], *coast[1:], *stiffness))
    # With a simple law, the acceleration takes half as long to compute.
    is_simple = sharpness == 0.0 and is_linear and drive == coast and mesh.ground_stiffness == 0.0
    # These are the fields drive_x, coast_x, ground_stiffness and sharpness of a `ContactLaw`.
    constants = mesh.drive_line, mesh.coast_line, mesh.ground_stiffness, sharpness
    return ContactLaw(drive, free, coast, stiffness, *map(float, constants), is_simple)


@kernel_part(inlined=True)
def contact_state_at(contact_law: ContactLaw, x: float) -> int:
    """Return the contact state (drive side, coast side or no contact) at the displacement x."""
    if x >= contact_law.drive_x:
        return DRIVE
    return COAST if x <= contact_law.coast_x else NO_CONTACT


@kernel_part(inlined=True)
def damping_force(coefficients: tuple, v: float) -> float:
    """Return the damping force d1 v + d2 |v| v + d3 v^3 for the coefficients (d1, d2, d3)."""
    return (coefficients[0] + (coefficients[1] + coefficients[2] * abs(v)) * abs(v)) * v


@kernel_part(inlined=True)
def _force_over_stiffness(contact_law: ContactLaw, deflection: float) -> float:
    """Return g, the elastic contact force over the mesh stiffness, at an elastic deflection."""
    p2, p3 = contact_law.nonlinear_stiffness
    return deflection + (p2 * abs(deflection) + p3 * deflection * deflection) * deflection


@kernel_part(inlined=True)
def contact_terms(contact_law: ContactLaw, contact_state: int) -> tuple:
    """Return (1.0 in contact, else 0.0; displacement at first contact; damping coefficients).

    The coefficients d1, d2, d3 multiply v, |v| v and v^3. Without contact, the displacement at
    first contact of the drive flank is returned, which has no effect.
    """
    if contact_state == DRIVE:
        return 1.0, contact_law.drive_x, contact_law.drive_damping
    if contact_state == COAST:
        return 1.0, contact_law.coast_x, contact_law.coast_damping
    return 0.0, contact_law.drive_x, contact_law.backlash_damping


@kernel_part(inlined=True)
def contact_forces(contact_law: ContactLaw, contact_state: int, x: float, v: float) -> tuple:
    """Return (elastic force over stiffness g, damping force) without smoothing.

    x is the displacement and v the velocity of the mesh. The contact state, 1 (drive flank), 0 (no
    contact) or -1 (coast flank), determines the flank and the damping.
    """
    is_touching, contact_x, damping = contact_terms(contact_law, contact_state)
    g = is_touching * _force_over_stiffness(contact_law, x - contact_x)
    return g, damping_force(damping, v)


@kernel_part(inlined=True)
def _smoothed_contact(contact_law: ContactLaw, x: float) -> tuple:
    """Return (elastic force over stiffness g, contact factor H1 + H2) of the smoothed contact law.

    H1 and H2 change smoothly from 0 to 1 where the displacement x reaches contact on the drive side
    and on the coast side. They replace the step functions of the exact contact law.
    """
    sharpness, drive_x = contact_law.sharpness, contact_law.drive_x
    coast_x, h2 = contact_law.coast_x, 0.0
    h1 = 0.5 * (1.0 + math.tanh(sharpness * (x - drive_x)))
    g = h1 * _force_over_stiffness(contact_law, x - drive_x)
    if coast_x > -math.inf:
        h2 = 0.5 * (1.0 - math.tanh(sharpness * (x - coast_x)))
        g += h2 * _force_over_stiffness(contact_law, x - coast_x)
    return g, h1 + h2


@kernel_part(inlined=True)
def force_and_acceleration(contact_law, contact_state, stiffness, external_force, x, v) -> tuple:
    """Return (elastic mesh force over stiffness g, acceleration x'') at displacement x, velocity v.

    `stiffness` and `external_force` are values at the current phase. A smoothed contact law ignores
    the contact state (1 drive flank, 0 none, -1 coast flank); only gear pairs have such a law, with
    equal damping of both flanks and without ground stiffness.
    """
    if contact_law.sharpness > 0.0:
        g, contact_factor = _smoothed_contact(contact_law, x)
        damping = contact_factor * damping_force(contact_law.drive_damping, v)
        backlash_damping = (1.0 - contact_factor) * damping_force(contact_law.backlash_damping, v)
        return g, external_force - damping - backlash_damping - stiffness * g
    g, damping = contact_forces(contact_law, contact_state, x, v)
    ground_force = contact_law.ground_stiffness * x
    return g, external_force - ground_force - damping - stiffness * g


@kernel_part(inlined=True)
def acceleration(contact_law, stiffness, external_force, x: float, v: float) -> float:
    """Return the acceleration x'' at displacement x, which determines the contact, and velocity v.

    `stiffness` and `external_force` are values at the current phase. `contact_law` is a
    `ContactLaw`.
    """
    if contact_law.is_simple:
        # The general case would take twice as long, which would distort benchmarks of methods.
        damping = contact_law.drive_damping[0]
        if x >= contact_law.drive_x:
            return external_force - damping * v - stiffness * (x - contact_law.drive_x)
        if x <= contact_law.coast_x:
            return external_force - damping * v - stiffness * (x - contact_law.coast_x)
        return external_force - contact_law.backlash_damping[0] * v
    # The second result is the acceleration.
    contact_state = contact_state_at(contact_law, x)
    return force_and_acceleration(contact_law, contact_state, stiffness, external_force, x, v)[1]


@kernel_part(inlined=True)
def harmonic_sum(harmonics: np.ndarray, phase: float) -> float:
    """Return the value of a Fourier series at a phase.

    `harmonics` has rows (order, cosine coefficient, sine coefficient); order 0 is the mean.
    """
    total = 0.0
    for j in range(harmonics.shape[0]):
        order = harmonics[j, 0]
        if order == 0.0:
            total += harmonics[j, 1]
        else:
            cosine, sine = math.cos(order * phase), math.sin(order * phase)
            total += harmonics[j, 1] * cosine + harmonics[j, 2] * sine
    return total


@kernel_part(inlined=True)
def stiffness_at(segment_bounds, stiffness_segments, harmonics, phase, phase_shift) -> float:
    """Return the mesh stiffness at a phase from 0 to 2 pi: a line on each segment plus harmonics.

    If the stiffness jumps at the phase, the small `phase_shift` selects the segment after it (> 0)
    or before it (< 0). `stiffness_segments`, shape (m, 2), has rows (start value, slope), one per
    segment; `segment_bounds` has the shape (m + 1,); `harmonics` has rows (order, cosine, sine
    coefficient).
    """
    shifted_phase = phase + phase_shift
    # Phases below 0 or above 2 pi belong to the neighbouring mesh periods, which are identical.
    if shifted_phase < 0.0:
        shifted_phase += 2.0 * math.pi
    elif shifted_phase >= 2.0 * math.pi:
        shifted_phase -= 2.0 * math.pi
    i = 0
    while i + 2 < segment_bounds.shape[0] and shifted_phase >= segment_bounds[i + 1]:
        i += 1
    line_value = stiffness_segments[i, 0] + stiffness_segments[i, 1] * (
        shifted_phase - phase_shift - segment_bounds[i]
    )
    return line_value + harmonic_sum(harmonics, phase)


@kernel_part(inlined=True)
def acceleration_at(
    segment_bounds, stiffness_segments, stiffness_harmonics, force_harmonics, contact_law, t, x, v
) -> float:
    """Return the acceleration x'' at the mesh phase t, displacement x and velocity v.

    The displacement determines the contact. The mesh stiffness is a line (start value, slope) on
    each segment plus harmonics, and the external force is a sum of harmonics; harmonics have the
    columns order, cosine, sine coefficient.
    """
    # The phase within the mesh period, from 0 to 2 pi.
    phase = t - 2.0 * math.pi * math.floor(t * (0.5 / math.pi))
    stiffness = stiffness_at(
        segment_bounds, stiffness_segments, stiffness_harmonics, phase, SAME_PHASE_TOLERANCE
    )
    return acceleration(contact_law, stiffness, harmonic_sum(force_harmonics, phase), x, v)


@kernel
def mesh_acceleration(contact_law, mesh: NonlinearMesh, t: float, x: float, v: float) -> float:
    """Return the acceleration x'' of a single mesh at mesh phase t, displacement x and velocity v.

    The displacement determines the contact and thereby the stiffness (drive or coast flank). A
    smoothed contact law (sharpness > 0) uses the same stiffness for both flanks.
    """
    if contact_law.sharpness == 0.0 and x <= contact_law.coast_x:
        stiffness_segments, harmonics = (
            mesh.coast_stiffness_segments,
            mesh.coast_stiffness_harmonics,
        )
    else:
        stiffness_segments, harmonics = mesh.stiffness_segments, mesh.stiffness_harmonics
    bounds, force_harmonics = mesh.segment_bounds, mesh.force_harmonics
    return acceleration_at(
        bounds, stiffness_segments, harmonics, force_harmonics, contact_law, t, x, v
    )


@kernel_part(inlined=True)
def _segment_stiffness(segment_bounds, stiffness_segments, harmonics, segment, t) -> float:
    """Return the mesh stiffness at the mesh phase t on a segment.

    The stiffness is a line on each segment plus harmonics. `stiffness_segments`, shape (m, 2), has
    the start value and the slope of each of the m segments, and `segment_bounds` has their bounds.
    """
    # Rounding may put t just before the start of the segment; without the shift by 1e-6 the
    # remainder would then be almost 2 pi.
    offset = (t - segment_bounds[segment] + 1e-6) % (2.0 * math.pi) - 1e-6
    line_value = stiffness_segments[segment, 0] + stiffness_segments[segment, 1] * offset
    return line_value + harmonic_sum(harmonics, t)


@kernel
def forces_and_accelerations(
    contact_law, mesh, phases, segments, contact_states, states
) -> np.ndarray:
    """Return (mesh stiffness, elastic force over stiffness, x'') of states (k, 2), shape (k, 3).

    A state is (x, x'). Phases, indices of stiffness segments and contact states (1 drive flank, 0
    none, -1 coast flank) have the shape (k,). A smoothed contact law ignores the contact states.
    """
    # Each attribute access changes reference counts, so the loop uses local names.
    bounds, force_harmonics = mesh.segment_bounds, mesh.force_harmonics
    stiffness_segments, harmonics = mesh.stiffness_segments, mesh.stiffness_harmonics
    coast_segments, coast_harmonics = mesh.coast_stiffness_segments, mesh.coast_stiffness_harmonics
    table = np.empty((phases.shape[0], 3))
    for i in range(phases.shape[0]):
        t, segment, contact_state = phases[i], segments[i], contact_states[i]
        if contact_state == COAST and contact_law.sharpness == 0.0:
            stiffness = _segment_stiffness(bounds, coast_segments, coast_harmonics, segment, t)
        else:
            stiffness = _segment_stiffness(bounds, stiffness_segments, harmonics, segment, t)
        external_force = harmonic_sum(force_harmonics, t)
        x, v = states[i, 0], states[i, 1]
        table[i, 0] = stiffness
        table[i, 1], table[i, 2] = force_and_acceleration(
            contact_law, contact_state, stiffness, external_force, x, v
        )
    return table


@kernel
def train_derivative(system: TrainSystem, t: float, state: np.ndarray) -> np.ndarray:
    """Return d(state)/dtau of a gear train at the mesh phase t; the state determines the contacts.

    The state, shape (2 N,), holds displacements, then velocities by theta, the dimensionless time.
    In `system`, `starts` bounds the stiffness segments; the rows of `drive_distance_rows` and
    `coast_distance_rows`, (m, n), times the full state, which includes the constant 1 and the
    harmonics, are the distances of the m meshes from their flanks.
    """
    size = state.shape[0]
    full_state, derivative = np.empty(system.base_matrix.shape[0]), np.empty(size)
    for i in range(size):
        full_state[i] = state[i]
    set_harmonics(system.harmonics, full_state, t)
    phase, segment = (t + SAME_PHASE_TOLERANCE) % system.starts[-1], 0
    while segment < system.starts.shape[0] - 2 and system.starts[segment + 1] <= phase:
        segment += 1
    for i in range(size):
        derivative[i] = dot(system.base_matrix[i], full_state)
    for mesh in range(system.drive_distance_rows.shape[0]):
        contact_state = NO_CONTACT
        if dot(system.drive_distance_rows[mesh], full_state) >= 0.0:
            contact_state = DRIVE
        elif dot(system.coast_distance_rows[mesh], full_state) <= 0.0:
            contact_state = COAST
        # `force_index` holds the force case of a mesh: no contact, or contact at some stiffness.
        force_case = system.force_index[contact_state + 1, segment, mesh]
        # A mesh has two forces, the elastic and damping force and friction, linear in the state.
        for k in range(2):
            force = dot(system.force_output[mesh, force_case, k], full_state)
            for i in range(size):
                derivative[i] += system.force_input[mesh, force_case, k, i] * force
    for i in range(size):
        # Derivatives by theta are converted to derivatives by tau; the tuning is dtau/dtheta.
        derivative[i] /= system.tuning
    return derivative


@kernel
def is_jammed(system: TrainSystem, may_jam: np.ndarray, t: float, state: np.ndarray) -> bool:
    """Return whether both flanks of a mesh touch at once in a state at the mesh phase t.

    `may_jam` is a mask of the meshes in which both flanks can touch. The state, shape (2 N,), holds
    displacements, then velocities by theta, the dimensionless time.
    """
    if not may_jam.any():
        return False
    full_state = np.empty(system.base_matrix.shape[0])
    full_state[: state.shape[0]] = state
    set_harmonics(system.harmonics, full_state, t)
    for mesh in range(may_jam.shape[0]):
        if (
            may_jam[mesh]
            and dot(system.drive_distance_rows[mesh], full_state) >= 0.0
            and is_past_coast_line(system.coast_distance_rows[mesh], full_state)
        ):
            return True
    return False


@kernel
def set_harmonics_of_states(frequencies: np.ndarray, states: np.ndarray, phases: np.ndarray):
    """Set the constant 1 and the harmonics in full states.

    They follow the coordinates and velocities in each state.
    The full `states`, shape (k, n), belong to the mesh `phases`, shape (k,). `frequencies`, shape
    (h,), are the frequencies of the harmonics, relative to the mesh frequency.
    """
    for i in range(phases.shape[0]):
        set_harmonics(frequencies, states[i], phases[i])
