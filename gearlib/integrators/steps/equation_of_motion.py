"""Equations of motion at one phase and state, for methods with steps.

The equation of one degree of freedom is, in static deflections and mesh phase,

    x'' = F(tau) - e x - d1 x' - d2 |x'| x' - d3 x'^3 - c(tau) g(x),

with contact for x >= drive_line and x <= coast_line. In the smoothed law the factors
H1 = (1 + tanh(sharpness (x - drive_line))) / 2 and H2 = (1 - tanh(sharpness (x - coast_line))) / 2
of drive and coast side multiply spring force and damping.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.jit import inlined_kernel, kernel
from gearlib.engines.linear.train_system import TrainSystem, dot, is_past_coast_line, set_harmonics
from gearlib.engines.taylor.series import NonlinearMesh

#: Phases this close to a switch of stiffness count as the switch. The tolerance is far above the
#: rounding of a phase and far below any step.
SAME_PHASE_TOLERANCE = 1e-12


class ContactLaw(NamedTuple):
    """The contact law as plain floats, which kernels pass on at no cost."""

    drive_damping: tuple  #: d1, d2, d3 in drive-side contact
    backlash_damping: tuple  #: d1, d2, d3 in the backlash
    coast_damping: tuple  #: d1, d2, d3 in coast-side contact
    stiffness_powers: tuple  #: p2, p3 of the contact stiffness
    drive_line: float  #: displacement above which the drive side touches, static deflections
    coast_line: float  #: displacement below which the coast side touches
    ground_stiffness: float  #: e, stiffness towards x = 0 that acts without contact, too
    sharpness: float = 0.0  #: sharpness of the smoothed law, per static deflection; 0: not smoothed
    is_simple: bool = False  #: whether the law is sharp and its damping and stiffness linear


def contact_law_of(law: NonlinearMesh, sharpness: float = 0.0) -> ContactLaw:
    """Return the contact law of an equation of motion, smoothed if `sharpness` is positive."""
    damping = [tuple(d.tolist()) for d in (law.drive_damping, law.backlash_damping)]
    damping.append(tuple(law.coast_damping.tolist()))
    powers = tuple(law.stiffness_powers.tolist())
    is_nonlinear = any(powers) or any(any(coefficients[1:]) for coefficients in damping)
    is_simple = (
        sharpness == 0.0
        and not is_nonlinear
        and damping[0] == damping[2]
        and law.ground_stiffness == 0.0
    )
    lines = float(law.drive_line), float(law.coast_line)
    return ContactLaw(
        *damping, powers, *lines, float(law.ground_stiffness), float(sharpness), is_simple
    )


@inlined_kernel
def contact_code_at(contact_law: ContactLaw, x: float) -> int:
    """Return the contact code (drive side, coast side or backlash) at the displacement x."""
    if x >= contact_law.drive_line:
        return NORMAL
    return INVERSE if x <= contact_law.coast_line else BACKLASH


@inlined_kernel
def damping_force(coefficients: tuple, v: float) -> float:
    """Return the damping force d1 v + d2 |v| v + d3 v^3 for the coefficients (d1, d2, d3)."""
    return (coefficients[0] + (coefficients[1] + coefficients[2] * abs(v)) * abs(v)) * v


@inlined_kernel
def _force_over_stiffness(contact_law: ContactLaw, deflection: float) -> float:
    """Return g, the elastic contact force over the mesh stiffness, at an elastic deflection."""
    p2, p3 = contact_law.stiffness_powers
    return deflection + (p2 * abs(deflection) + p3 * deflection * deflection) * deflection


@inlined_kernel
def contact_terms(contact_law: ContactLaw, contact_code: int) -> tuple:
    """Return (1 in contact, else 0; displacement at first contact; damping d1, d2, d3)."""
    if contact_code == NORMAL:
        return 1.0, contact_law.drive_line, contact_law.drive_damping
    if contact_code == INVERSE:
        return 1.0, contact_law.coast_line, contact_law.coast_damping
    return 0.0, contact_law.drive_line, contact_law.backlash_damping


@inlined_kernel
def contact_forces(contact_law: ContactLaw, contact_code: int, x: float, v: float) -> tuple:
    """Return (elastic force over stiffness g, damping force) for a contact code, not smoothed."""
    is_touching, flank, damping = contact_terms(contact_law, contact_code)
    return is_touching * _force_over_stiffness(contact_law, x - flank), damping_force(damping, v)


@inlined_kernel
def _smoothed_contact(contact_law: ContactLaw, x: float) -> tuple:
    """Return (elastic force over stiffness g, contact factor H1 + H2) of the smoothed law."""
    sharpness, drive_line = contact_law.sharpness, contact_law.drive_line
    coast_line, h2 = contact_law.coast_line, 0.0
    h1 = 0.5 * (1.0 + math.tanh(sharpness * (x - drive_line)))
    g = h1 * _force_over_stiffness(contact_law, x - drive_line)
    if coast_line > -math.inf:
        h2 = 0.5 * (1.0 - math.tanh(sharpness * (x - coast_line)))
        g += h2 * _force_over_stiffness(contact_law, x - coast_line)
    return g, h1 + h2


@inlined_kernel
def force_and_acceleration(contact_law, contact_code, stiffness, external_force, x, v) -> tuple:
    """Return (elastic mesh force over stiffness g, acceleration x'') at displacement x, velocity v.

    Mesh stiffness and external force are those of the present phase. A smoothed contact law ignores
    the contact code.
    """
    if contact_law.sharpness > 0.0:
        g, contact_factor = _smoothed_contact(contact_law, x)
        drag = contact_factor * damping_force(contact_law.drive_damping, v)
        free_drag = (1.0 - contact_factor) * damping_force(contact_law.backlash_damping, v)
        return g, external_force - drag - free_drag - stiffness * g
    g, drag = contact_forces(contact_law, contact_code, x, v)
    ground_force = contact_law.ground_stiffness * x
    return g, external_force - ground_force - drag - stiffness * g


@inlined_kernel
def acceleration(
    contact_law: ContactLaw, stiffness: float, external_force: float, x: float, v: float
) -> float:
    """Return x'' at displacement x and velocity v, which determine the contact.

    Mesh stiffness and external force are those of the present phase.
    """
    if contact_law.is_simple:
        # This branch takes half the time of the general one, which timings of methods would show.
        damping = contact_law.drive_damping[0]
        if x >= contact_law.drive_line:
            return external_force - damping * v - stiffness * (x - contact_law.drive_line)
        if x <= contact_law.coast_line:
            return external_force - damping * v - stiffness * (x - contact_law.coast_line)
        return external_force - contact_law.backlash_damping[0] * v
    contact_code = contact_code_at(contact_law, x)
    return force_and_acceleration(contact_law, contact_code, stiffness, external_force, x, v)[1]


@inlined_kernel
def harmonic_sum(harmonics: np.ndarray, phase: float) -> float:
    """Return a Fourier sum at a phase; `harmonics` has rows (order, cosine, sine coefficient)."""
    total = 0.0
    for j in range(harmonics.shape[0]):
        order = harmonics[j, 0]
        if order == 0.0:
            total += harmonics[j, 1]
        else:
            cosine, sine = math.cos(order * phase), math.sin(order * phase)
            total += harmonics[j, 1] * cosine + harmonics[j, 2] * sine
    return total


@inlined_kernel
def stiffness_at(segment_bounds, stiffness_lines, harmonics, phase, side) -> float:
    """Return the mesh stiffness at a phase from 0 to 2 pi: a line on each segment plus harmonics.

    Where the stiffness jumps, `side`, +-SAME_PHASE_TOLERANCE, selects the segment after or before.
    The lines, shape (m, 2), are (start value, slope); the segment bounds have shape (m + 1,).
    """
    shifted_phase = phase + side
    if shifted_phase < 0.0:
        shifted_phase += 2.0 * math.pi
    elif shifted_phase >= 2.0 * math.pi:
        shifted_phase -= 2.0 * math.pi
    i = 0
    while i + 2 < segment_bounds.shape[0] and shifted_phase >= segment_bounds[i + 1]:
        i += 1
    line_value = stiffness_lines[i, 0] + stiffness_lines[i, 1] * (
        shifted_phase - side - segment_bounds[i]
    )
    return line_value + harmonic_sum(harmonics, phase)


@inlined_kernel
def acceleration_at(
    segment_bounds, stiffness_lines, stiffness_harmonics, force_harmonics, contact_law, t, x, v
) -> float:
    """Return x'' at the phase t, displacement x and velocity v, which determines the contact.

    The mesh stiffness is a line (start value, slope) on each segment plus harmonics, the force a
    sum of harmonics; harmonics have the columns order, cosine, sine.
    """
    phase = t - 2.0 * math.pi * math.floor(t * (0.5 / math.pi))
    stiffness = stiffness_at(
        segment_bounds, stiffness_lines, stiffness_harmonics, phase, SAME_PHASE_TOLERANCE
    )
    return acceleration(contact_law, stiffness, harmonic_sum(force_harmonics, phase), x, v)


@kernel
def mesh_acceleration(
    contact_law: ContactLaw, law: NonlinearMesh, t: float, x: float, v: float
) -> float:
    """Return x'' of one mesh at phase t, displacement x (which decides contact) and velocity v."""
    if contact_law.sharpness == 0.0 and x <= contact_law.coast_line:
        lines, harmonics = law.coast_stiffness_lines, law.coast_stiffness_harmonics
    else:
        lines, harmonics = law.stiffness_lines, law.stiffness_harmonics
    bounds, force_harmonics = law.segment_bounds, law.force_harmonics
    return acceleration_at(bounds, lines, harmonics, force_harmonics, contact_law, t, x, v)


@inlined_kernel
def _segment_stiffness(segment_bounds, stiffness_lines, harmonics, segment, t) -> float:
    """Return the mesh stiffness at the phase t, which rounding may put just before the segment.

    The lines, shape (m, 2), are (start value, slope) of the segments.
    """
    offset = (t - segment_bounds[segment] + 1e-6) % (2.0 * math.pi) - 1e-6
    line_value = stiffness_lines[segment, 0] + stiffness_lines[segment, 1] * offset
    return line_value + harmonic_sum(harmonics, t)


@kernel
def forces_and_accelerations(
    contact_law, law, phases, segments, contact_codes, states
) -> np.ndarray:
    """Return (mesh stiffness, elastic force over stiffness, x'') of states (k, 2), shape (k, 3).

    Phases, segments of the stiffness and contact codes have shape (k,). A smoothed contact law
    ignores the contact codes.
    """
    # Each attribute access counts references, so the loop uses local names.
    bounds, force_harmonics = law.segment_bounds, law.force_harmonics
    lines, harmonics = law.stiffness_lines, law.stiffness_harmonics
    coast_lines, coast_harmonics = law.coast_stiffness_lines, law.coast_stiffness_harmonics
    table = np.empty((phases.shape[0], 3))
    for i in range(phases.shape[0]):
        t, segment, contact_code = phases[i], segments[i], contact_codes[i]
        if contact_code == INVERSE and contact_law.sharpness == 0.0:
            stiffness = _segment_stiffness(bounds, coast_lines, coast_harmonics, segment, t)
        else:
            stiffness = _segment_stiffness(bounds, lines, harmonics, segment, t)
        external_force = harmonic_sum(force_harmonics, t)
        x, v = states[i, 0], states[i, 1]
        table[i, 0] = stiffness
        table[i, 1], table[i, 2] = force_and_acceleration(
            contact_law, contact_code, stiffness, external_force, x, v
        )
    return table


@kernel
def train_derivative(system: TrainSystem, t: float, state: np.ndarray) -> np.ndarray:
    """Return d(state)/dtau of a gear train at the phase t; the state determines the contacts.

    The state, shape (2 N,), holds displacements, then velocities.
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
    for mesh in range(system.drive_lines.shape[0]):
        contact_code = BACKLASH
        if dot(system.drive_lines[mesh], full_state) >= 0.0:
            contact_code = NORMAL
        elif dot(system.coast_lines[mesh], full_state) <= 0.0:
            contact_code = INVERSE
        effect = system.effect[contact_code + 1, segment, mesh]
        for k in range(2):
            force = dot(system.force_output[mesh, effect, k], full_state)
            for i in range(size):
                derivative[i] += system.force_input[mesh, effect, k, i] * force
    for i in range(size):
        derivative[i] /= system.tuning
    return derivative


@kernel
def is_jammed(system: TrainSystem, may_jam: np.ndarray, t: float, state: np.ndarray) -> bool:
    """Return whether both flanks of a mesh touch at once in a state at the phase t.

    `may_jam` is a mask of the meshes in which that is possible.
    """
    if not may_jam.any():
        return False
    full_state = np.empty(system.base_matrix.shape[0])
    full_state[: state.shape[0]] = state
    set_harmonics(system.harmonics, full_state, t)
    for mesh in range(may_jam.shape[0]):
        if (
            may_jam[mesh]
            and dot(system.drive_lines[mesh], full_state) >= 0.0
            and is_past_coast_line(system.coast_lines[mesh], full_state)
        ):
            return True
    return False


@kernel
def set_harmonics_of_states(frequencies: np.ndarray, states: np.ndarray, phases: np.ndarray):
    """Set the constant 1 and the harmonics in full states, shape (k, n), at phases, shape (k,)."""
    for i in range(phases.shape[0]):
        set_harmonics(frequencies, states[i], phases[i])
