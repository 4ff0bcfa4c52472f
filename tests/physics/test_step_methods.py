"""The methods for comparison: order, limit, counts of evaluations, statuses, packages of others."""

import importlib.util
import math

import numpy as np
import pytest
from scipy.integrate import RK45

import gearlib
from gearlib import GearPair, OneDegreePair, integrators, simulate
from gearlib.data.status import NOT_CONVERGED, OVERFLOW
from tests.paper import PAPER
from tests.properties.known_models import CUBIC, KNOWN

PAIR = PAPER.replace(contact_ratio=1.5, material_damping=3953.7, backlash_damping=3953.7)
OIL_FREE = PAIR.replace(contact_ratio=1.569, backlash_damping=0.0)
FULL = KNOWN["everything"].model.replace(cubic_stiffness=2e9, **CUBIC)
#: In the middle of its tongue, without backlash: every motion grows.
GROWING = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.3, backlash_ratio=0.0)
SPLIT = {"solver": "DOP853", "rtol": 1e-12, "atol": 1e-12, "events": True}
NAMES = ("exact", "taylor", "rk4", "rk45", "newmark", "generalised_alpha", "scipy", "smoothed")
#: Every method but the exact ones, with each of its options that changes what it does.
VARIANTS = [
    *((method, {}) for method in ("rk4", "rk45", "smoothed", "scipy")),
    *(("newmark", {"contact": contact}) for contact in ("frozen", "iterated")),
    *(("generalised_alpha", {"contact": contact}) for contact in ("frozen", "iterated")),
    *(("scipy", options) for options in ({"solver": "Radau"}, SPLIT)),
]


def test_every_method_is_listed_with_the_meanings_of_its_options():
    methods = gearlib.methods()
    assert tuple(method.name for method in methods) == (*NAMES, "heyoka")
    for method in methods:
        assert method.events and method.models
        assert all(meaning for _, meaning in method.options.values())


@pytest.mark.parametrize(
    ("method", "options", "order", "steps"),
    [
        ("rk4", {}, 4, 80),
        ("newmark", {"contact": "frozen"}, 2, 160),
        ("newmark", {"contact": "iterated"}, 2, 160),
        ("generalised_alpha", {"contact": "iterated", "spectral_radius": 0.0}, 2, 320),
        ("generalised_alpha", {"contact": "frozen", "spectral_radius": 1.0}, 2, 160),
    ],
)
def test_errors_decrease_with_the_order_of_the_method_in_permanent_contact(
    method, options, order, steps
):
    # Contact ratio 1.5: switches at pi / 2 and 3 pi / 2, step ends of 4 n steps.
    reference = simulate(PAIR, 0.7, periods=10)
    assert float(reference.displacement_min) > 0.0
    # At the step ends, so that the cubic of the dense output plays no part.
    ends = [
        simulate(PAIR, 0.7, periods=10, method=method, options={**options, "steps_per_period": n})
        for n in (steps, 2 * steps)
    ]
    errors = [float(np.linalg.norm(run.final_state - reference.final_state)) for run in ends]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1), errors


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
        ("scipy", {"solver": "Radau", "rtol": 1e-5, "atol": 1e-7}, 1e-3),
    ],
)
def test_small_steps_come_close_to_the_exact_motion(method, options, tolerance):
    # From the coast side, and then a bounce in every period: this covers the contact law.
    span = {"periods": 4, "record_periods": 4, "samples_per_period": 64}
    span["initial_state"] = -2.0, 0.0
    reference = simulate(FULL, 0.9, **span)
    assert float(reference.bounces) >= 1.0 and float(reference.fraction_coast) > 0.02
    run = simulate(FULL, 0.9, method=method, options=options, **span)
    for name in ("displacement", "fraction_coast", "contact_loss_fraction"):
        np.testing.assert_allclose(run[name], reference[name], rtol=0, atol=tolerance)
    # Those of step ends and samples.
    for name in ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min"):
        np.testing.assert_allclose(run[name], reference[name], rtol=5e-3, err_msg=name)


def ode45(rate, end, y, rtol, atol):
    """MATLAB's ode45 from its documented algorithm; return (y, steps, steps tried again)."""
    t, longest, slope, steps, rejected = 0.0, 0.1 * end, rate(y), 0, 0
    weights = np.maximum(abs(y), atol / rtol)
    h = min(longest, 0.8 * rtol**0.2 / max(abs(slope) / weights))
    while t < end:
        shortest, first_try = 16 * np.spacing(t), True
        h = min(longest, max(shortest, h))
        if 1.1 * h >= end - t:
            h = end - t
        while True:
            stages = [slope]
            for row, count in zip(RK45.A[1:], range(1, 6), strict=True):
                stages.append(rate(y + h * row[:count] @ stages))
            new = y + h * RK45.B @ stages
            stages.append(rate(new))
            weights = np.maximum(np.maximum(abs(y), abs(new)), atol / rtol)
            error = h * max(abs(RK45.E @ stages) / weights)
            if error <= rtol:
                break
            rejected += 1
            h = max(shortest, h * max(0.1, 0.8 * (rtol / error) ** 0.2) if first_try else h / 2)
            first_try = False
        t, y, slope, steps = t + h, new, stages[-1], steps + 1
        if first_try:
            h *= min(5.0, 0.8 * (rtol / error) ** 0.2)
    return y, steps, rejected


@pytest.mark.parametrize(("nu", "rtol"), [(0.5, 1e-3), (0.9, 1e-6)])
def test_rk45_takes_the_steps_of_ode45(nu, rtol):
    def rate(state):
        x, v = state
        damping = 0.1 if x >= 0.0 else 0.02
        return np.array([v, (1.0 - max(x, 0.0)) / nu**2 - damping / nu * v])

    # Constant stiffness, no coast-side flank; contact is lost.
    pair = GearPair.from_ratios(
        contact_ratio=1.5, stiffness_ratio=1.0, damping=0.05, backlash_damping=0.01
    )
    start, options = (3.0, 0.0), {"rtol": rtol, "atol": 1e-3 * rtol}
    state, steps, rejected = ode45(rate, 4.0 * math.pi, np.array(start), **options)
    run = simulate(pair, nu, periods=2, method="rk45", options=options, initial_state=start)
    assert int(run.evaluations) == 1 + 6 * (steps + rejected) and rejected > 2
    np.testing.assert_allclose(run.final_state, state, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("method", "options", "count"),
    [
        ("rk4", {"steps_per_period": 48}, 4 * 48 * 7),
        # One per step, one at the start, and one after each of two switches on step ends.
        ("newmark", {"contact": "frozen"}, 200 * 7 + 1 + 2 * 7),
        # Without loss of contact one iteration finds the solution, a second one confirms it.
        ("generalised_alpha", {}, 2 * 200 * 7 + 1 + 2 * 7),
    ],
)
@pytest.mark.parametrize("record_periods", [1, 7])
def test_evaluations_are_counted(method, options, count, record_periods):
    state = tuple(simulate(PAIR, 0.7, periods=100).final_state.values)
    settings = {"periods": 7, "record_periods": record_periods, "initial_state": state}
    run = simulate(PAIR, 0.7, method=method, options=options, **settings)
    assert int(run.evaluations) == count


@pytest.mark.parametrize(
    ("method", "options"),
    [("exact", {}), ("taylor", {}), *(row for row in VARIANTS if row[0] != "smoothed")],
)
def test_samples_satisfy_the_equation_of_motion(method, options):
    run = simulate(OIL_FREE, 0.9, periods=12, record_periods=3, method=method, options=options)
    x, touches = run.displacement, run.contact != 0
    assert np.array_equal(touches, (x >= 0) | (x <= -OIL_FREE.backlash_ratio))
    assert not run.dynamic_force.values[~touches.values].any() and not touches.all()
    assert np.array_equal(run.modified_stiffness, run.stiffness * touches)
    damping = np.where(touches, OIL_FREE.damping_ratio, 0.0)
    force = 2 * damping / 0.9 * run.velocity + (run.dynamic_force - 1) / 0.81
    assert float(abs(run.acceleration + force).max()) < 1e-12


@pytest.mark.parametrize(("method", "options"), VARIANTS)
def test_an_unbounded_motion_ends_with_the_status_overflow(method, options):
    # From rest the steps of scipy would take minutes.
    late = {"periods": 50, "initial_state": (9e149, 0.0)}
    span = late if method == "scipy" else {"periods": 5000}
    run = simulate(GROWING, 2.0, method=method, options=options, **span)
    assert int(run.status) == OVERFLOW and run.displacement.isnull().all()


def test_iterations_that_do_not_converge_end_the_run_with_a_status():
    # With a hardening contact and steps of 20 natural periods Newton's iteration oscillates.
    model = OneDegreePair(pair=PAIR, cubic_stiffness=2e9)
    run = simulate(model, 0.05, periods=200, method="newmark", options={"steps_per_period": 1})
    assert int(run.status) == NOT_CONVERGED and "steps_per_period" in run.status.attrs["message"]
    assert run.displacement.isnull().all()


def test_a_missing_package_is_named_in_the_refusal(monkeypatch):
    package, find = integrators.METHODS["heyoka"].PACKAGE, importlib.util.find_spec
    monkeypatch.setattr(
        "gearlib.integrators.method.find_spec",
        lambda module: None if module == package.module else find(module),
    )
    (method,) = [method for method in gearlib.methods() if method.name == "heyoka"]
    assert not method.available and package.distribution in method.note
    for kind in (ValueError, ImportError):
        with pytest.raises(kind, match=f"heyoka.*{package.distribution}") as refusal:
            simulate(PAIR, 0.9, periods=1, method="heyoka")
        assert "\n" not in str(refusal.value)
