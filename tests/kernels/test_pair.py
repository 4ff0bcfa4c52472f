"""Closed forms of the gear pair: motion, first events, tables, maps."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.pair import contact_table, events, maps, motion, sampling, settling
from gearlib.engines.pair.motion import cos_sin, negative_exponential

TUNING = 0.8
#: Levels of stiffness that are underdamped, critically damped and overdamped.
LEVELS = [motion.stiffness_level_at_tuning(1.0, damping, TUNING) for damping in (0.05, 1.0, 1.7)]
STARTS = [(0.7, -1.5), (-0.4, 2.0), (1.2, 0.0), (-0.9, -0.3)]
CASES = list(product(LEVELS, STARTS))
#: A mesh from C_max, C_min, half the phase of C_max, phase of C_min, damping ratios and backlash.
MESH = motion.pair_constants_at_tuning(np.array([1.2, 0.7, 1.8, 2.7, 0.06, 0.03, 1.4]), TUNING)


def test_elementary_functions_match_the_c_library():
    for z in (0.0, 1e-9, 0.34, 1.0, 17.3, 650.0):
        assert negative_exponential(z) == pytest.approx(math.exp(-z), rel=5e-16)
        assert cos_sin(-z) == pytest.approx((math.cos(z), -math.sin(z)), abs=5e-16)


@pytest.mark.parametrize(("level", "start"), CASES)
def test_contact_follows_its_equation_and_turns_where_its_velocity_is_zero(level, start):
    """Compare motions in contact with the matrix exponential, and turning times with v = 0."""
    times = np.linspace(0.0, 6.0, 601)
    states = np.array([motion.evolve(level, *start, t) for t in times])
    matrix = np.array([[0.0, 1.0], [-level.natural_squared, -2.0 * level.decay_rate]])
    expected = [expm(t * matrix) @ start for t in times[::50]]
    np.testing.assert_allclose(states[::50], expected, rtol=0, atol=1e-13)
    turning_time = motion.next_turning_time(level, *start)
    signs = np.sign(states[(times > 1e-9) & (times < turning_time - 1e-9), 1])
    assert np.ptp(signs) == 0.0
    if turning_time < math.inf:
        assert abs(motion.evolve(level, *start, turning_time)[1]) < 1e-13


@pytest.mark.parametrize(
    ("level", "start", "line"),
    [(*case, line) for case in CASES for line in (-1.1, -0.5, 0.2) if case[1][0] > line],
)
def test_a_descent_is_found_at_the_first_crossing_of_a_dense_curve(level, start, line):
    """The time of descent to `line` must be the first zero of a densely sampled motion."""
    assert events.descent_time(level, line, -1.0, line, 6.0) == 0.0
    times = np.linspace(0.0, 6.0, 601)
    heights = np.array([motion.evolve(level, *start, t)[0] for t in times]) - line
    descent_time = events.descent_time(level, *start, line, 6.0)
    assert (heights[times < descent_time] > 0.0).all()
    if descent_time < math.inf:
        assert motion.evolve(level, *start, descent_time)[0] == pytest.approx(line, abs=1e-14)
        assert events.descent_time(level, *start, line, 0.99 * descent_time) == math.inf


@pytest.mark.parametrize("drag", [0.0, 0.02, 0.4, 3.0])
@pytest.mark.parametrize("v", [-0.05, -0.8, -2.5])
def test_a_free_flight_follows_its_equation_up_to_its_impact(drag, v):
    """Compare flights with the matrix exponential, and times of impacts with the flight itself."""
    load = 1.3
    matrix = np.array([[0.0, 1.0, 0.0], [0.0, -2.0 * drag, load], [0.0, 0.0, 0.0]])
    for t in (0.01, 0.7, 3.0):
        flight_state, expected = motion.free_flight(drag, load, -0.2, v, t), expm(matrix * t)
        np.testing.assert_allclose(
            flight_state, (expected @ (-0.2, v, 1.0))[:2], rtol=1e-13, atol=1e-14
        )
    lowest_time = motion.lowest_point_time(drag, load, v)
    lowest, speed = motion.free_flight(drag, load, 0.0, v, lowest_time)
    assert abs(speed) < 1e-14
    return_time, impact_speed = motion.return_flight(drag, load, v)
    assert motion.free_flight(drag, load, 0.0, v, return_time) == pytest.approx((0.0, impact_speed))
    assert return_time == pytest.approx(lowest_time + motion.climb_time(drag, load, -lowest, 0.0))
    fall_time = motion.fall_time(drag, load, -0.5 * lowest, v)
    assert fall_time < lowest_time
    assert motion.free_flight(drag, load, 0.0, v, fall_time)[0] == pytest.approx(0.5 * lowest)
    narrow, wide = -0.5 * lowest, -2.0 * lowest
    assert events.next_impact(drag, load, wide, 0.0, v) == pytest.approx((return_time, DRIVE))
    assert events.next_impact(drag, load, narrow, 0.0, v) == pytest.approx((fall_time, COAST))


def marched(x, v):
    """Return ((contact state, x, v) after a mesh period, arcs) of a motion from a state."""
    arcs, contact = (
        np.empty((60, events.ARC_COLUMNS)),
        motion.pair_contact_state(MESH.backlash_ratio, x, v),
    )
    *end, count = events.march_period(MESH, contact, x, v, arcs, 60)
    return end, arcs[:count]


def test_arcs_of_a_period_join_and_change_contact_at_the_flank_lines():
    """Each arc must end where the next one starts, with changes of contact on flank lines only."""
    codes = set()
    for start in [(-0.5, -3.0), (0.3, -2.0), (2.0, 1.0)]:
        (_, *end), arcs = marched(*start)
        phases, durations = arcs[:, events.START], arcs[:, events.DURATION]
        np.testing.assert_allclose(phases, np.append(0.0, np.cumsum(durations)[:-1]), atol=1e-13)
        assert durations.sum() == pytest.approx(2.0 * 1.8 + 2.7)
        starts = [*map(tuple, arcs[1:, [events.DISPLACEMENT, events.VELOCITY]]), tuple(end)]
        for arc, following in zip(arcs, starts, strict=True):
            t = arc[events.START] + arc[events.DURATION]
            x, v, _, force = sampling.state_in_arc(MESH, arc, t)
            assert (x, v) == pytest.approx(following, abs=1e-12)
            assert arc[events.CONTACT] * force >= -1e-12
        changes = np.diff(arcs[:, events.CONTACT]) != 0.0
        assert np.isin(arcs[1:, events.DISPLACEMENT][changes], (0.0, -1.4)).all()
        codes |= set(arcs[:, events.CONTACT])
    assert codes == {DRIVE, NO_CONTACT, COAST}


def test_the_period_map_matches_difference_quotients():
    """The derivative of a period must match central differences with a step of 1e-6."""
    start, period_map = np.array([-0.5, -3.0]), np.eye(2)
    arcs, h = marched(*start)[1], 1e-6
    first_code = int(arcs[0, events.CONTACT])
    maps.multiply_by_arc_maps(MESH, arcs, len(arcs), first_code, period_map)
    ends = [[marched(*(start + sign * h * e))[0][1:] for sign in (1, -1)] for e in np.eye(2)]
    quotients = [(np.array(plus) - minus) / (2.0 * h) for plus, minus in ends]
    np.testing.assert_allclose(period_map, np.transpose(quotients), rtol=0, atol=1e-7)


def test_powers_of_a_map_stay_within_their_bound():
    """Compare the bound of the sum of norms of all powers with the sum itself."""
    rows = (0.5, 0.3, -0.4, 0.6)
    matrix, scale = np.reshape(rows, (2, 2)), np.array([[1.0, 1.0 / TUNING], [TUNING, 1.0]])
    np.testing.assert_allclose(settling.matrix_product(rows, rows), (matrix @ matrix).ravel())
    powers = [np.linalg.matrix_power(matrix, k) for k in range(200)]
    total = sum(np.linalg.norm(scale * power) for power in powers)
    assert total <= settling.power_sum_bound(MESH, rows) < 100.0 * total
    assert settling.power_sum_bound(MESH, (1.0, 0.0, 0.0, 1.0)) == math.inf


def test_tabulated_motions_match_closed_forms():
    """Compare motions and losses of contact from tables with the closed forms."""
    level, length = MESH.low_level, 2.7
    levels = np.zeros((1, contact_table.LEVEL_COLUMNS))
    tables = np.zeros((1, contact_table.ENTRIES, 2))
    contact_table.fill_level_constants(level, length, levels[0])
    contact_table.fill_table(level, levels[0], tables[0])
    last, spacing = int(levels[0, contact_table.LAST_ENTRY]), levels[0, contact_table.SPACING]
    proven_counts = {"loss": 0, "none": 0}
    for u, v in [(0.2, -2.5), (0.4, 1.0), (1.0, -1.0), (-1.0, 1.5), (0.1, 0.4)]:
        for k in range(0, last + 1, 7):
            x, s = tables[0, k]
            state = contact_table.advance_by_responses(levels, 0, u, v, x, s)
            state = contact_table.advance_by_series(levels, 0, *state, 0.6 * spacing)
            expected = motion.evolve(level, u, v, (k + 0.6) * spacing)
            np.testing.assert_allclose(state, expected, rtol=0, atol=1e-14)
        k, is_below = contact_table.lowest_entry(levels, tables, 0, u, v)
        loss = events.descent_time(level, u, v, -level.equilibrium, length)
        t, speed, _ = contact_table.first_loss_of_contact(levels, tables, 0, u, v, k, length)
        if t >= 0.0:
            proven_counts["loss"] += 1
            assert t == pytest.approx(loss, abs=1e-14)
            assert speed == pytest.approx(motion.evolve(level, u, v, loss)[1], abs=1e-13)
        if contact_table.first_minimum_is_above(levels, tables, 0, u, v, k):
            proven_counts["none"] += 1
            assert loss == math.inf and not is_below
    assert all(proven_counts.values())
