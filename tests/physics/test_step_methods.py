"""The methods for comparison: their order, their limit, what they count, refuse and report."""

import math

import numpy as np
import pytest

import gearlib
from gearlib import (
    Fourier,
    Harmonics,
    OneDegreePair,
    SixDegreePair,
    simulate,
)
from tests.paper import PAPER
from tests.properties.known_models import TABLE

PAIR = PAPER.replace(contact_ratio=1.5, material_damping=3953.7, backlash_damping=3953.7)
OIL_FREE = PAIR.replace(contact_ratio=1.569, backlash_damping=0.0)
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
PEERS = ("heyoka",)
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


def test_the_smoothed_far_flank_pushes_back():
    pair = PAIR.replace(backlash=12e-6)
    start = {"periods": 1, "record_periods": 1, "initial_state": (-pair.backlash_ratio - 3.0, 0.0)}
    exact = simulate(pair, 0.9, **start)
    smoothed = simulate(pair, 0.9, method="smoothed", options={"sharpness": 1000.0}, **start)
    assert exact.fraction_inverse > 0.05
    for name in ("displacement_max", "fraction_inverse", "dynamic_force_min"):
        np.testing.assert_allclose(smoothed[name], exact[name], rtol=5e-3, err_msg=name)


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
