"""A run that has settled ends where one propagated in full does, and no other is taken for one."""

import math

import numpy as np
import pytest

from gearlib import GearPair, OneDegreePair, periodic_orbit, simulate, sweep
from gearlib.kernels import orbit
from gearlib.kernels.closed_form import recorded_arcs
from gearlib.kernels.closed_form.event_by_event import ARC_COLUMNS, march_period
from gearlib.kernels.closed_form.mesh_constants import contact_of, mesh
from gearlib.kernels.closed_form.pair_run import skip
from gearlib.kernels.closed_form.settling import NEAR, clear_of_grazing, sum_of_powers
from gearlib.kernels.closed_form.whole_periods import new_work, set_mesh, set_start
from gearlib.models.propagators.closed_form import ratios
from tests.geometry.drawings import own
from tests.paper import PAPER
from tests.properties.known_models import gears, pairs_as_train
from tests.unit.test_whole_periods import LIMIT, bouncing_case, ratios_of, whole_periods

PAIR = {"contact_ratio": 1.569, "stiffness_ratio": 0.5879, "backlash": 4.0}
#: The small motion of the pair with equal damping ends here in a fold, by bisection over runs of a
#: million periods that start from the state below.
FOLD, AT_FOLD = 0.81685037334556, (-0.16062993275504864, -0.3277925734167014)


def run(m, x, v, periods):
    """Return (x, v, repeat, on_orbit) after so many periods; repeat 0 if it grows out of range."""
    work = new_work()
    set_mesh(work, m)
    set_start(work, x, v)
    _, x, v, _, *rest = skip(m, work, contact_of(m.gap, x, v), x, v, periods, LIMIT)
    return x, v, *rest


def damped_case(rng):
    ratios, tuning, x, v = bouncing_case(rng)
    ratios[4:6] = 10 ** rng.uniform(-2.5, -0.5, 2)
    return mesh(ratios, tuning), x, v


def test_settled_runs_end_where_propagating_them_does():
    rng = np.random.default_rng(1)
    settled = longer = 0
    for _ in range(400):
        m, x, v = damped_case(rng)
        periods = int(rng.integers(100, 4000))
        *end, repeat, _ = run(m, x, v, periods)
        if repeat == 0:
            continue
        settled += 1
        longer += repeat > 1
        _, *plain, _ = whole_periods(m, x, v, periods)
        # NEAR^2 by the least speed of an event, and rounding by the slowest contraction.
        assert np.abs(np.subtract(end, plain)).max() < 2e-12 * (1.0 + abs(plain[0])), (m, x, v)
    assert settled > 300 and longer > 10


def test_transients_are_cut_short_and_followed_to_the_last_digit():
    # Just settled: what is left of the transient is still to be seen, and has to be right.
    m = mesh(ratios_of(1.569, 0.5879, 0.0617, 0.0617, 4.0), 0.9)
    rest = whole_periods(m, 0.0, 0.0, 1000)[1:3]
    seen = 0
    for periods in range(40, 120):
        *end, repeat, _ = run(m, 0.0, 0.0, periods)
        propagated = whole_periods(m, 0.0, 0.0, periods)[1:3]
        assert np.abs(np.subtract(end, propagated)).max() < 1e-14
        seen += repeat > 0 and np.abs(np.subtract(propagated, rest)).max() > 1e-13
    assert seen > 5


@pytest.mark.parametrize("past", [1e-8, 1e-9, 1e-10, 1e-11])
def test_the_ghost_of_a_fold_is_not_an_orbit(past):
    # Beyond the fold a run creeps past where the orbit was, by 1e-10 and less a period, for as many
    # as 1e6 periods, and then goes elsewhere.
    m = mesh(ratios_of(1.569, 0.5879, 0.0617, 0.0617, 4.0), FOLD + past)
    creeping = 0
    for periods in (300, 3_000, 30_000, 300_000, 1_000_000):
        x, v, repeat, _ = run(m, *AT_FOLD, periods)
        _, *plain, _ = whole_periods(m, *AT_FOLD, periods)
        assert abs(x - plain[0]) + abs(v - plain[1]) < 1e-12
        assert repeat == 0 or x > 0.28
        creeping += x < 0.0
    assert creeping > 1 and x > 0.28


def test_a_billion_settled_periods():
    m = mesh(ratios_of(1.569, 0.5879, 0.0617, 0.0617, 4.0), 0.9)
    assert run(m, 0.0, 0.0, 10**9)[2:] == (1, True)
    end, before = run(m, 0.0, 0.0, 10**9)[:2], whole_periods(m, 0.0, 0.0, 10**4)[1:3]
    np.testing.assert_allclose(end, before, rtol=0, atol=1e-14)


@pytest.mark.parametrize("damping", [0.0, 1e-7])
def test_without_damping_nothing_settles(damping):
    # Where the flanks rest on each other the state repeats to the last bit, or nearly so.
    for nu in (0.3, 0.7, 3.0):
        m = mesh(ratios_of(1.569, 0.999, damping, damping, 4.0), nu)
        *end, repeat, _ = run(m, 1.0, 0.0, 2000)
        assert repeat == 0 and tuple(end) == whole_periods(m, 1.0, 0.0, 2000)[1:3]


def test_sum_of_powers():
    rng = np.random.default_rng(2)
    m = mesh(ratios_of(1.569, 0.5879, 0.0617, 0.0617, 4.0), 0.7)
    weights = np.array([1.0, m.tuning])
    for _ in range(60):
        matrix = rng.normal(size=(2, 2))
        matrix *= rng.choice([0.3, 0.9, 0.99, 1.0, 1.01]) / abs(np.linalg.eigvals(matrix)).max()
        scaled = matrix * weights[:, None] / weights
        bound = sum_of_powers(m, tuple(map(float, matrix.ravel())))
        if abs(np.linalg.eigvals(matrix)).max() > 0.9999:
            assert bound == math.inf
            continue
        total, power = 0.0, np.eye(2)
        for _ in range(2000):
            total += np.linalg.norm(power, 2)
            power = scaled @ power
        assert total <= bound < math.inf


@pytest.mark.parametrize(
    ("miss", "gap", "clear"), [(1e-3, 4.0, True), (1e-6, 4.0, False), (1.0, 4.0, True)]
)
def test_closeness_to_grazing_is_seen(miss, gap, clear):
    # Backwards from a minimum `miss` above the normal flank, undamped, in the middle of C_max.
    m = mesh(ratios_of(1.9, 0.9, 0.0, 0.0, gap), 0.5)
    lev, t = m.high, 1.0
    u = (miss - lev.equilibrium) * math.cos(lev.w * t)
    v = (miss - lev.equilibrium) * lev.w * math.sin(lev.w * t)
    arcs = np.empty((50, ARC_COLUMNS))
    *_, count = march_period(m, 1, u + lev.equilibrium, v, arcs, LIMIT)
    first = arcs[:1]
    assert first[0, 1] > t and clear_of_grazing(m, first, 1, NEAR) is clear
    assert count > 0


def test_an_orbit_recorded_once_is_the_orbit_propagated_to_its_end():
    # Every period that a run records, event by event: summary, events and samples.
    repeats = set()
    cases = (0.0617, 0.5, 1.4), (0.02, 0.9, 2.2), (0.01, 0.508, 0.511), (0.005, 1.124, 1.126)
    for damping, first, last in cases:
        pair = GearPair.from_ratios(**PAIR, damping=damping, backlash_damping=damping)
        for nu in np.linspace(first, last, 16):
            one = simulate(pair, nu, periods=3000, record_periods=24, samples_per_period=8)
            m = mesh(ratios(pair), nu)
            contact, x, v, _ = whole_periods(m, 0.0, 0.0, 2976)
            summary, samples = np.empty(orbit.SUMMARY_COLUMNS), np.empty((8, orbit.SAMPLE_COLUMNS))
            orbit.clear_summary(summary)
            arcs, events = np.empty((50, ARC_COLUMNS)), np.empty((1, orbit.EVENT_COLUMNS))
            found, seen, previous = 0, [], contact
            strobes = [(x, v)]
            for n in range(2976, 3000):
                contact, x, v, count = march_period(m, contact, x, v, arcs, LIMIT)
                recorded_arcs.add_arcs(m, arcs, count, summary)
                orbit.equal_steps(samples, orbit.SAMPLE_AT, 2.0 * math.pi)
                recorded_arcs.sample_arcs(m, arcs, count, samples)
                seen.append(samples[:, 0].copy())
                strobes.append((x, v))
                events, found, previous = recorded_arcs.add_events(
                    arcs, count, previous, n, events, found
                )
            expected = summary[[orbit.X_MAX, orbit.X_MIN, orbit.FORCE_MAX]]
            got = one.displacement_max, one.displacement_min, one.dynamic_force_max
            np.testing.assert_allclose(got, expected, rtol=0, atol=1e-11)
            shares = one.fraction_normal, one.fraction_min_stiffness
            expected = summary[[orbit.TIME_NORMAL, orbit.TIME_LOW]] / (48.0 * math.pi)
            np.testing.assert_allclose(shares, expected, rtol=0, atol=1e-11)
            np.testing.assert_allclose(one.displacement, np.ravel(seen), rtol=0, atol=1e-11)
            np.testing.assert_allclose(one.final_state, (x, v), rtol=0, atol=1e-11)
            phases = 2.0 * math.pi * events[:found, 0] + events[:found, 1]
            np.testing.assert_allclose(one.event_phase, phases, rtol=0, atol=1e-10)
            assert one.period == orbit.orbit_period(np.array(strobes), nu, 1.0)
            # The states before the one recorded period lie where the run has not gone.
            assert simulate(pair, nu, periods=3000, record_periods=1).period == one.period
            repeats.add(int(one.period))
    assert {1, 2, 3, 5} <= repeats


def own_gears(damping):
    return GearPair.from_geometry(own(), torque=85.0, damping_ratio=damping)


def plain_period(pair, nu, state=(0.0, 0.0), periods=20_000):
    """Return the period of the motion after many periods, none of which is left out."""
    m = mesh(ratios(pair), nu)
    _, x, v, _ = whole_periods(m, *state, periods)
    strobes = [(x, v)]
    for _ in range(2 * orbit.MAX_PERIOD):
        _, x, v, _ = whole_periods(m, x, v, 1)
        strobes.append((x, v))
    return orbit.orbit_period(np.array(strobes), nu, 1.0)


@pytest.mark.parametrize("damping", [0.01, 0.02, 0.03])
def test_a_period_is_that_of_the_settled_motion(damping):
    # After five revolutions many motions still alternate by more than 1e-6, and less per two.
    pair, span = own_gears(damping), {"periods": 115, "record_periods": 23}
    tunings = [0.66, *np.linspace(0.5, 1.4, 31)]
    true = np.array([plain_period(pair, nu) for nu in tunings])
    runs = [simulate(pair, nu, samples_per_period=1, **span) for nu in tunings]
    told = np.array([int(run.period) for run in runs])
    cheap = sweep(pair, tunings, **span).period.values
    for found in (told, cheap):
        assert ((found == true) | (found == 0)).all()
    assert (told > 0).mean() > 0.95 and {int(run.followed) for run in runs} - {115}


def test_what_never_settles_is_said_so():
    # Without damping nothing draws a motion on; it is followed to the end.
    run = simulate(GearPair.from_ratios(**PAIR), 0.6, periods=115)
    assert int(run.period) == 0 and int(run.followed) == 20 * 115


LIGHT = PAPER.replace(material_damping=600.0, backlash_damping=600.0)


@pytest.mark.parametrize(
    "model",
    [
        OneDegreePair(pair=LIGHT, cubic_damping=0.01),
        gears(3e7, 600.0, 600.0),
        pairs_as_train(LIGHT),
    ],
)
def test_other_models_prove_their_period(model):
    nu, span = 0.6, {"record_periods": 6 * model.repeats, "samples_per_period": 1}
    short, long = (simulate(model, nu, periods=n * model.repeats, **span) for n in (60, 1500))
    assert int(short.period) == int(long.period) > 0
    assert 60 * model.repeats < int(short.followed) <= 20 * 60 * model.repeats
    span.pop("samples_per_period")
    assert int(sweep(model, [nu], periods=60 * model.repeats, **span).period[0]) == 0
    assert int(sweep(model, [nu], periods=3000 * model.repeats, **span).period[0]) == short.period


def test_an_orbit_that_draws_nothing_on_is_not_settled_on():
    # From its own state the motion repeats, and goes away with the first disturbance.
    for tuning, pair in ((0.7, PAPER), (1.95, PAPER.replace(material_damping=600.0))):
        pair = OneDegreePair(pair=pair)
        found = periodic_orbit(pair, tuning, guess=(1.0, 0.0))
        assert np.abs(found.multipliers[0]) > 1.0 - 1e-6
        run = simulate(pair, tuning, periods=8, initial_state=tuple(found.state))
        assert int(run.period) == 0
