"""Step methods for comparison: order, limit, evaluations, statuses and other packages."""

import importlib.util
import math

import numpy as np
import pytest
from scipy.integrate import RK45

import gearlib
from gearlib import GearPair, OneDegreePair, integrators, simulate
from gearlib.data.status import NOT_CONVERGED, OVERFLOW
from tests.paper import PAPER_PAIR
from tests.properties.known_models import CUBIC, KNOWN

PAIR = PAPER_PAIR.replace(contact_ratio=1.5, material_damping=3953.7, backlash_damping=3953.7)
OIL_FREE = PAIR.replace(contact_ratio=1.569, backlash_damping=0.0)
FULL = KNOWN["everything"].model.replace(cubic_stiffness=2e9, **CUBIC)
#: Without backlash, at a tuning in the middle of its tongue, every motion of this pair grows.
GROWING = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.3, backlash_ratio=0.0)
SPLIT = {"solver": "DOP853", "rtol": 1e-12, "atol": 1e-12, "events": True}
NAMES = ("exact", "taylor", "rk4", "rk45", "newmark", "generalised_alpha", "scipy", "smoothed")
#: Every method but the exact ones, with each option that changes its algorithm.
VARIANTS = [
    *((method, {}) for method in ("rk4", "rk45", "smoothed", "scipy")),
    *(("newmark", {"contact": contact}) for contact in ("frozen", "iterated")),
    *(("generalised_alpha", {"contact": contact}) for contact in ("frozen", "iterated")),
    *(("scipy", options) for options in ({"solver": "Radau"}, SPLIT)),
]


def test_every_method_is_listed_with_the_meanings_of_its_options():
    """Each method of integration must state its events, its models and what its options mean."""
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
    """Halving the step must divide the error by 2 to the power of the order."""
    # At the contact ratio 1.5 the stiffness switches at pi / 2 and 3 pi / 2, where steps end.
    reference = simulate(PAIR, 0.7, periods=10)
    assert float(reference.displacement_min) > 0.0
    # Final states lie at step ends, so that the interpolation within steps has no influence.
    runs = [
        simulate(
            PAIR,
            0.7,
            periods=10,
            method=method,
            options={**options, "steps_per_period": step_count},
        )
        for step_count in (steps, 2 * steps)
    ]
    errors = [float(np.linalg.norm(run.final_state - reference.final_state)) for run in runs]
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
    """Compare samples and statistics of each method with the exact motion within its error."""
    # The motion starts on the coast side and bounces in every period, which covers the contact law.
    settings = {"periods": 4, "record_periods": 4, "samples_per_period": 64}
    settings["initial_state"] = -2.0, 0.0
    reference = simulate(FULL, 0.9, **settings)
    assert float(reference.bounces) >= 1.0 and float(reference.fraction_coast) > 0.02
    run = simulate(FULL, 0.9, method=method, options=options, **settings)
    for name in ("displacement", "fraction_coast", "contact_loss_fraction"):
        np.testing.assert_allclose(run[name], reference[name], rtol=0, atol=tolerance)
    # Extrema are taken over step ends and samples only.
    for name in ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min"):
        np.testing.assert_allclose(run[name], reference[name], rtol=5e-3, err_msg=name)


def ode45(rate, end, y, rtol, atol):
    """Integrate y' = rate(y) from 0 to `end` by the documented algorithm of MATLAB's ode45.

    Return the final y, the number of accepted steps and the number of rejected ones.
    """
    time, slope = 0.0, rate(y)
    longest_step = 0.1 * end
    step_count = rejected_count = 0
    weights = np.maximum(abs(y), atol / rtol)
    step = min(longest_step, 0.8 * rtol**0.2 / max(abs(slope) / weights))
    while time < end:
        shortest_step, first_try = 16 * np.spacing(time), True
        step = min(longest_step, max(shortest_step, step))
        if 1.1 * step >= end - time:
            step = end - time
        while True:
            stages = [slope]
            for coefficients, count in zip(RK45.A[1:], range(1, 6), strict=True):
                stages.append(rate(y + step * coefficients[:count] @ stages))
            new_y = y + step * RK45.B @ stages
            stages.append(rate(new_y))
            weights = np.maximum(np.maximum(abs(y), abs(new_y)), atol / rtol)
            error = step * max(abs(RK45.E @ stages) / weights)
            if error <= rtol:
                break
            rejected_count += 1
            # The first rejection uses the error estimate, further ones halve the step.
            factor = max(0.1, 0.8 * (rtol / error) ** 0.2) if first_try else 0.5
            step = max(shortest_step, step * factor)
            first_try = False
        time += step
        y, slope = new_y, stages[-1]
        step_count += 1
        if first_try:
            step *= min(5.0, 0.8 * (rtol / error) ** 0.2)
    return y, step_count, rejected_count


@pytest.mark.parametrize(("nu", "rtol"), [(0.5, 1e-3), (0.9, 1e-6)])
def test_rk45_takes_the_steps_of_ode45(nu, rtol):
    """`rk45` must take and reject as many steps as a copy of the algorithm of ode45."""

    def rate(state):
        """Return the derivatives of displacement and velocity over phase."""
        x, v = state
        damping = 0.1 if x >= 0.0 else 0.02
        return np.array([v, (1.0 - max(x, 0.0)) / nu**2 - damping / nu * v])

    # The pair has constant stiffness and no coast flank, and it loses contact.
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
        # There is one per step, one at the start, and one after each of two switches on step ends.
        ("newmark", {"contact": "frozen"}, 200 * 7 + 1 + 2 * 7),
        # Without contact loss one iteration finds the solution and a second one confirms it.
        ("generalised_alpha", {}, 2 * 200 * 7 + 1 + 2 * 7),
    ],
)
@pytest.mark.parametrize("record_periods", [1, 7])
def test_evaluations_are_counted(method, options, count, record_periods):
    """A run must report the known number of evaluations of its right-hand side."""
    state = tuple(simulate(PAIR, 0.7, periods=100).final_state.values)
    settings = {"periods": 7, "record_periods": record_periods, "initial_state": state}
    run = simulate(PAIR, 0.7, method=method, options=options, **settings)
    assert int(run.evaluations) == count


@pytest.mark.parametrize(
    ("method", "options"),
    [("exact", {}), ("taylor", {}), *(row for row in VARIANTS if row[0] != "smoothed")],
)
def test_samples_satisfy_the_equation_of_motion(method, options):
    """Insert displacement, velocity and acceleration of the samples into the equation of motion."""
    run = simulate(OIL_FREE, 0.9, periods=12, record_periods=3, method=method, options=options)
    displacement, is_touching = run.displacement, run.contact != 0
    assert np.array_equal(
        is_touching, (displacement >= 0) | (displacement <= -OIL_FREE.backlash_ratio)
    )
    assert not run.dynamic_force.values[~is_touching.values].any() and not is_touching.all()
    assert np.array_equal(run.modified_stiffness, run.stiffness * is_touching)
    damping = np.where(is_touching, OIL_FREE.damping_ratio, 0.0)
    force = 2 * damping / 0.9 * run.velocity + (run.dynamic_force - 1) / 0.81
    assert float(abs(run.acceleration + force).max()) < 1e-12


@pytest.mark.parametrize(("method", "options"), VARIANTS)
def test_an_unbounded_motion_ends_with_the_status_overflow(method, options):
    """A motion that grows without bound must end with the status "overflow" and NaN."""
    # The run by scipy starts with a large state, because from rest it would take minutes.
    large_start = {"periods": 50, "initial_state": (9e149, 0.0)}
    settings = large_start if method == "scipy" else {"periods": 5000}
    run = simulate(GROWING, 2.0, method=method, options=options, **settings)
    assert int(run.status) == OVERFLOW and run.displacement.isnull().all()


def test_iterations_that_do_not_converge_end_the_run_with_a_status():
    """A run whose Newton iterations fail must end with a status that names the option to change."""
    # With a hardening contact and steps of 20 natural periods Newton's iteration oscillates.
    model = OneDegreePair(pair=PAIR, cubic_stiffness=2e9)
    run = simulate(model, 0.05, periods=200, method="newmark", options={"steps_per_period": 1})
    assert int(run.status) == NOT_CONVERGED and "steps_per_period" in run.status.attrs["message"]
    assert run.displacement.isnull().all()


def test_a_missing_package_is_named_in_the_refusal(monkeypatch):
    """Pretend that heyoka is not installed: the list of methods and the refusal must say so."""
    package, find_installed = integrators.METHODS["heyoka"].PACKAGE, importlib.util.find_spec
    monkeypatch.setattr(
        "gearlib.integrators.method.find_spec",
        lambda module: None if module == package.module else find_installed(module),
    )
    (method,) = [method for method in gearlib.methods() if method.name == "heyoka"]
    assert not method.available and package.distribution in method.note
    for error_type in (ValueError, ImportError):
        with pytest.raises(error_type, match=f"heyoka.*{package.distribution}") as refusal:
            simulate(PAIR, 0.9, periods=1, method="heyoka")
        assert "\n" not in str(refusal.value)
