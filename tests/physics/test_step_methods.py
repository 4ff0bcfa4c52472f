"""The methods for comparison: their order, their limit, what they count, refuse and report."""

import inspect
import math

import numpy as np
import pytest

import gearlib
from gearlib import (
    Fourier,
    GearPair,
    Harmonics,
    OneDegreePair,
    SixDegreePair,
    Tabulated,
    integrators,
    simulate,
    sweep,
)
from gearlib.kernels.steps.equation_of_motion import Contact
from gearlib.kernels.steps.fixed import Scheme, alpha_step
from gearlib.models.stiffness import levels
from tests.paper import PAPER

PAIR = PAPER.replace(contact_ratio=1.5, material_damping=3953.7, backlash_damping=3953.7)
OIL_FREE = PAIR.replace(contact_ratio=1.569, backlash_damping=0.0)
TABLE = Tabulated((0.1, 1.0, 2.5, 4.0, 5.5), (4e8, 3.1e8, 2.4e8, 2.6e8, 3.7e8))
FULL = OneDegreePair(
    pair=PAIR.replace(backlash=12e-6, material_damping=1000.0, backlash_damping=300.0),
    profile=TABLE,
    quadratic_damping=3e4,
    cubic_damping=4e5,
    backlash_quadratic_damping=2e4,
    cubic_stiffness=2e9,
    excitation=Harmonics((0.0, 4000.0)),
    deviation=Harmonics((2e-6,)),
)
SIX = SixDegreePair(
    pair=PAIR.replace(contact_ratio=1.569),
    base_radii=(0.1, 0.1),
    inertias=(0.097852, 0.097852),
    masses=(17.27, 17.27),
    bearing_stiffness=(3e7,) * 4,
    bearing_damping=(910.5,) * 4,
    eccentricities=(2e-6, 1e-6),
    friction=(0.05, 0.05),
    pitch_phase=0.3,
    deviation=Harmonics((1e-6,)),
    inverse_deviation=Harmonics((0.0, 1e-6)),
)
SPLIT = {"solver": "DOP853", "rtol": 1e-12, "atol": 1e-12, "events": True}
NAMES = ("exact", "taylor", "rk4", "rk45", "newmark", "generalised_alpha", "scipy", "smoothed")
PEERS = ("heyoka", "cvode", "diffrax", "cyrk", "numbalsoda")
#: Every method but the exact ones, with each of its options that changes what it does.
VARIANTS = [
    ("rk4", {}),
    ("rk45", {}),
    ("newmark", {"contact": "frozen"}),
    ("newmark", {"contact": "iterated"}),
    ("generalised_alpha", {"contact": "frozen"}),
    ("generalised_alpha", {"contact": "iterated"}),
    ("smoothed", {}),
    ("scipy", {}),
    ("scipy", {"solver": "Radau"}),
    ("scipy", SPLIT),
]


def error(model, method, options, reference, periods=20, **arguments):
    """Return the largest difference in displacement over the last period."""
    run = simulate(model, 0.9, periods=periods, method=method, options=options, **arguments)
    assert int(run.status) == 0
    return float(abs(run.displacement - reference.displacement).max())


def test_methods_lists_all():
    listed = gearlib.methods()
    assert tuple(method.name for method in listed) == NAMES + PEERS
    for method in listed:
        assert method.events and method.models
        assert all(meaning for _, meaning in method.options.values())
        assert set(method.options) <= set(
            inspect.signature(integrators.METHODS[method.name].run).parameters
        )


@pytest.mark.parametrize(
    ("model", "name"), [(PAIR, "exact"), (FULL, "taylor"), (SIX, "exact")], ids=["1", "full", "6"]
)
def test_methods_for_comparison_are_never_chosen_unnamed(model, name):
    assert integrators.choose(model, None, None)[0] == name


# Without loss of contact: tuning 0.7 never leaves the normal flank.
@pytest.mark.parametrize(
    ("method", "options", "order", "steps"),
    [
        ("rk4", {}, 4, 40),
        ("newmark", {"contact": "frozen"}, 2, 80),
        ("newmark", {"contact": "iterated"}, 2, 80),
        ("generalised_alpha", {"contact": "frozen"}, 2, 80),
        ("generalised_alpha", {"contact": "iterated", "spectral_radius": 0.0}, 2, 160),
        ("generalised_alpha", {"contact": "iterated", "spectral_radius": 1.0}, 2, 80),
    ],
)
@pytest.mark.parametrize(
    "model",
    # Contact ratio 1.5: switches at pi / 2 and 3 pi / 2, step ends of 4 n steps.
    [PAIR, OneDegreePair(pair=PAIR, profile=Fourier(2), excitation=Harmonics((300.0,)))],
    ids=["rectangle", "smooth"],
)
def test_order_of_convergence(model, method, options, order, steps):
    reference = simulate(model, 0.7, periods=10)
    assert float(reference.displacement_min) > 0.0
    # At the step ends, so that the cubic of the dense output plays no part.
    errors = [
        simulate(model, 0.7, periods=10, method=method, options={**options, "steps_per_period": n})
        for n in (steps, 2 * steps, 4 * steps)
    ]
    errors = [float(np.linalg.norm(run.final_state - reference.final_state)) for run in errors]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] == pytest.approx(order, abs=0.1), errors
    assert orders[0] == pytest.approx(order, abs=0.4), errors


@pytest.mark.parametrize(
    ("method", "options", "tolerance"),
    [
        # A switch or a contact inside a step costs an error of the order of h^2 of the step in
        # displacement where a method of order 4 takes it with some of its stages, h = 2e-3 here.
        ("rk4", {"steps_per_period": 3200}, 1e-3),
        # The step control finds switches by rejecting steps; what is left follows the tolerance.
        ("rk45", {"rtol": 1e-9, "atol": 1e-9}, 1e-5),
        # The damping jumps by 2 beta v / nu = 0.1 at contact, taken late by up to a step.
        ("newmark", {"steps_per_period": 3200, "contact": "frozen"}, 5e-3),
        ("newmark", {"steps_per_period": 3200, "contact": "iterated"}, 5e-3),
        ("generalised_alpha", {"steps_per_period": 3200, "contact": "frozen"}, 5e-3),
        ("generalised_alpha", {"steps_per_period": 3200, "contact": "iterated"}, 5e-3),
        # The smoothed law differs by 1 / sharpness^2 in the impulse of a crossing.
        ("smoothed", {"sharpness": 1000.0}, 1e-5),
        ("scipy", {"solver": "RK45", "rtol": 1e-9, "atol": 1e-9}, 1e-5),
        ("scipy", {"solver": "LSODA", "rtol": 1e-9, "atol": 1e-9}, 1e-5),
        ("scipy", {"solver": "Radau", "rtol": 1e-5, "atol": 1e-7}, 1e-3),
    ],
)
@pytest.mark.parametrize("model", [OIL_FREE, FULL], ids=["oil_free", "full"])
def test_small_steps_come_close_to_the_exact_orbit(model, method, options, tolerance):
    reference = simulate(model, 0.9, periods=20)
    # A bounce in every period: the comparison covers the contact law.
    assert float(reference.bounces) >= 1.0
    assert error(model, method, options, reference) < tolerance


@pytest.mark.parametrize("state", [(0.0, 0.0), (1.0, -3.0)])
@pytest.mark.parametrize(
    "model",
    [
        OIL_FREE,
        FULL,
        SIX,
        PAIR.replace(backlash=0.0),
        PAIR.replace(backlash=math.inf),
        OneDegreePair(pair=PAIR, profile=Fourier(3)),
    ],
    ids=["oil_free", "full", "six", "no_gap", "no_far_flank", "fourier"],
)
def test_scipy_split_at_events_equals_the_exact_methods(model, state):
    options = {"periods": 5, "record_periods": 5, "initial_state": state, "samples_per_period": 32}
    exact = simulate(model, 0.8, **options)
    run = simulate(model, 0.8, method="scipy", options=SPLIT, **options)
    assert run.event_to.values.tolist() == exact.event_to.values.tolist()
    # scipy's own error at rtol 1e-12 is about 1e-9 here.
    np.testing.assert_allclose(run.final_state, exact.final_state, rtol=0, atol=1e-8)
    columns = ["displacement", "velocity", "acceleration", "dynamic_force", "event_phase"]
    columns += model.extra_samples
    for name in (*columns, "fraction_backlash", "fraction_min_stiffness", "bounces"):
        np.testing.assert_allclose(run[name], exact[name], rtol=0, atol=1e-7, err_msg=name)


def test_scipy_takes_six_degrees_as_they_come():
    exact = simulate(SIX, 0.8, periods=5)
    options = {"solver": "DOP853", "rtol": 1e-10, "atol": 1e-10}
    run = simulate(SIX, 0.8, periods=5, method="scipy", options=options)
    for name in ("displacement", "velocity", "dynamic_force", "backlash", "friction_force"):
        # Events are found by rejecting steps: a hundred times what the split runs reach.
        np.testing.assert_allclose(run[name], exact[name], rtol=0, atol=1e-5, err_msg=name)


def test_smoothed_contact_converges_with_its_sharpness():
    reference = simulate(PAIR, 0.9, periods=40)
    errors = [
        error(PAIR, "smoothed", {"sharpness": s}, reference, periods=40)
        for s in (25.0, 50.0, 100.0, 200.0)
    ]
    ratios = np.array(errors[:-1]) / errors[1:]
    # At least like 1 / sharpness; flanks that are crossed at a speed give the square of it.
    assert np.all(ratios > 2.0)
    np.testing.assert_allclose(ratios, 4.0, rtol=0.2)


def test_smoothed_force_is_as_far_off_as_documented():
    run = simulate(PAIR, 0.9, periods=40, method="smoothed", samples_per_period=4096)
    stiffness, x, gap = run.stiffness, run.displacement, PAIR.backlash_ratio
    sharp = stiffness * np.where(x >= 0, x, np.where(x <= -gap, x + gap, 0.0))
    off = abs(run.dynamic_force - sharp) / stiffness
    assert 0.13 < 100 * float(off.max()) < 0.14


def ode45(rate, periods, y, rtol=1e-3, atol=1e-6):
    """MATLAB's ode45 written down from its documented algorithm; return (y, steps, rejected)."""
    a = [
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
    e = [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40]
    nodes = [1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1]
    t, end, threshold, power = 0.0, 2 * math.pi * periods, atol / rtol, 1 / 5
    longest = 0.1 * end
    f = [rate(t, y)]
    rh = max(abs(f[0]) / np.maximum(abs(y), threshold)) / (0.8 * rtol**power)
    h = min(longest, end) if longest * rh <= 1 else 1 / rh
    steps = rejected = 0
    done = False
    while not done:
        shortest = 16 * np.spacing(t)
        h = min(longest, max(shortest, h))
        if 1.1 * h >= end - t:
            h, done = end - t, True
        clean = True
        while True:
            f = f[:1]
            for row, node in zip(a, nodes, strict=True):
                new = y + h * sum(w * k for w, k in zip(row, f, strict=True))
                f.append(rate(t + node * h, new))
            worst = np.maximum(np.maximum(abs(y), abs(new)), threshold)
            err = h * max(abs(sum(w * k for w, k in zip(e, f, strict=True))) / worst)
            if err <= rtol:
                break
            rejected += 1
            h = max(shortest, h * max(0.1, 0.8 * (rtol / err) ** power) if clean else h / 2)
            clean = done = False
        t, y, f, steps = end if done else t + h, new, f[-1:], steps + 1
        if clean:
            growth = 1.25 * (err / rtol) ** power
            h = h / growth if growth > 0.2 else 5 * h
    return y, steps, rejected


@pytest.mark.parametrize("nu", [0.5, 0.7, 0.9, 1.3])
@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
def test_rk45_takes_the_steps_of_ode45(nu, rtol):
    pair, half = OIL_FREE, math.pi * (OIL_FREE.contact_ratio - 1.0)
    high = pair.max_stiffness / pair.mean_stiffness

    def rate(t, y):
        phase = t % (2 * math.pi)
        c = high if phase < half or phase >= 2 * math.pi - half else 0.5879 * high
        x, v = y
        g = x if x >= 0 else (x + pair.backlash_ratio if x <= -pair.backlash_ratio else 0.0)
        beta = 0.0 if -pair.backlash_ratio < x < 0 else pair.damping_ratio
        return np.array([v, (1 - c * g) / nu**2 - 2 * beta / nu * v])

    # Few periods: a step that just touches a switch is taken or rejected by its rounding.
    state, steps, rejected = ode45(rate, 2, np.array([0.0, 0.0]), rtol, 1e-3 * rtol)
    options = {"rtol": rtol, "atol": 1e-3 * rtol}
    run = simulate(pair, nu, periods=2, method="rk45", options=options)
    assert int(run.evaluations) == 1 + 6 * (steps + rejected)
    np.testing.assert_allclose(run.final_state, state, rtol=0, atol=1e-8)


def test_rk45_reads_periods_off_its_dense_output():
    # The steps do not know where the record starts: a shorter record is the end of a longer one.
    runs = [
        simulate(OIL_FREE, 0.9, periods=12, record_periods=n, method="rk45", samples_per_period=64)
        for n in (12, 3)
    ]
    long, short = (run.displacement.values for run in runs)
    np.testing.assert_array_equal(long[-short.size :], short)
    assert int(runs[0].evaluations) == int(runs[1].evaluations)
    # A step is longer than a tenth of a period here, and the run is its own interpolant: smooth.
    assert float(abs(np.diff(long)).max()) < 0.5


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


def test_a_step_end_in_the_jump_of_the_damping_lies_on_the_flank():
    # Damping in contact only: with it the step would end below the flank, without it above.
    contact = Contact(20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, True)
    newmark = Scheme(False, True, 0.0, 0.0, 0.25, 0.5)
    x, v, a, _, converged = alpha_step(contact, newmark, 0.1, 1.0, 0.0, -0.01, 0.1005, 0.0)
    assert converged and abs(x) < 1e-15
    # The damping force that holds it there is between none and that of the contact.
    assert -20.0 * v < a < 0.0


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


@pytest.mark.parametrize(("method", "options"), [v for v in VARIANTS if v[0] != "scipy"])
def test_sweep_equals_single_runs(method, options):
    table = sweep(
        OIL_FREE, [0.9, 0.7], periods=40, record_periods=4, method=method, options=options
    )
    for nu in (0.7, 0.9):
        one = simulate(OIL_FREE, nu, periods=40, record_periods=4, method=method, options=options)
        many = table.sel(tuning=nu)
        for name in ("final_state", "bounces", "fraction_backlash", "fraction_min_stiffness"):
            np.testing.assert_array_equal(many[name], one[name])
        # A single run shows samples besides the step ends.
        assert float(many.displacement_max) <= float(one.displacement_max)


def test_scipy_sweeps():
    table = sweep(PAIR, [0.9, 0.7], periods=3, record_periods=1, method="scipy")
    one = simulate(PAIR, 0.7, periods=3, method="scipy")
    np.testing.assert_array_equal(table.final_state.sel(tuning=0.7), one.final_state)


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


@pytest.mark.parametrize(
    ("method", "options", "part"),
    [
        ("rk4", {"steps_per_period": 0}, "options['steps_per_period'] = 0"),
        ("rk4", {"steps_per_period": 12.5}, "options['steps_per_period'] = 12.5"),
        ("rk4", {"rtol": 1e-3}, "method 'rk4' knows 'steps_per_period'"),
        ("rk45", {"rtol": 0.0}, "options['rtol'] = 0.0"),
        ("rk45", {"atol": -1.0}, "options['atol'] = -1.0"),
        ("rk45", {"max_step": 0.0}, "options['max_step'] = 0.0"),
        ("newmark", {"contact": "melted"}, "options['contact'] = 'melted'"),
        ("generalised_alpha", {"spectral_radius": 1.5}, "options['spectral_radius'] = 1.5"),
        ("scipy", {"solver": "ode45"}, "options['solver'] = 'ode45'"),
        ("scipy", {"events": "yes"}, "options['events'] = 'yes'"),
        ("smoothed", {"sharpness": 0.0}, "options['sharpness'] = 0.0"),
    ],
)
def test_wrong_options_are_refused(method, options, part):
    with pytest.raises(ValueError) as refusal:
        simulate(PAIR, 0.9, periods=1, method=method, options=options)
    assert part in str(refusal.value) and "\n" not in str(refusal.value)


@pytest.mark.parametrize("method", ["rk4", "rk45", "newmark", "generalised_alpha", "smoothed"])
def test_six_degrees_are_refused_by_methods_of_one(method):
    with pytest.raises(ValueError, match="one degree of freedom"):
        simulate(SIX, 0.9, periods=1, method=method)
