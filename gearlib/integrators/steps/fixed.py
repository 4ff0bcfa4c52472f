"""Fixed-step methods without events: classical Runge-Kutta, generalised-alpha and Newmark.

All mesh periods have the same steps, so stiffness and force at their nodes are tabulated once. If a
stiffness switch coincides with a step end, the step before it uses the stiffness before the switch
and the step after it the stiffness after the switch, so that the methods keep their order. Steps do
not end at other switches or at contact changes.
"""

import math
from typing import NamedTuple

import numpy as np

from gearlib.engines.codes import JAMMED, NOT_CONVERGED, OK, OVERFLOW
from gearlib.engines.jit import kernel, kernel_part
from gearlib.engines.orbit import is_within_range
from gearlib.engines.taylor.series import NonlinearMesh
from gearlib.integrators.steps.equation_of_motion import (
    SAME_PHASE_TOLERANCE,
    acceleration,
    contact_forces,
    contact_state_at,
    contact_terms,
    damping_force,
    harmonic_sum,
    is_jammed,
    stiffness_at,
    train_derivative,
)

#: Largest number of iterations of the contact force in a step; linear contact needs 2 or 3.
MAX_ITERATIONS = 50
#: A residual below this fraction of the magnitude of its terms is attributed to rounding.
_RESIDUAL_TOLERANCE = 1e-14


class Scheme(NamedTuple):
    """A fixed-step method and its constants."""

    runge_kutta: bool  #: classical Runge-Kutta if true, else generalised-alpha with these constants
    iterated: bool = False  #: whether contact is iterated or else frozen at the start of the step
    alpha_m: float = 0.0
    alpha_f: float = 0.0
    beta: float = 0.0
    gamma: float = 0.0


@kernel
def tabulate_excitation(mesh: NonlinearMesh, steps: int, middle_fraction: float) -> tuple:
    """Return (stiffness, external force, jump mask) for the equal steps of one mesh period.

    The columns of stiffness and force, shape (steps, 3), are values at the start, at the fraction
    `middle_fraction` and at the end of a step. The mask is True for steps at whose start the
    stiffness jumps.
    """
    stiffness, force = np.empty((steps, 3)), np.empty((steps, 3))
    for k in range(steps):
        for column, fraction in enumerate((0.0, middle_fraction, 1.0)):
            phase = 2.0 * math.pi * ((k + fraction) / steps)
            # A step that ends at a stiffness jump uses the value before the jump.
            shift = -SAME_PHASE_TOLERANCE if fraction == 1.0 else SAME_PHASE_TOLERANCE
            stiffness[k, column] = stiffness_at(
                mesh.segment_bounds, mesh.stiffness_segments, mesh.stiffness_harmonics, phase, shift
            )
            force[k, column] = harmonic_sum(mesh.force_harmonics, phase)
    # The stiffness is periodic, so the last step precedes the first step.
    has_jump = np.abs(stiffness[:, 0] - np.roll(stiffness[:, 2], 1)) > 1e-9 * stiffness[:, 0]
    return stiffness, force, has_jump


@kernel_part(inlined=True)
def runge_kutta_step(contact_law, h, stiffness, force, x, v) -> tuple:
    """Return (x, v) after a step of length h of the classical Runge-Kutta method.

    `contact_law` is a `ContactLaw`. `stiffness` and external `force` contain the values at the
    start, the midpoint and the end of the step.
    """
    half_step = 0.5 * h
    a1 = acceleration(contact_law, stiffness[0], force[0], x, v)
    v2 = v + half_step * a1
    a2 = acceleration(contact_law, stiffness[1], force[1], x + half_step * v, v2)
    v3 = v + half_step * a2
    a3 = acceleration(contact_law, stiffness[1], force[1], x + half_step * v2, v3)
    v4 = v + h * a3
    a4 = acceleration(contact_law, stiffness[2], force[2], x + h * v3, v4)
    weight = h / 6.0
    return x + weight * (v + 2.0 * (v2 + v3) + v4), v + weight * (a1 + 2.0 * (a2 + a3) + a4)


@kernel_part(inlined=True)
def _frozen_acceleration(contact_law, scheme, h, stiffness, force, start, middle) -> float:
    """Return the acceleration at the end of a generalised-alpha step with frozen contact.

    `start`, (x, v, a), is the state at the start of the step of length h. It determines the
    contact, the secant stiffness and the secant damping (force / displacement or velocity), which
    makes the equation linear. The equation of motion is satisfied at an intermediate state;
    `middle`, (x, v), is this state for zero acceleration at the end. Mesh `stiffness` and external
    `force` are values at the intermediate state. `scheme` contains the constants of the method.
    """
    start_x, start_v, start_a = start
    middle_x, middle_v = middle
    alpha_m, alpha_f = scheme.alpha_m, scheme.alpha_f
    # Derivatives of the intermediate state with respect to the acceleration at the end.
    dx_da, dv_da = (1.0 - alpha_f) * scheme.beta * h * h, (1.0 - alpha_f) * scheme.gamma * h
    p2, p3 = contact_law.nonlinear_stiffness
    is_touching, contact_x, (d1, d2, d3) = contact_terms(
        contact_law, contact_state_at(contact_law, start_x)
    )
    deflection, speed = abs(start_x - contact_x), abs(start_v)
    secant_stiffness = stiffness * is_touching * (1.0 + (p2 + p3 * deflection) * deflection)
    secant_damping = d1 + (d2 + d3 * speed) * speed
    net_force = force - alpha_m * start_a - secant_damping * middle_v
    net_force = net_force - secant_stiffness * (middle_x - contact_x)
    return net_force / (1.0 - alpha_m + secant_damping * dv_da + secant_stiffness * dx_da)


@kernel_part(inlined=True)
def _iterated_acceleration(contact_law, scheme, h, stiffness, force, start, middle) -> tuple:
    """Return (acceleration at the end of a step, iterations, converged) by Newton's method.

    The generalised-alpha `scheme` satisfies the equation of motion at an intermediate state of the
    step of length h. `start`, (x, v, a), is the state at the start of the step, and `middle`, (x,
    v), is the intermediate state for zero acceleration at the end. Mesh `stiffness` and external
    `force` are values at the intermediate state.
    """
    start_x, start_v, start_a = start
    middle_x, middle_v = middle
    alpha_m, alpha_f = scheme.alpha_m, scheme.alpha_f
    # Derivatives of the intermediate state with respect to the acceleration at the end.
    dx_da, dv_da = (1.0 - alpha_f) * scheme.beta * h * h, (1.0 - alpha_f) * scheme.gamma * h
    p2, p3 = contact_law.nonlinear_stiffness
    a, iterations = start_a, 0
    while iterations < MAX_ITERATIONS:
        x, v = middle_x + dx_da * a, middle_v + dv_da * a
        contact_state = contact_state_at(contact_law, x)
        g, damping = contact_forces(contact_law, contact_state, x, v)
        residual = (1.0 - alpha_m) * a + alpha_m * start_a + damping + stiffness * g - force
        is_touching, contact_x, (d1, d2, d3) = contact_terms(contact_law, contact_state)
        deflection, speed = is_touching * abs(x - contact_x), abs(v)
        dg_dx = is_touching * (1.0 + (2.0 * p2 + 3.0 * p3 * deflection) * deflection)
        tangent_stiffness = stiffness * dg_dx
        tangent_damping = d1 + (2.0 * d2 + 3.0 * d3 * speed) * speed
        iterations += 1
        term_magnitude = abs(a) + abs(alpha_m * start_a) + abs(force) + abs(damping)
        term_magnitude += tangent_stiffness * (
            abs(x) + deflection + abs(start_x) + h * abs(start_v)
        )
        # The remaining residual is due to rounding.
        if abs(residual) <= _RESIDUAL_TOLERANCE * term_magnitude:
            return a, iterations, True
        a -= residual / (1.0 - alpha_m + tangent_damping * dv_da + tangent_stiffness * dx_da)
    # If the damping jumps at contact, the residual may jump across zero. Then the flanks just
    # touch, and the damping force lies between its values in contact and in free flight.
    for contact_x in (contact_law.drive_x, contact_law.coast_x):
        if abs(contact_x) < math.inf:
            a = (contact_x - middle_x) / dx_da
            v = middle_v + dv_da * a
            residual = (1.0 - alpha_m) * a + alpha_m * start_a - force
            contact_residual = residual + damping_force(contact_law.drive_damping, v)
            backlash_residual = residual + damping_force(contact_law.backlash_damping, v)
            iterations += 1
            if contact_residual * backlash_residual <= 0.0:
                return a, iterations, True
    return a, iterations, False


@kernel_part(inlined=True)
def alpha_step(contact_law, scheme, h, stiffness, force, start_x, start_v, start_a) -> tuple:
    """Return (x, v, a, evaluations, converged) after a step of the generalised-alpha method.

    The step of length h starts from (start_x, start_v, start_a). Mesh `stiffness` and external
    `force` are values at the fraction 1 - alpha_f of the step. The accelerations are variables of
    the method and do not satisfy the equation of motion at step ends. `scheme` contains the
    constants of the method.
    """
    fraction = 1.0 - scheme.alpha_f
    # The intermediate state is linear in a; this is the state for a = 0.
    middle_v = start_v + fraction * h * (1.0 - scheme.gamma) * start_a
    middle_x = start_x + fraction * h * (start_v + h * (0.5 - scheme.beta) * start_a)
    start, middle = (start_x, start_v, start_a), (middle_x, middle_v)
    a, evaluations, converged = 0.0, 1, True
    if scheme.iterated:
        a, evaluations, converged = _iterated_acceleration(
            contact_law, scheme, h, stiffness, force, start, middle
        )
    else:
        a = _frozen_acceleration(contact_law, scheme, h, stiffness, force, start, middle)
    # Newmark's formulas for the state at the end of the step.
    x = start_x + h * (start_v + h * ((0.5 - scheme.beta) * start_a + scheme.beta * a))
    v = start_v + h * ((1.0 - scheme.gamma) * start_a + scheme.gamma * a)
    return x, v, a, evaluations, converged


@kernel
def take_steps(contact_law, scheme: Scheme, excitation: tuple, a: float, states) -> tuple:
    """Take k steps from the start of a mesh period; return (status, evaluations, acceleration).

    The first row of `states`, shape (k + 1, 2), is the initial state; the other rows are filled.
    `excitation` is the result of `tabulate_excitation`. a is the acceleration of generalised-alpha
    at the initial state, or NaN if it follows from the equation of motion. The acceleration at the
    final state is returned.
    """
    stiffness, force, has_jump = excitation
    steps = stiffness.shape[0]
    h = 2.0 * math.pi / steps
    x, v, evaluations, converged = states[0, 0], states[0, 1], 0, True
    for i in range(states.shape[0] - 1):
        k = i % steps
        if scheme.runge_kutta:
            stiffness_k = stiffness[k, 0], stiffness[k, 1], stiffness[k, 2]
            force_k = force[k, 0], force[k, 1], force[k, 2]
            x, v = runge_kutta_step(contact_law, h, stiffness_k, force_k, x, v)
            evaluations += 4
        else:
            if has_jump[k] or math.isnan(a):
                # The acceleration jumps with the stiffness.
                a = acceleration(contact_law, stiffness[k, 0], force[k, 0], x, v)
                evaluations += 1
            x, v, a, count, converged = alpha_step(
                contact_law, scheme, h, stiffness[k, 1], force[k, 1], x, v, a
            )
            evaluations += count
        states[i + 1, 0], states[i + 1, 1] = x, v
        if not is_within_range(x, v):
            return OVERFLOW, evaluations, a
        if not converged:
            return NOT_CONVERGED, evaluations, a
    return OK, evaluations, a


@kernel
def take_train_steps(system, may_jam, period, steps, states, max_component) -> tuple:
    """Take k Runge-Kutta steps of a gear train; return (status, evaluations).

    The first row of `states`, shape (k + 1, size), is the state at the start of mesh period number
    `period`; the other rows are filled. A mesh period has `steps` steps. The run stops if a
    component exceeds `max_component`, or if both flanks touch in a mesh of the mask `may_jam`.
    """
    h = 2.0 * math.pi / steps
    for i in range(states.shape[0] - 1):
        t, z = 2.0 * math.pi * (period + i // steps) + (i % steps) * h, states[i]
        # Each step takes four evaluations of the derivative.
        rate_1 = train_derivative(system, t, z)
        rate_2 = train_derivative(system, t + h / 2.0, z + h / 2.0 * rate_1)
        rate_3 = train_derivative(system, t + h / 2.0, z + h / 2.0 * rate_2)
        rate_4 = train_derivative(system, t + h, z + h * rate_3)
        states[i + 1] = z + h / 6.0 * (rate_1 + 2.0 * rate_2 + 2.0 * rate_3 + rate_4)
        if is_jammed(system, may_jam, t + h, states[i + 1]):
            return JAMMED, 4 * (i + 1)
        if not np.abs(states[i + 1]).max() < max_component:
            return OVERFLOW, 4 * (i + 1)
    return OK, 4 * (states.shape[0] - 1)
