"""Taylor steps: series that satisfy their equation, lengths, crossings, maps, pairs of teeth."""

import math
from itertools import product

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.polynomial import WORKSPACE_ROWS, bernstein_matrix
from gearlib.engines.taylor import perturbations, propagator, series, teeth
from gearlib.engines.taylor.series import DISPLACEMENT, MESH_FORCE, ORDER, VELOCITY
from tests.properties.known_models import KNOWN

MODELS = {name: KNOWN[name].model for name in ("everything", "powers", "unequal sides")}
MESHES = {name: model.equation.nonlinear_mesh(0.7, 1e-15) for name, model in MODELS.items()}
CASES = list(product(MODELS, (DRIVE, NO_CONTACT, COAST), (1.0, -1.0)))
PHASE, SEGMENT, STEP = 1.3, 1, 0.4


def waves(harmonics, phase):
    """Return the sum of harmonics (order, cosine, sine) at a phase."""
    return sum(a * math.cos(n * phase) + b * math.sin(n * phase) for n, a, b in harmonics)


def equation_of(mesh, code, phase, x, v):
    """Return (mesh force, acceleration) by the equation in the docstring of `taylor.series`."""
    side = "coast_stiffness" if code == COAST else "stiffness"
    value, slope = getattr(mesh, f"{side}_segments")[SEGMENT]
    stiffness = value + slope * (phase - mesh.segment_bounds[SEGMENT])
    stiffness += waves(getattr(mesh, f"{side}_harmonics"), phase)
    g, (p2, p3) = (
        x - (mesh.coast_line if code == COAST else mesh.drive_line),
        mesh.stiffness_powers,
    )
    force = stiffness * (g + p2 * abs(g) * g + p3 * g**3) if code else 0.0
    d1, d2, d3 = (mesh.coast_damping, mesh.backlash_damping, mesh.drive_damping)[code + 1]
    damping = d1 * v + d2 * abs(v) * v + d3 * v**3
    return force, waves(mesh.force_harmonics, phase) - mesh.ground_stiffness * x - damping - force


def motion_of(name, code, sign, x_change=0.0, v_change=0.0):
    """Return (constants of a mesh, Taylor series) of a motion with a contact and a sign of x'."""
    mesh, terms = MESHES[name], np.zeros((series.ROWS, ORDER + 1))
    x = (mesh.coast_line - 0.6, mesh.drive_line - 0.2, mesh.drive_line + 0.6)[code + 1] + x_change
    constants, harmonics = series.tabulate_mesh(mesh)
    state = code, sign, x, 0.8 * sign + v_change
    series.expand_motion(constants, harmonics, SEGMENT, PHASE, *state, terms, ORDER)
    return constants, terms


@pytest.mark.parametrize(("name", "code", "sign"), CASES)
def test_a_series_satisfies_the_equation_of_motion(name, code, sign):
    """Insert the series into the equation of motion at three times of the step."""
    constants, terms = motion_of(name, code, sign)
    step, velocity = series.step_length(constants, terms, 0.5), Polynomial(terms[VELOCITY])
    for t in (0.0, 0.4 * step, step):
        x, v = series.state_at(terms, t)
        assert (x, v) == pytest.approx((Polynomial(terms[DISPLACEMENT])(t), velocity(t)))
        force, acceleration = equation_of(MESHES[name], code, PHASE + t, x, v)
        # The truncation error of the acceleration is the derivative of the first omitted term.
        assert velocity.deriv()(t) == pytest.approx(acceleration, rel=0, abs=1e-10)
        assert Polynomial(terms[MESH_FORCE])(t) == pytest.approx(force, rel=0, abs=1e-10)
    assert 0.05 < step <= 0.5 and series.step_length(constants, terms, 1e4) < 1e4


@pytest.mark.parametrize(("name", "code", "sign"), CASES)
def test_the_map_of_a_step_matches_difference_quotients(name, code, sign):
    """Compare the map of a step with central differences of its end."""
    (constants, terms), h = motion_of(name, code, sign), 1e-5
    row, step_map, storage = (
        constants[code + 1, SEGMENT],
        np.empty((2, 2)),
        np.zeros((6, ORDER + 1)),
    )
    bound, state = perturbations.stiffness_bound(MESHES[name]), terms[[DISPLACEMENT, VELOCITY], 0]
    step = min(0.1, perturbations.max_perturbation_step(row, bound, code, *state))
    perturbations.set_identity(step_map)
    perturbations.map_step(row, code, sign, step, terms, storage, step_map)
    ends = [
        series.state_at(motion_of(name, code, sign, *change)[1], step)
        for change in h * np.vstack([np.eye(2), -np.eye(2)])
    ]
    quotients = np.subtract(ends[:2], ends[2:]) / (2.0 * h)
    np.testing.assert_allclose(step_map, quotients.T, rtol=0, atol=1e-8)


def test_a_map_includes_the_jump_of_the_damping():
    """The map of a crossing must contain the jump of the damping force at the velocity there."""
    mesh, crossing_map, v = MESHES["everything"], np.eye(2), -0.8
    constants, _ = series.tabulate_mesh(mesh)
    perturbations.map_crossing(constants, SEGMENT, DRIVE, NO_CONTACT, v, crossing_map)
    jump = (mesh.drive_damping - mesh.backlash_damping) @ (1.0, abs(v), v * v)
    np.testing.assert_allclose(crossing_map, [[1.0, 0.0], [jump, 1.0]], atol=1e-14)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_crossing_is_located_as_a_fraction_of_the_step(direction):
    """A crossing must be given as a fraction of the step: 0.6 / 0.8, or 2 if beyond the step."""
    tables = bernstein_matrix(ORDER), np.empty((WORKSPACE_ROWS, ORDER + 2))
    terms = np.zeros((series.ROWS, ORDER + 1))
    terms[0, :3] = 0.5, direction * 0.3, -direction * 0.5  # the line is reached again at 0.6
    crossings = [
        propagator.first_crossing(terms, 0, 0.5, direction, h, *tables) for h in (0.8, 0.5)
    ]
    assert crossings == pytest.approx([0.75, 2.0])


#: A force law: factor of the displacement and offset, each a parabola over the phase.
LAW = np.array([1.4, 0.3, -0.2, 0.2, -0.5, 0.4])


def teeth_motion(x, v):
    """Return (law over time, series, (x, v) after a step, sum of terms beyond the square)."""
    terms, law = (
        np.zeros((series.ROWS + 1, ORDER + 1)),
        teeth._expand_linear_form(LAW, 0.2, 1.0, 0.0),
    )
    load, load_rate, damping, scale = 1.5, 0.25, 0.1, 2.0
    equation = load, load_rate, damping, scale
    dx, dv, tail = teeth._expand_motion(law, *equation, x, v, STEP, 0.5, terms)
    return law, terms, np.array([x + dx, v + dv]), tail


def test_a_force_law_over_time_matches_the_law_over_phase():
    """A polynomial in phase must have the same value after expansion in time."""
    factor, offset = map(Polynomial, teeth._expand_linear_form(LAW, 0.4, 0.9, -0.3))
    for time in (0.0, 0.6, 1.5):
        phase = 0.4 + 0.9 * time - 0.15 * time**2
        expected = Polynomial(LAW[:3])(phase) * 0.7 - Polynomial(LAW[3:])(phase)
        assert teeth._evaluate_linear_form(LAW, phase, 0.7) == pytest.approx(expected, abs=1e-14)
        assert factor(time) * 0.7 - offset(time) == pytest.approx(expected, abs=1e-14)


def test_a_motion_of_tooth_pairs_satisfies_its_equation_and_its_map():
    """Insert the series into the equation, and compare the map with differences of motions."""
    law, terms, end, tail = teeth_motion(0.7, -0.3)
    displacement, velocity = Polynomial(terms[DISPLACEMENT]), Polynomial(terms[VELOCITY])
    assert end == pytest.approx([displacement(STEP), velocity(STEP)])
    assert tail == pytest.approx(np.abs(terms[DISPLACEMENT, 3:]) @ STEP ** np.arange(3, ORDER + 1))
    for t in (0.0, 0.3, STEP):
        force = 2.0 * teeth._evaluate_linear_form(LAW, 0.2 + t, displacement(t))
        acceleration = 1.5 + 0.25 * t - 0.1 * velocity(t) - force
        assert velocity.deriv()(t) == pytest.approx(acceleration, abs=1e-13)
        assert Polynomial(terms[MESH_FORCE])(t) == pytest.approx(force, abs=1e-13)
    step_map = np.eye(2)
    teeth._map_step(LAW, 0.2, 0.1, 2.0, STEP, step_map)
    # The equation is linear, so that difference quotients of any step are exact.
    columns = [teeth_motion(*start)[2] - end for start in ((1.7, -0.3), (0.7, 0.7))]
    np.testing.assert_allclose(step_map, np.transpose(columns), rtol=0, atol=1e-12)
    (factors, offsets), kept_count, times = law, 0, np.linspace(0.0, STEP, 101)
    for offset, sign in product(np.linspace(-1.0, 2.0, 13), (1.0, -1.0)):
        shifted = offset, *offsets[1:]
        values = Polynomial(factors)(times) * displacement(times) - Polynomial(shifted)(times)
        keeps_sign = teeth._keeps_sign((factors, shifted), sign, STEP, tail, terms)
        kept_count += keeps_sign
        assert not keeps_sign or (sign * values > 0.0).all()
    assert kept_count > 8


def test_tooth_pairs_touch_where_they_overlap():
    """The set of touching tooth pairs must hold each pair whose overlap is positive."""
    # The overlap of a pair is x minus its gap. Bits of a set are pairs, and 4 is the coast side.
    overlaps = np.zeros((4, 2, 6))
    overlaps[:, :, teeth.FACTOR], overlaps[:, :, teeth.OFFSET] = 1.0, (0.1, 0.3)
    sets = [teeth.find_contact_mask(overlaps, 3, -0.4, 0.0, x) for x in (-0.5, 0.0, 0.2, 0.4)]
    assert sets == [4, 0, 1, 3] and teeth.find_contact_mask(overlaps, 2, -0.4, 0.0, 0.4) == 2
    codes = [teeth._contact_state_of_mask(contact_set, 4) for contact_set in sets]
    assert codes == [COAST, NO_CONTACT, DRIVE, DRIVE]
