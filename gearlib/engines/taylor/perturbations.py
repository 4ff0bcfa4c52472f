"""Small perturbations of a motion along Taylor steps.

In a step, a perturbation w obeys w'' + damping(t) w' + stiffness(t) w = 0, where damping and
stiffness are Taylor series. At a flank line, the damping and w' jump as in
`gearlib.engines.pair.maps`.
"""

import math

import numpy as np

from gearlib.engines.codes import NO_CONTACT
from gearlib.engines.jit import kernel_part
from gearlib.engines.taylor.series import (
    D1,
    D2,
    D3,
    DEFLECTION_SQUARE,
    DISPLACEMENT,
    FLANK_LINE,
    GROUND_STIFFNESS,
    ORDER,
    P2,
    P3,
    STIFFNESS,
    VELOCITY,
    VELOCITY_SQUARE,
)

#: Entry k is 1 / (k + 1).
_INVERSE = 1.0 / np.arange(1, ORDER + 2)
#: Largest product of frequency and step length: x^20 / 20! = 1e-17 at x = 1.18.
_MAX_ANGLE = 1.18
#: Rows of the series of a perturbation: w, w', terms of w'', damping, stiffness, and stiffness
#: divided by c(tau).
_W, _RATE, _ACCELERATION, _DAMPING, _STIFFNESS, _FORCE_SLOPE = range(6)


@kernel_part(inlined=True)
def stiffness_bound(mesh):
    """Return an upper bound of the stiffness of both flanks at all phases.

    `mesh` is a `NonlinearMesh`, whose drive and coast flanks may have different stiffnesses.
    """
    bound = _segment_stiffness_bound(mesh.stiffness_segments, mesh.stiffness_harmonics)
    segments, harmonics = mesh.coast_stiffness_segments, mesh.coast_stiffness_harmonics
    return max(bound, _segment_stiffness_bound(segments, harmonics))


@kernel_part(inlined=True)
def _segment_stiffness_bound(stiffness_segments, harmonics):
    """Return an upper bound at all phases of a piecewise linear stiffness with harmonics.

    `stiffness_segments`, shape (m, 2), has the initial value and the slope of each of m segments;
    `harmonics`, shape (j, 3), has the columns order, cosine and sine coefficient.
    """
    total = 0.0
    for i in range(harmonics.shape[0]):
        total += math.hypot(harmonics[i, 1], harmonics[i, 2])
    # A segment has its maximum at its start or at the start of the next segment.
    return total + stiffness_segments[:, 0].max()


@kernel_part(inlined=True)
def max_perturbation_step(constants, max_stiffness, contact_state, x, v):
    """Return the longest step in phase over which the series of a perturbation converges.

    A perturbation oscillates with the natural frequency in contact even if the motion, with
    displacement x and velocity v, is slow. The terms of its series, (frequency * step)^k / k!, must
    fall below rounding by k = ORDER. `constants`, shape (COLUMNS,), holds the constants for the
    contact state (drive 1, none 0, coast -1) and the stiffness segment; the linear stiffness is at
    most `max_stiffness`.
    """
    # P2, P3: quadratic and cubic stiffness; D1 to D3: linear to cubic damping. Only P2 may be < 0.
    deflection = abs(x - constants[FLANK_LINE]) if contact_state != NO_CONTACT else 0.0
    stiffness_factor = (
        1.0 + (2.0 * abs(constants[P2]) + 3.0 * constants[P3] * deflection) * deflection
    )
    damping_rate = constants[D1] + (2.0 * constants[D2] + 3.0 * constants[D3] * abs(v)) * abs(v)
    return _MAX_ANGLE / (
        math.sqrt(constants[GROUND_STIFFNESS] + max_stiffness * stiffness_factor) + damping_rate
    )


@kernel_part
def _fill_equation(constants, contact_state, velocity_sign, series, perturbation):
    """Fill the series of damping and stiffness in the equation of a small perturbation w.

    The equation is w'' + damping w' + stiffness w = 0; the series fill the rows _DAMPING and
    _STIFFNESS of `perturbation`. `series` holds the Taylor series of the motion, whose velocity has
    the sign `velocity_sign` during the whole step. `constants`, shape (COLUMNS,), holds the
    constants for the contact state (drive 1, none 0, coast -1) and the stiffness segment.
    """
    damping_series, stiffness_series = perturbation[_DAMPING], perturbation[_STIFFNESS]
    force_slope = perturbation[_FORCE_SLOPE]
    d2, d3, p2, p3 = velocity_sign * constants[D2], constants[D3], constants[P2], constants[P3]
    for k in range(ORDER):
        damping_series[k] = 2.0 * d2 * series[VELOCITY, k] + 3.0 * d3 * series[VELOCITY_SQUARE, k]
        deflection = series[DISPLACEMENT, k] - (constants[FLANK_LINE] if k == 0 else 0.0)
        force_slope[k] = 2.0 * p2 * deflection + 3.0 * p3 * series[DEFLECTION_SQUARE, k]
        stiffness_series[k] = 0.0
    # The linear terms of damping and spring force have constant derivatives.
    damping_series[0] += constants[D1]
    force_slope[0] += 1.0
    if contact_state == NO_CONTACT:
        return
    for i in range(ORDER):
        # A stiffness without harmonics has only two coefficients.
        if series[STIFFNESS, i] != 0.0:
            for k in range(ORDER - i):
                stiffness_series[i + k] += series[STIFFNESS, i] * force_slope[k]


@kernel_part(inlined=True)
def _series_value(coefficients, t):
    """Return the value at t of a power series with ORDER + 1 coefficients, constant first."""
    total = coefficients[ORDER]
    for k in range(ORDER - 1, -1, -1):
        total = total * t + coefficients[k]
    return total


@kernel_part(inlined=True)
def set_identity(map_matrix):
    """Set the map of a perturbation (w, w'), shape (2, 2), to the identity matrix."""
    map_matrix[0, 0] = map_matrix[1, 1] = 1.0
    map_matrix[0, 1] = map_matrix[1, 0] = 0.0


@kernel_part
def map_step(constants, contact_state, velocity_sign, step, series, perturbation, map_matrix):
    """Multiply a map of perturbations (w, w'), shape (2, 2), from the left by the map of a step.

    `step` is the length of the Taylor step, and `series` holds the series of the motion, whose
    velocity has the sign `velocity_sign` during the whole step. `constants`, shape (COLUMNS,),
    holds the constants for the contact state (drive 1, none 0, coast -1) and the stiffness segment.
    `perturbation`, (6, ORDER + 1), is overwritten.
    """
    _fill_equation(constants, contact_state, velocity_sign, series, perturbation)
    ground = constants[GROUND_STIFFNESS]
    w, rate, acceleration = perturbation[_W], perturbation[_RATE], perturbation[_ACCELERATION]
    damping_series, stiffness_series = perturbation[_DAMPING], perturbation[_STIFFNESS]
    # Number of coefficients of damping and stiffness without trailing zeros.
    term_count = ORDER
    while (
        term_count > 1
        and damping_series[term_count - 1] == 0.0
        and stiffness_series[term_count - 1] == 0.0
    ):
        term_count -= 1
    for j in range(2):
        w[0], rate[0] = map_matrix[0, j], map_matrix[1, j]
        acceleration[:] = 0.0
        for k in range(ORDER):
            # Coefficient k contributes to all later terms.
            for i in range(min(term_count, ORDER - k)):
                acceleration[k + i] -= damping_series[i] * rate[k] + stiffness_series[i] * w[k]
            w[k + 1] = rate[k] * _INVERSE[k]
            rate[k + 1] = (acceleration[k] - ground * w[k]) * _INVERSE[k]
        map_matrix[0, j], map_matrix[1, j] = _series_value(w, step), _series_value(rate, step)


@kernel_part(inlined=True)
def _damping_coefficient(constants, speed):
    """Return the damping force divided by x' at the speed |x'|.

    `constants`, shape (COLUMNS,), has the coefficients D1, D2 and D3 of linear to cubic damping.
    """
    return constants[D1] + constants[D2] * speed + constants[D3] * speed * speed


@kernel_part
def map_crossing(constants, segment, contact_before, contact_after, v, map_matrix):
    """Multiply a map of perturbations, (2, 2), from the left by the saltation matrix of a crossing.

    The saltation matrix describes the jump of a perturbation due to the jump of the damping. The
    contact state (drive 1, none 0, coast -1) changes from `contact_before` to `contact_after` at
    the velocity v, in a stiffness segment. `constants` has the shape (3, m, COLUMNS), by contact
    state + 1 and segment. Without backlash, a change from flank to flank passes through free
    flight.
    """
    contact_state, speed = contact_before, abs(v)
    while contact_state != contact_after:
        # A change from flank to flank passes through free flight.
        next_contact = (
            contact_after
            if contact_state == NO_CONTACT or contact_after == NO_CONTACT
            else NO_CONTACT
        )
        jump = _damping_coefficient(constants[next_contact + 1, segment], speed)
        jump -= _damping_coefficient(constants[contact_state + 1, segment], speed)
        for j in range(2):
            map_matrix[1, j] -= jump * map_matrix[0, j]
        contact_state = next_contact
