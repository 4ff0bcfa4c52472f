"""Check Taylor steps: series, step lengths, crossings and maps, also for tooth pairs."""

import math
from itertools import product

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.polynomial import WORKSPACE_ROWS, bernstein_matrix
from gearlib.engines.taylor import perturbations, propagator, series, teeth
from gearlib.engines.taylor.series import DISPLACEMENT, MESH_FORCE, ORDER, VELOCITY
from tests.properties.known_models import MOTION_CASES

MODELS = {name: MOTION_CASES[name].model for name in ("everything", "powers", "unequal sides")}
MESH_CONSTANTS = {name: model.equation.nonlinear_mesh(0.7, 1e-15) for name, model in MODELS.items()}
CASES = list(product(MODELS, (DRIVE, NO_CONTACT, COAST), (1.0, -1.0)))
#: Mesh phase at the start of a step, its segment of the stiffness, and a step of tooth pairs.
PHASE, SEGMENT, STEP = 1.3, 1, 0.4


def sum_of_harmonics(harmonics, phase):
    """Return the sum of harmonics, rows of order, cosine and sine coefficient, at a phase."""
    return sum(
        cosine * math.cos(order * phase) + sine * math.sin(order * phase)
        for order, cosine, sine in harmonics
    )


def force_and_acceleration(mesh, contact, phase, x, v):
    """Return mesh force and acceleration at the displacement x and the velocity v.

    They follow from the equation of motion in the docstring of `taylor.series`; `contact` is the
    contact state.
    """
    side = "coast_stiffness" if contact == COAST else "stiffness"
    value, slope = getattr(mesh, f"{side}_segments")[SEGMENT]
    stiffness = value + slope * (phase - mesh.segment_bounds[SEGMENT])
    stiffness += sum_of_harmonics(getattr(mesh, f"{side}_harmonics"), phase)
    deflection = x - (mesh.coast_line if contact == COAST else mesh.drive_line)
    quadratic, cubic = mesh.stiffness_powers
    mesh_force = 0.0
    if contact != NO_CONTACT:
        powers = deflection + quadratic * abs(deflection) * deflection + cubic * deflection**3
        mesh_force = stiffness * powers
    # The contact states -1, 0 and 1 select the damping coefficients.
    dampings = mesh.coast_damping, mesh.backlash_damping, mesh.drive_damping
    linear, quadratic, cubic = dampings[contact + 1]
    damping_force = linear * v + quadratic * abs(v) * v + cubic * v**3
    external_force = sum_of_harmonics(mesh.force_harmonics, phase) - mesh.ground_stiffness * x
    return mesh_force, external_force - damping_force - mesh_force


def expand_motion(name, contact, sign, x_change=0.0, v_change=0.0):
    """Return the constants of a mesh and the Taylor series of a motion.

    The motion has the contact state `contact` and a velocity with the given sign. The changes are
    added to its initial displacement and velocity.
    """
    mesh, terms = MESH_CONSTANTS[name], np.zeros((series.ROWS, ORDER + 1))
    displacements = mesh.coast_line - 0.6, mesh.drive_line - 0.2, mesh.drive_line + 0.6
    x, v = displacements[contact + 1] + x_change, 0.8 * sign + v_change
    constants, harmonics = series.tabulate_mesh(mesh)
    series.expand_motion(constants, harmonics, SEGMENT, PHASE, contact, sign, x, v, terms, ORDER)
    return constants, terms


@pytest.mark.parametrize(("name", "contact", "sign"), CASES)
def test_a_series_satisfies_the_equation_of_motion(name, contact, sign):
    """At three times of a step, acceleration and mesh force must satisfy the equation of motion."""
    constants, terms = expand_motion(name, contact, sign)
    max_step = 0.5
    step, velocity = series.step_length(constants, terms, max_step), Polynomial(terms[VELOCITY])
    for t in (0.0, 0.4 * step, step):
        x, v = series.state_at(terms, t)
        assert (x, v) == pytest.approx((Polynomial(terms[DISPLACEMENT])(t), velocity(t)))
        force, acceleration = force_and_acceleration(MESH_CONSTANTS[name], contact, PHASE + t, x, v)
        # The truncation error of the acceleration is the derivative of the first omitted term.
        assert velocity.deriv()(t) == pytest.approx(acceleration, rel=0, abs=1e-10)
        assert Polynomial(terms[MESH_FORCE])(t) == pytest.approx(force, rel=0, abs=1e-10)
    assert 0.05 < step <= max_step and series.step_length(constants, terms, 1e4) < 1e4


@pytest.mark.parametrize(("name", "contact", "sign"), CASES)
def test_the_map_of_a_step_matches_difference_quotients(name, contact, sign):
    """The derivative of the final with respect to the initial state must match differences."""
    constants, terms = expand_motion(name, contact, sign)
    segment_constants = constants[contact + 1, SEGMENT]
    step_map, workspace = np.empty((2, 2)), np.zeros((6, ORDER + 1))
    stiffness_bound = perturbations.stiffness_bound(MESH_CONSTANTS[name])
    state = terms[[DISPLACEMENT, VELOCITY], 0]
    max_step = perturbations.max_perturbation_step(
        segment_constants, stiffness_bound, contact, *state
    )
    step = min(0.1, max_step)
    perturbations.set_identity(step_map)
    perturbations.map_step(segment_constants, contact, sign, step, terms, workspace, step_map)
    increment, quotients = 1e-5, []
    for direction in np.eye(2):
        forward_state, backward_state = (
            series.state_at(expand_motion(name, contact, sign, *change)[1], step)
            for change in (increment * direction, -increment * direction)
        )
        quotients.append(np.subtract(forward_state, backward_state) / (2.0 * increment))
    np.testing.assert_allclose(step_map, np.transpose(quotients), rtol=0, atol=1e-8)


def test_a_map_includes_the_jump_of_the_damping():
    """The map of a crossing must contain the jump of the damping force over the velocity v."""
    mesh, crossing_map, v = MESH_CONSTANTS["everything"], np.eye(2), -0.8
    constants, _ = series.tabulate_mesh(mesh)
    perturbations.map_crossing(constants, SEGMENT, DRIVE, NO_CONTACT, v, crossing_map)
    # The damping force over v is d1 + d2 |v| + d3 v^2.
    jump = (mesh.drive_damping - mesh.backlash_damping) @ (1.0, abs(v), v * v)
    np.testing.assert_allclose(crossing_map, [[1.0, 0.0], [jump, 1.0]], atol=1e-14)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_crossing_is_located_as_a_fraction_of_the_step(direction):
    """A crossing must be given as a fraction of the step, or as 2 if it is beyond the step.

    The displacement 0.5 +- (0.3 t - 0.5 t^2) returns to the line 0.5 at the time 0.6.
    """
    line, crossing_time = 0.5, 0.6
    tables = bernstein_matrix(ORDER), np.empty((WORKSPACE_ROWS, ORDER + 2))
    terms = np.zeros((series.ROWS, ORDER + 1))
    terms[DISPLACEMENT, :3] = line, direction * 0.3, -direction * 0.5
    fraction, no_fraction = (
        propagator.first_crossing(terms, DISPLACEMENT, line, direction, step, *tables)
        for step in (0.8, 0.5)
    )
    assert fraction == pytest.approx(crossing_time / 0.8) and no_fraction == 2.0


#: Coefficients of a force: stiffness and offset, each a parabola over the mesh phase.
FORCE_COEFFICIENTS = np.array([1.4, 0.3, -0.2, 0.2, -0.5, 0.4])
#: Other constants of the equation of motion of tooth pairs.
START_PHASE, LOAD, LOAD_RATE, DAMPING, FORCE_SCALE = 0.2, 1.5, 0.25, 0.1, 2.0


def expand_tooth_motion(x, v):
    """Return the Taylor series of a motion of tooth pairs from the state (x, v), and its results.

    They are the coefficients of the force over time, the series, the state after a step and the sum
    of the terms of the displacement beyond the quadratic one.
    """
    terms = np.zeros((series.ROWS + 1, ORDER + 1))
    force_over_time = teeth._expand_linear_form(FORCE_COEFFICIENTS, START_PHASE, 1.0, 0.0)
    equation = LOAD, LOAD_RATE, DAMPING, FORCE_SCALE
    dx, dv, tail = teeth._expand_motion(force_over_time, *equation, x, v, STEP, 0.5, terms)
    return force_over_time, terms, np.array([x + dx, v + dv]), tail


def test_a_force_law_over_time_matches_the_law_over_phase():
    """A force given over the phase must have the same value after an expansion over time.

    The phase is 0.4 + 0.9 t - 0.3 t^2 / 2.
    """
    x, phase_terms = 0.7, (0.4, 0.9, -0.3)
    stiffness, offset = map(Polynomial, teeth._expand_linear_form(FORCE_COEFFICIENTS, *phase_terms))
    for time in (0.0, 0.6, 1.5):
        phase = 0.4 + 0.9 * time - 0.15 * time**2
        expected = Polynomial(FORCE_COEFFICIENTS[:3])(phase) * x - Polynomial(
            FORCE_COEFFICIENTS[3:]
        )(phase)
        assert teeth._evaluate_linear_form(FORCE_COEFFICIENTS, phase, x) == pytest.approx(
            expected, abs=1e-14
        )
        assert stiffness(time) * x - offset(time) == pytest.approx(expected, abs=1e-14)


def test_a_motion_of_tooth_pairs_satisfies_its_equation_and_its_map():
    """The series must satisfy x'' = load - damping - force, and the map must match differences.

    The equation is linear, so that differences of motions are exact for any increment.
    """
    x, v = 0.7, -0.3
    _, terms, final_state, tail = expand_tooth_motion(x, v)
    displacement, velocity = Polynomial(terms[DISPLACEMENT]), Polynomial(terms[VELOCITY])
    assert final_state == pytest.approx([displacement(STEP), velocity(STEP)])
    powers = STEP ** np.arange(3, ORDER + 1)
    assert tail == pytest.approx(np.abs(terms[DISPLACEMENT, 3:]) @ powers)
    for t in (0.0, 0.3, STEP):
        mesh_force = FORCE_SCALE * teeth._evaluate_linear_form(
            FORCE_COEFFICIENTS, START_PHASE + t, displacement(t)
        )
        acceleration = LOAD + LOAD_RATE * t - DAMPING * velocity(t) - mesh_force
        assert velocity.deriv()(t) == pytest.approx(acceleration, abs=1e-13)
        assert Polynomial(terms[MESH_FORCE])(t) == pytest.approx(mesh_force, abs=1e-13)
    step_map = np.eye(2)
    teeth._map_step(FORCE_COEFFICIENTS, START_PHASE, DAMPING, FORCE_SCALE, STEP, step_map)
    columns = [
        expand_tooth_motion(*state)[2] - final_state for state in ((x + 1.0, v), (x, v + 1.0))
    ]
    np.testing.assert_allclose(step_map, np.transpose(columns), rtol=0, atol=1e-12)


def test_a_force_of_tooth_pairs_that_is_said_to_keep_its_sign_does_so():
    """If a force is said to keep a sign during a step, all its values must have this sign."""
    (stiffness, offset), terms, _, tail = expand_tooth_motion(0.7, -0.3)
    displacement, times = Polynomial(terms[DISPLACEMENT]), np.linspace(0.0, STEP, 101)
    count = 0
    for constant, sign in product(np.linspace(-1.0, 2.0, 13), (1.0, -1.0)):
        changed_offset = constant, *offset[1:]
        forces = Polynomial(stiffness)(times) * displacement(times)
        forces -= Polynomial(changed_offset)(times)
        keeps_sign = teeth._keeps_sign((stiffness, changed_offset), sign, STEP, tail, terms)
        count += keeps_sign
        assert not keeps_sign or (sign * forces > 0.0).all()
    # The sign must be proven in a considerable part of the 26 cases.
    assert count > 8


def test_tooth_pairs_touch_where_they_overlap():
    """The bit mask of contacts must have the bit of each tooth pair whose overlap is positive.

    The overlap of a pair is the displacement x minus its gap, here 0.1 and 0.3.
    """
    first_pair, second_pair, coast_side, coast_line = 0b001, 0b010, 0b100, -0.4
    both_pairs = first_pair | second_pair
    overlaps = np.zeros((4, 2, 6))
    overlaps[:, :, teeth.FACTOR], overlaps[:, :, teeth.OFFSET] = 1.0, (0.1, 0.3)
    masks = [
        teeth.find_contact_mask(overlaps, both_pairs, coast_line, 0.0, x)
        for x in (-0.5, 0.0, 0.2, 0.4)
    ]
    assert masks == [coast_side, 0, first_pair, both_pairs]
    # Only active pairs can touch.
    mask = teeth.find_contact_mask(overlaps, second_pair, coast_line, 0.0, 0.4)
    assert mask == second_pair
    contact_states = [teeth._contact_state_of_mask(mask, coast_side) for mask in masks]
    assert contact_states == [COAST, NO_CONTACT, DRIVE, DRIVE]
