"""Check closed forms of the gear pair: motion, first events, tables and maps."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.linalg import expm

from gearlib.engines.codes import COAST, DRIVE, NO_CONTACT
from gearlib.engines.pair import contact_table, events, maps, motion, sampling, settling
from gearlib.engines.pair.motion import cos_sin, negative_exponential

TUNING = 0.8
#: Constants of contact at constant stiffness: underdamped, critically damped and overdamped.
STIFFNESS_LEVELS = [
    motion.stiffness_level_at_tuning(1.0, damping, TUNING) for damping in (0.05, 1.0, 1.7)
]
INITIAL_STATES = [(0.7, -1.5), (-0.4, 2.0), (1.2, 0.0), (-0.9, -0.3)]
CASES = list(product(STIFFNESS_LEVELS, INITIAL_STATES))
#: Durations, in rad of the mesh phase: half of the high stiffness, and of the low stiffness.
HALF_HIGH, LOW = 1.8, 2.7
BACKLASH = 1.4
#: Constants of a pair with the stiffnesses 1.2 and 0.7 and the damping ratios 0.06 and 0.03.
PAIR_CONSTANTS = motion.pair_constants_at_tuning(
    np.array([1.2, 0.7, HALF_HIGH, LOW, 0.06, 0.03, BACKLASH]), TUNING
)


def test_elementary_functions_match_the_c_library():
    for z in (0.0, 1e-9, 0.34, 1.0, 17.3, 650.0):
        assert negative_exponential(z) == pytest.approx(math.exp(-z), rel=5e-16)
        assert cos_sin(-z) == pytest.approx((math.cos(z), -math.sin(z)), abs=5e-16)


@pytest.mark.parametrize(("level", "start"), CASES)
def test_contact_follows_its_equation_and_turns_where_its_velocity_is_zero(level, start):
    """Motion in contact must match the matrix exponential, and turn where its velocity is zero."""
    times, stride = np.linspace(0.0, 6.0, 601), 50
    states = np.array([motion.evolve(level, *start, t) for t in times])
    matrix = np.array([[0.0, 1.0], [-level.natural_squared, -2.0 * level.decay_rate]])
    expected = [expm(t * matrix) @ start for t in times[::stride]]
    np.testing.assert_allclose(states[::stride], expected, rtol=0, atol=1e-13)
    # The velocity must not change its sign before the turning time.
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
    """The displacement must be above `line` before the time of descent, and equal to it then."""
    end = 6.0
    # A motion that starts on the line with a negative velocity descends at once.
    assert events.descent_time(level, line, -1.0, line, end) == 0.0
    times = np.linspace(0.0, end, 601)
    displacements = np.array([motion.evolve(level, *start, t)[0] for t in times])
    descent_time = events.descent_time(level, *start, line, end)
    assert (displacements[times < descent_time] > line).all()
    if descent_time < math.inf:
        assert motion.evolve(level, *start, descent_time)[0] == pytest.approx(line, abs=1e-14)
        assert events.descent_time(level, *start, line, 0.99 * descent_time) == math.inf


@pytest.mark.parametrize("drag", [0.0, 0.02, 0.4, 3.0])
@pytest.mark.parametrize("v", [-0.05, -0.8, -2.5])
def test_a_free_flight_follows_its_equation_up_to_its_impact(drag, v):
    """A free flight x'' + 2 drag x' = load must match the matrix exponential.

    It must hit the coast flank if the backlash is smaller than its depth, else the drive flank.
    """
    load, x = 1.3, -0.2
    # The third component of the state is 1, which the load multiplies.
    matrix = np.array([[0.0, 1.0, 0.0], [0.0, -2.0 * drag, load], [0.0, 0.0, 0.0]])
    for t in (0.01, 0.7, 3.0):
        state = motion.free_flight(drag, load, x, v, t)
        expected = (expm(matrix * t) @ (x, v, 1.0))[:2]
        np.testing.assert_allclose(state, expected, rtol=1e-13, atol=1e-14)
    lowest_time = motion.lowest_point_time(drag, load, v)
    lowest_point, velocity = motion.free_flight(drag, load, 0.0, v, lowest_time)
    assert abs(velocity) < 1e-14
    return_time, impact_velocity = motion.return_flight(drag, load, v)
    state = motion.free_flight(drag, load, 0.0, v, return_time)
    assert state == pytest.approx((0.0, impact_velocity))
    climb_time = motion.climb_time(drag, load, -lowest_point, 0.0)
    assert return_time == pytest.approx(lowest_time + climb_time)
    small_backlash, large_backlash = -0.5 * lowest_point, -2.0 * lowest_point
    fall_time = motion.fall_time(drag, load, small_backlash, v)
    assert fall_time < lowest_time
    x, _ = motion.free_flight(drag, load, 0.0, v, fall_time)
    assert x == pytest.approx(-small_backlash)
    impact = events.next_impact(drag, load, large_backlash, 0.0, v)
    assert impact == pytest.approx((return_time, DRIVE))
    impact = events.next_impact(drag, load, small_backlash, 0.0, v)
    assert impact == pytest.approx((fall_time, COAST))


def march_one_period(x, v):
    """Return [contact state, x, v] after a mesh period from the state (x, v), and the arcs.

    An arc is a row that describes the motion between two events or changes of the stiffness.
    """
    max_arcs = 60
    arcs = np.empty((max_arcs, events.ARC_COLUMNS))
    contact = motion.pair_contact_state(PAIR_CONSTANTS.backlash_ratio, x, v)
    *end, count = events.march_period(PAIR_CONSTANTS, contact, x, v, arcs, max_arcs)
    return end, arcs[:count]


def test_arcs_of_a_period_join_and_change_contact_at_the_flank_lines():
    """Each arc must end where the next one starts, and contact change on flank lines only.

    The mesh force must have the sign of the contact state.
    """
    contact_states = set()
    for start in [(-0.5, -3.0), (0.3, -2.0), (2.0, 1.0)]:
        (_, *final_state), arcs = march_one_period(*start)
        phases, durations = arcs[:, events.START], arcs[:, events.DURATION]
        np.testing.assert_allclose(phases, np.append(0.0, np.cumsum(durations)[:-1]), atol=1e-13)
        assert durations.sum() == pytest.approx(2.0 * HALF_HIGH + LOW)
        start_states = arcs[:, [events.DISPLACEMENT, events.VELOCITY]]
        next_states = [*start_states[1:], final_state]
        for arc, next_state in zip(arcs, next_states, strict=True):
            end_phase = arc[events.START] + arc[events.DURATION]
            x, v, _, force = sampling.state_in_arc(PAIR_CONSTANTS, arc, end_phase)
            assert (x, v) == pytest.approx(tuple(next_state), abs=1e-12)
            assert arc[events.CONTACT] * force >= -1e-12
        contact_changes = np.diff(arcs[:, events.CONTACT]) != 0.0
        displacements = arcs[1:, events.DISPLACEMENT][contact_changes]
        assert np.isin(displacements, (0.0, -BACKLASH)).all()
        contact_states |= set(arcs[:, events.CONTACT])
    assert contact_states == {DRIVE, NO_CONTACT, COAST}


def test_the_period_map_matches_difference_quotients():
    """The derivative of the final with respect to the initial state must match differences."""
    start, period_map = np.array([-0.5, -3.0]), np.eye(2)
    _, arcs = march_one_period(*start)
    first_contact = int(arcs[0, events.CONTACT])
    maps.multiply_by_arc_maps(PAIR_CONSTANTS, arcs, len(arcs), first_contact, period_map)
    step, quotients = 1e-6, []
    for direction in np.eye(2):
        (_, *forward_state), _ = march_one_period(*(start + step * direction))
        (_, *backward_state), _ = march_one_period(*(start - step * direction))
        quotients.append(np.subtract(forward_state, backward_state) / (2.0 * step))
    np.testing.assert_allclose(period_map, np.transpose(quotients), rtol=0, atol=1e-7)


def test_powers_of_a_map_stay_within_their_bound():
    """The sum of the norms of all powers of a map must not exceed its bound.

    For the identity, whose powers do not decay, the bound is infinite.
    """
    entries = (0.5, 0.3, -0.4, 0.6)
    matrix = np.reshape(entries, (2, 2))
    squared_matrix = settling.matrix_product(entries, entries)
    np.testing.assert_allclose(squared_matrix, (matrix @ matrix).ravel())
    # The norm has velocities multiplied by the tuning. 200 powers are enough for the sum.
    scale = np.array([[1.0, 1.0 / TUNING], [TUNING, 1.0]])
    powers = [np.linalg.matrix_power(matrix, exponent) for exponent in range(200)]
    norm_sum = sum(np.linalg.norm(scale * power) for power in powers)
    assert norm_sum <= settling.power_sum_bound(PAIR_CONSTANTS, entries) < 100.0 * norm_sum
    assert settling.power_sum_bound(PAIR_CONSTANTS, (1.0, 0.0, 0.0, 1.0)) == math.inf


def test_tabulated_motions_match_closed_forms():
    """Motions and losses of contact that tables give must match the closed forms.

    Tables may prove that contact is lost, or that it is not lost, or decide neither.
    """
    level, length = PAIR_CONSTANTS.low_level, LOW
    levels = np.zeros((1, contact_table.LEVEL_COLUMNS))
    tables = np.zeros((1, contact_table.ENTRIES, 2))
    contact_table.fill_level_constants(level, length, levels[0])
    contact_table.fill_table(level, levels[0], tables[0])
    last_entry = int(levels[0, contact_table.LAST_ENTRY])
    spacing = levels[0, contact_table.SPACING]
    loss_count = no_loss_count = 0
    # The initial states are displacements from the equilibrium and velocities.
    for u, v in [(0.2, -2.5), (0.4, 1.0), (1.0, -1.0), (-1.0, 1.5), (0.1, 0.4)]:
        for entry in range(0, last_entry + 1, 7):
            # An entry has the responses to a displacement and to a velocity.
            responses = tables[0, entry]
            state = contact_table.advance_by_responses(levels, 0, u, v, *responses)
            state = contact_table.advance_by_series(levels, 0, *state, 0.6 * spacing)
            expected = motion.evolve(level, u, v, (entry + 0.6) * spacing)
            np.testing.assert_allclose(state, expected, rtol=0, atol=1e-14)
        entry, is_below = contact_table.lowest_entry(levels, tables, 0, u, v)
        loss_time = events.descent_time(level, u, v, -level.equilibrium, length)
        time, velocity, _ = contact_table.first_loss_of_contact(
            levels, tables, 0, u, v, entry, length
        )
        if time >= 0.0:
            loss_count += 1
            assert time == pytest.approx(loss_time, abs=1e-14)
            _, expected_velocity = motion.evolve(level, u, v, loss_time)
            assert velocity == pytest.approx(expected_velocity, abs=1e-13)
        if contact_table.first_minimum_is_above(levels, tables, 0, u, v, entry):
            no_loss_count += 1
            assert loss_time == math.inf and not is_below
    assert loss_count > 0 and no_loss_count > 0
