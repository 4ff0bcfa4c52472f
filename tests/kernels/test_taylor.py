"""Taylor steps: series that satisfy their equation, lengths, crossings, maps, pairs of teeth."""

import math
from itertools import product

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from gearlib.engines.codes import BACKLASH, INVERSE, NORMAL
from gearlib.engines.polynomial import WORK_ROWS, bernstein_matrix
from gearlib.engines.taylor import perturbations, series, taylor_run, teeth
from tests.properties.known_models import KNOWN

ORDER = series.ORDER
MATRIX, WORK = bernstein_matrix(ORDER), np.empty((WORK_ROWS, ORDER + 2))
MODELS = {name: KNOWN[name].model for name in ("everything", "cubic damping", "unequal sides")}
TUNING, PHASE, SEGMENT = 0.7, 1.3, 1
CASES = list(product(MODELS, (NORMAL, BACKLASH, INVERSE), (1.0, -1.0)))


def tables_of(name):
    mesh = MODELS[name].equation.nonlinear_mesh(TUNING, 1e-15)
    return mesh, *series.tabulate_mesh(mesh)


def waves(harmonics, phase):
    """Return the sum of rows (order, cosine, sine) at a phase."""
    return sum(a * math.cos(n * phase) + b * math.sin(n * phase) for n, a, b in harmonics)


def equation_of(mesh, code, phase, x, v):
    """Return (mesh force, acceleration) of the equation in the docstring of `taylor.series`."""
    coast = code == INVERSE
    lines = mesh.coast_stiffness_lines if coast else mesh.stiffness_lines
    value, slope = lines[SEGMENT]
    stiffness = value + slope * (phase - mesh.segment_bounds[SEGMENT])
    stiffness += waves(mesh.coast_stiffness_harmonics if coast else mesh.stiffness_harmonics, phase)
    g, (p2, p3) = x - (mesh.coast_line if coast else mesh.drive_line), mesh.stiffness_powers
    force = stiffness * (g + p2 * (-1.0 if coast else 1.0) * g * g + p3 * g**3) if code else 0.0
    dampings = mesh.coast_damping, mesh.backlash_damping, mesh.drive_damping
    d1, d2, d3 = dampings[code + 1]
    damping = d1 * v + d2 * abs(v) * v + d3 * v**3
    return force, waves(mesh.force_harmonics, phase) - mesh.ground_stiffness * x - damping - force


def motion_of(name, code, sign, x_change=0.0, v_change=0.0):
    """Return (mesh, constants, series of a motion with a contact code and a sign of velocity)."""
    mesh, constants, harmonics = tables_of(name)
    x = {NORMAL: mesh.drive_line + 0.6, INVERSE: mesh.coast_line - 0.6}.get(code, -0.2) + x_change
    terms = np.zeros((series.ROWS, ORDER + 1))
    state = code, sign, x, sign * 0.8 + v_change
    series.expand_motion(constants, harmonics, SEGMENT, PHASE, *state, terms, ORDER)
    return mesh, constants, terms


@pytest.mark.parametrize(("name", "code", "sign"), CASES)
def test_a_series_satisfies_the_equation_of_motion(name, code, sign):
    mesh, constants, terms = motion_of(name, code, sign)
    step = series.step_length(constants, terms, 0.5)
    assert 0.05 < step <= 0.5
    for t in (0.0, 0.4 * step, step):
        x, v = series.state_at(terms, t)
        velocity = Polynomial(terms[series.VELOCITY])
        assert (x, v) == pytest.approx((Polynomial(terms[series.DISPLACEMENT])(t), velocity(t)))
        force, acceleration = equation_of(mesh, code, PHASE + t, x, v)
        # The derivative of the last term is the first that is left out.
        assert velocity.deriv()(t) == pytest.approx(acceleration, rel=0, abs=1e-10)
        assert Polynomial(terms[series.MESH_FORCE])(t) == pytest.approx(force, rel=0, abs=1e-10)
    longer = series.step_length(constants, terms, 50.0)
    assert longer < 50.0 and series.step_length(constants, terms, 0.5 * longer) == 0.5 * longer


@pytest.mark.parametrize(("name", "code", "sign"), CASES)
def test_the_map_of_a_step_is_its_difference_quotient(name, code, sign):
    mesh, constants, terms = motion_of(name, code, sign)
    bound = perturbations.stiffness_bound(mesh)
    row, storage = constants[code + 1, SEGMENT], np.zeros((6, ORDER + 1))
    x, v = terms[series.DISPLACEMENT, 0], terms[series.VELOCITY, 0]
    step = min(0.1, perturbations.max_perturbation_step(row, bound, code, x, v))
    found, h = np.empty((2, 2)), 1e-5
    perturbations.set_identity(found)
    perturbations.map_step(row, code, sign, step, terms, storage, found)
    ends = [
        [series.state_at(motion_of(name, code, sign, *change)[2], step) for change in (d, -d)]
        for d in h * np.eye(2)
    ]
    quotients = [np.subtract(plus, minus) / (2.0 * h) for plus, minus in ends]
    np.testing.assert_allclose(found, np.transpose(quotients), rtol=0, atol=1e-8)


def test_the_bound_of_a_stiffness_and_the_jump_of_a_map():
    mesh, constants, _ = tables_of("unequal sides")
    for lines, harmonics in [
        (mesh.stiffness_lines, mesh.stiffness_harmonics),
        (mesh.coast_stiffness_lines, mesh.coast_stiffness_harmonics),
    ]:
        values = lines[:, 0].max() + waves(harmonics, 0.0)
        assert values <= perturbations.stiffness_bound(mesh)
    # From the drive side through the gap: x'' jumps by the damping, x moves (1, 0) by v dt.
    found, v = np.eye(2), -0.8
    perturbations.map_crossing(constants, SEGMENT, NORMAL, BACKLASH, v, found)
    forces = [
        np.polyval([d3, d2, d1], abs(v))
        for d1, d2, d3 in (mesh.backlash_damping, mesh.drive_damping)
    ]
    np.testing.assert_allclose(found, [[1.0, 0.0], [forces[1] - forces[0], 1.0]], atol=1e-14)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_crossing_is_a_fraction_of_the_step(direction):
    terms = np.zeros((series.ROWS, ORDER + 1))
    terms[0, :3] = 0.5, direction * 0.3, -direction * 0.5  # the line is reached again at 0.6
    found = taylor_run.first_crossing(terms, 0, 0.5, direction, 0.8, MATRIX, WORK)
    assert found == pytest.approx(0.75)
    assert taylor_run.first_crossing(terms, 0, 0.5, direction, 0.5, MATRIX, WORK) == 2.0


#: Factor and offset of a force or an overlap, with slope and square: parabolas over the phase.
LAW = np.zeros(6)
LAW[[teeth.FACTOR, teeth.FACTOR_SLOPE, teeth.FACTOR_SQUARE]] = 1.4, 0.3, -0.2
LAW[[teeth.OFFSET, teeth.OFFSET_SLOPE, teeth.OFFSET_SQUARE]] = 0.2, -0.5, 0.4


def test_a_law_over_time_is_that_over_phase():
    t, speed, acceleration, x = 0.4, 0.9, -0.3, 0.7
    factor, offset = (Polynomial(c) for c in teeth._expand_law(LAW, t, speed, acceleration))
    for time in (0.0, 0.6, 1.5):
        phase = t + speed * time + 0.5 * acceleration * time**2
        expected = teeth._law_value(LAW, phase, x)
        assert factor(time) * x - offset(time) == pytest.approx(expected, abs=1e-14)
    factors, offsets = (Polynomial(LAW[rows]) for rows in ([0, 1, 2], [3, 4, 5]))
    assert teeth._law_value(LAW, t, x) == pytest.approx(factors(t) * x - offsets(t), abs=1e-15)


def expanded_teeth(x, v, step=0.4):
    terms = np.zeros((series.ROWS + 1, ORDER + 1))
    law = teeth._expand_law(LAW, 0.2, 1.0, 0.0)
    changes = teeth._expand_motion(law, 1.5, 0.25, 0.1, 2.0, x, v, step, 0.5, terms)
    return law, terms, changes


def test_a_motion_of_pairs_of_teeth_satisfies_its_equation_and_its_map():
    step, (law, terms, (x_change, v_change, tail)) = 0.4, expanded_teeth(0.7, -0.3)
    displacement, velocity = (
        Polynomial(terms[series.DISPLACEMENT]),
        Polynomial(terms[series.VELOCITY]),
    )
    assert (0.7 + x_change, -0.3 + v_change) == pytest.approx(series.state_at(terms, step))
    assert tail == pytest.approx(
        sum(abs(a) * step ** (k + 3) for k, a in enumerate(displacement.coef[3:]))
    )
    for t in (0.0, 0.3, step):
        force = 2.0 * teeth._law_value(LAW, 0.2 + t, displacement(t))
        acceleration = 1.5 + 0.25 * t - 0.1 * velocity(t) - force
        assert velocity.deriv()(t) == pytest.approx(acceleration, abs=1e-13)
        assert Polynomial(terms[series.MESH_FORCE])(t) == pytest.approx(force, abs=1e-13)
    found, quotients = np.eye(2), []
    teeth._map_step(LAW, 0.2, 0.1, 2.0, step, found)
    for dx, dv in np.eye(2):
        quotients.append(
            np.subtract(expanded_teeth(0.7 + dx, -0.3 + dv)[2][:2], (x_change, v_change))
        )
        quotients[-1] += dx, dv
    # The equation is linear, so that differences of any size are exact.
    np.testing.assert_allclose(found, np.transpose(quotients), rtol=0, atol=1e-12)
    keeps = 0
    for offset, sign in product(np.linspace(-1.0, 2.0, 13), (1.0, -1.0)):
        shifted = law[0], (offset, *law[1][1:])
        times = np.linspace(0.0, step, 101)
        values = Polynomial(shifted[0])(times) * displacement(times) - Polynomial(shifted[1])(times)
        if teeth._keeps_sign(shifted, sign, step, tail, terms):
            keeps += 1
            assert (sign * values > 0.0).all()
    assert keeps > 8


def test_the_pairs_that_touch_are_those_that_overlap():
    # Two springs of stiffness 1: beside a pair under the force x - gap, another one overlaps by
    # less; alone, each overlaps by x less its gap.
    gaps, overlaps = (0.1, 0.3), np.zeros((4, 2, 6))
    overlaps[:, :, teeth.FACTOR] = 1.0
    overlaps[:, :, teeth.OFFSET] = gaps
    expected = {-0.5: 4, 0.0: 0, 0.2: 1, 0.4: 3}
    for x, contact_set in expected.items():
        assert teeth.touching_set(overlaps, 3, -0.4, 0.0, x) == contact_set
        assert teeth._contact_code_of(contact_set, 4) == {4: INVERSE, 0: BACKLASH}.get(
            contact_set, NORMAL
        )
    assert teeth.touching_set(overlaps, 2, -0.4, 0.0, 0.4) == 2
