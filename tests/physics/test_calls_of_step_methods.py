"""The methods for comparison behind their calls: what they count, record, report and refuse."""

import math

import numpy as np
import pytest

from gearlib import GearPair, OneDegreePair, simulate
from gearlib.engines.pair.stiffness import levels
from tests.physics.test_step_methods import FULL, OIL_FREE, PAIR, SPLIT, VARIANTS


@pytest.mark.parametrize(
    ("method", "options", "count"),
    [
        ("rk4", {}, 4 * 200 * 7),
        ("rk4", {"steps_per_period": 48}, 4 * 48 * 7),
        # One per step, one at the start, and one after each of two switches on step ends.
        ("newmark", {"contact": "frozen"}, 200 * 7 + 1 + 2 * 7),
        ("generalised_alpha", {"contact": "frozen"}, 200 * 7 + 1 + 2 * 7),
        # Without loss of contact one iteration finds the solution, a second one confirms it.
        ("newmark", {}, 2 * 200 * 7 + 1 + 2 * 7),
        ("generalised_alpha", {}, 2 * 200 * 7 + 1 + 2 * 7),
    ],
)
@pytest.mark.parametrize("record_periods", [1, 7])
def test_evaluations_are_counted(method, options, count, record_periods):
    state = tuple(simulate(PAIR, 0.7, periods=100).final_state.values)
    run = simulate(
        PAIR,
        0.7,
        periods=7,
        record_periods=record_periods,
        initial_state=state,
        method=method,
        options=options,
    )
    assert int(run.evaluations) == count


def test_scipy_counts_every_call():
    from scipy.integrate import solve_ivp

    high, low = levels(PAIR.contact_ratio, PAIR.stiffness_ratio)
    calls = 0

    def rate(t, z):
        nonlocal calls
        calls += 1
        c = high if math.cos(t) > 0.0 else low
        x, v = z
        g = x if x >= 0 else min(x + PAIR.backlash_ratio, 0.0)
        return [v, (1 - c * g) / 0.81 - 2 * PAIR.damping_ratio / 0.9 * v]

    theirs = solve_ivp(rate, (0.0, 20 * math.pi), [0.0, 0.0])
    run = simulate(PAIR, 0.9, periods=10, method="scipy")
    # cos(t) > 0 and the switch of the library differ by rounding, which no stage meets.
    np.testing.assert_allclose(run.final_state, theirs.y[:, -1], rtol=0, atol=1e-9)
    assert int(run.evaluations) == calls


@pytest.mark.parametrize("rho", [0.7, 0.8, 0.9, 1.0])
def test_spectral_radius_is_what_is_left_per_step(rho):
    # Constant stiffness, steps of 50 natural periods: as fast an oscillation as there is.
    pair, nu = GearPair.from_ratios(contact_ratio=1.4, stiffness_ratio=1.0), 0.02
    options = {"steps_per_period": 1, "spectral_radius": rho}
    off = []
    for n in (30, 60):
        run = simulate(
            pair,
            nu,
            periods=n,
            initial_state=(1.0001, 0.0),
            method="generalised_alpha",
            options=options,
        )
        x, v = run.final_state.values
        off.append(math.hypot(x - 1.0, nu * v))
    # The root is all but double, which adds a factor of up to 2^(1 / 30) = 1.02.
    assert (off[1] / off[0]) ** (1 / 30) == pytest.approx(rho, rel=0.05)


@pytest.mark.parametrize(("method", "options"), VARIANTS)
@pytest.mark.parametrize("model", [OIL_FREE, FULL], ids=["oil_free", "full"])
def test_parts_of_the_dataset_agree(model, method, options):
    d = simulate(
        model, 0.9, periods=12, record_periods=3, method=method, options=options,
        samples_per_period=400,
    )  # fmt: skip
    assert int(d.status) == 0 and int(d.evaluations) > 0
    assert float(d.displacement_max) >= float(d.displacement.max())
    assert float(d.displacement_min) <= float(d.displacement.min())
    assert float(d.dynamic_force_max) >= float(d.dynamic_force.max())
    total = d.fraction_normal + d.fraction_backlash + d.fraction_inverse
    assert float(total) == pytest.approx(1.0, abs=1e-12)
    # A fraction counted on samples misses at most a sample per event; the dense output of a long
    # step bends where the straight line of the events does not.
    for name, code in (("normal", 1), ("backlash", 0), ("inverse", -1)):
        share = float((d.contact == code).mean())
        assert float(d[f"fraction_{name}"]) == pytest.approx(
            share, abs=0.01 + d.sizes["event"] / 1200
        )
    assert float(d.bounces) * 3 == int((d.event_from == 1).sum())
    assert np.array_equal(d.event_to[:-1], d.event_from[1:])
    assert np.all(np.diff(d.event_phase) > 0)
    first = 2 * math.pi * 9
    assert float(d.event_phase.min()) >= first
    # The state at the end of the run is where the samples lead.
    last = d.isel(phase=-1)
    step = 2 * math.pi / 400
    assert float(d.final_state[0]) == pytest.approx(
        float(last.displacement + step * last.velocity), abs=2 * step**2
    )
    if method != "smoothed":
        touching = d.contact != 0
        assert np.array_equal(
            touching, (d.displacement >= 0) | (d.displacement <= -model.backlash_ratio)
        )
        assert not d.dynamic_force.values[~touching.values].any()


# The smoothed law has another damping.
@pytest.mark.parametrize(("method", "options"), [v for v in VARIANTS if v[0] != "smoothed"])
def test_equation_of_motion_holds_at_every_sample(method, options):
    d = simulate(OIL_FREE, 0.9, periods=12, record_periods=3, method=method, options=options)
    damping = np.where(d.contact == 0, 0.0, OIL_FREE.damping_ratio)
    residual = d.acceleration + 2 * damping / 0.9 * d.velocity + (d.dynamic_force - 1) / 0.81
    assert float(abs(residual).max()) < 1e-12


# scipy would take minutes over these periods.
@pytest.mark.parametrize(("method", "options"), [v for v in VARIANTS if v[0] != "scipy"])
def test_a_motion_that_grows_for_ever_is_an_overflow(method, options):
    pair = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.3, backlash=0.0)
    blown = simulate(pair, 2.0, periods=5000, method=method, options=options)
    assert int(blown.status) == 2 and blown.displacement.isnull().all()


def test_scipy_tells_an_overflow():
    pair = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.3, backlash=0.0)
    for events in (False, True):
        blown = simulate(
            pair, 2.0, periods=50, initial_state=(9e149, 0.0), method="scipy",
            options={"events": events},
        )  # fmt: skip
        assert int(blown.status) == 2


@pytest.mark.parametrize("method", ["newmark", "generalised_alpha"])
def test_iterations_that_do_not_converge_are_a_status(method):
    # A hardening contact and steps of 20 natural periods: Newton's iteration goes to and fro.
    model = OneDegreePair(pair=PAIR, cubic_stiffness=2e9)
    run = simulate(model, 0.05, periods=200, method=method, options={"steps_per_period": 1})
    assert int(run.status) == 3 and "steps_per_period" in run.status.attrs["message"]
    assert run.displacement.isnull().all()


def test_iterations_converge_where_the_damping_jumps():
    # Long runs with damping in contact only meet steps whose end lies in the jump.
    run = simulate(OIL_FREE.replace(material_damping=20e3), 0.8, periods=5000, method="newmark")
    assert int(run.status) == 0


@pytest.mark.parametrize(
    ("method", "options"),
    [("rk45", {"rtol": 1e-17, "atol": 1e-17}), ("smoothed", {"rtol": 1e-17})],
)
def test_step_underflow_is_a_status(method, options):
    run = simulate(PAIR, 0.9, periods=50, method=method, options=options)
    assert int(run.status) == 4 and "tolerances" in run.status.attrs["message"]


@pytest.mark.parametrize(("method", "options"), [("rk45", {}), ("scipy", {}), ("scipy", SPLIT)])
def test_step_limit_is_a_status(method, options):
    run = simulate(PAIR, 0.9, periods=5, method=method, options=options, max_events=3)
    assert int(run.status) == 1


@pytest.mark.parametrize(("method", "options"), [("rk45", {}), ("scipy", {}), ("scipy", SPLIT)])
def test_the_step_limit_is_that_of_a_period(method, options):
    run = simulate(PAIR, 0.9, periods=40, method=method, options=options, max_events=100)
    # Six or seven evaluations a step: in all there are more steps than that.
    assert int(run.status) == 0 and int(run.evaluations) > 7 * 100
