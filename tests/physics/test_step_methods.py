"""Check the step methods: order, accuracy, evaluations, statuses and missing packages."""

import importlib.util
import math

import numpy as np
import pytest
from scipy.integrate import RK45

import gearlib
from gearlib import GearPair, OneDegreePair, integrators, simulate
from gearlib.data.status import NOT_CONVERGED, OVERFLOW
from tests.paper import PAPER_PAIR
from tests.properties.known_models import CUBIC, MOTION_CASES

DAMPED_PAIR = PAPER_PAIR.replace(
    contact_ratio=1.5, material_damping=3953.7, backlash_damping=3953.7
)
PAIR_DAMPED_IN_CONTACT = DAMPED_PAIR.replace(contact_ratio=1.569, backlash_damping=0.0)
NONLINEAR_PAIR = MOTION_CASES["everything"].model.replace(cubic_stiffness=2e9, **CUBIC)
#: A pair without backlash and damping, all of whose motions grow in the middle of a tongue.
UNSTABLE_PAIR = GearPair.from_ratios(contact_ratio=1.5, stiffness_ratio=0.3, backlash_ratio=0.0)
SCIPY_WITH_EVENTS = {"solver": "DOP853", "rtol": 1e-12, "atol": 1e-12, "events": True}
METHOD_NAMES = (
    "exact",
    "taylor",
    "rk4",
    "rk45",
    "newmark",
    "generalised_alpha",
    "scipy",
    "smoothed",
)
#: All methods except the exact ones, with options that change their algorithm.
METHOD_VARIANTS = [
    *((method, {}) for method in ("rk4", "rk45", "smoothed", "scipy")),
    *(("newmark", {"contact": contact}) for contact in ("frozen", "iterated")),
    *(("generalised_alpha", {"contact": contact}) for contact in ("frozen", "iterated")),
    *(("scipy", options) for options in ({"solver": "Radau"}, SCIPY_WITH_EVENTS)),
]


def test_every_method_is_listed_with_the_meanings_of_its_options():
    """Each method must state how it finds events, its models and the meanings of its options."""
    methods = gearlib.methods()
    assert tuple(method.name for method in methods) == (*METHOD_NAMES, "heyoka")
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
    """Halving the step must divide the error of the final state by 2 to the power of the order.

    At the contact ratio 1.5 the stiffness changes at pi / 2 and 3 pi / 2, where steps end.
    """
    reference = simulate(DAMPED_PAIR, 0.7, periods=10)
    assert float(reference.displacement_min) > 0.0  # permanent contact
    errors = []
    for step_count in (steps, 2 * steps):
        step_options = {**options, "steps_per_period": step_count}
        run = simulate(DAMPED_PAIR, 0.7, periods=10, method=method, options=step_options)
        errors.append(float(np.linalg.norm(run.final_state - reference.final_state)))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1), errors


@pytest.mark.parametrize(
    ("method", "options", "tolerance"),
    [
        # Discontinuities within steps h = 2e-3 cause errors of order h^2 in the displacement.
        ("rk4", {"steps_per_period": 3200}, 1e-3),
        # The step size control rejects steps with discontinuities, so that errors follow rtol.
        ("rk45", {"rtol": 1e-9, "atol": 1e-9}, 1e-5),
        # The damping jumps by 2 beta v / nu = 0.1 at contact, which is detected up to a step late.
        ("newmark", {"steps_per_period": 3200, "contact": "frozen"}, 5e-3),
        ("newmark", {"steps_per_period": 3200, "contact": "iterated"}, 5e-3),
        ("generalised_alpha", {"steps_per_period": 3200, "contact": "frozen"}, 5e-3),
        ("generalised_alpha", {"steps_per_period": 3200, "contact": "iterated"}, 5e-3),
        # The smoothed contact law changes the impulse of a crossing by about 1 / sharpness^2.
        ("smoothed", {"sharpness": 1000.0}, 1e-5),
        ("scipy", {"solver": "RK45", "rtol": 1e-9, "atol": 1e-9}, 1e-5),
        ("scipy", {"solver": "Radau", "rtol": 1e-5, "atol": 1e-7}, 1e-3),
    ],
)
def test_small_steps_come_close_to_the_exact_motion(method, options, tolerance):
    """Samples and statistics of each method must agree with the exact motion within its error.

    The motion starts on the coast side and bounces in every period.
    """
    run_options = {"periods": 4, "record_periods": 4, "samples_per_period": 64}
    run_options["initial_state"] = -2.0, 0.0
    reference = simulate(NONLINEAR_PAIR, 0.9, **run_options)
    assert float(reference.bounces) >= 1.0 and float(reference.fraction_coast) > 0.02
    run = simulate(NONLINEAR_PAIR, 0.9, method=method, options=options, **run_options)
    for name in ("displacement", "fraction_coast", "contact_loss_fraction"):
        np.testing.assert_allclose(run[name], reference[name], rtol=0, atol=tolerance)
    # Step methods determine extrema from step ends and samples only.
    for name in ("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min"):
        np.testing.assert_allclose(run[name], reference[name], rtol=5e-3, err_msg=name)


def ode45(rate, end, y, rtol, atol):
    """Integrate y' = rate(y) from 0 to `end` by the documented algorithm of MATLAB's ode45.

    Return the final y and the numbers of accepted and rejected steps.
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
    """`rk45` must take and reject as many steps as an implementation of the algorithm of ode45.

    The pair has constant stiffness and infinite backlash, and it loses contact.
    """
    damping_ratio, free_flight_damping_ratio = 0.05, 0.01

    def rate(state):
        """Return the derivatives of displacement and velocity with respect to the mesh phase."""
        x, v = state
        beta = damping_ratio if x >= 0.0 else free_flight_damping_ratio
        return np.array([v, (1.0 - max(x, 0.0)) / nu**2 - 2.0 * beta / nu * v])

    pair = GearPair.from_ratios(
        contact_ratio=1.5,
        stiffness_ratio=1.0,
        damping=damping_ratio,
        backlash_damping=free_flight_damping_ratio,
    )
    initial_state, options = (3.0, 0.0), {"rtol": rtol, "atol": 1e-3 * rtol}
    end = 2.0 * math.tau
    state, step_count, rejected_count = ode45(rate, end, np.array(initial_state), **options)
    run = simulate(pair, nu, periods=2, method="rk45", options=options, initial_state=initial_state)
    # Each step needs six evaluations besides the one at its start, which is reused.
    assert int(run.evaluations) == 1 + 6 * (step_count + rejected_count) and rejected_count > 2
    np.testing.assert_allclose(run.final_state, state, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("method", "options", "count"),
    [
        ("rk4", {"steps_per_period": 48}, 4 * 48 * 7),
        # There is one evaluation per step (200 per period by default), one at the start, and one
        # after each of two changes of the stiffness per period.
        ("newmark", {"contact": "frozen"}, 200 * 7 + 1 + 2 * 7),
        # Without contact loss, one iteration finds the solution and a second one confirms it.
        ("generalised_alpha", {}, 2 * 200 * 7 + 1 + 2 * 7),
    ],
)
@pytest.mark.parametrize("record_periods", [1, 7])
def test_evaluations_are_counted(method, options, count, record_periods):
    """A run of seven periods must report the expected number of force evaluations."""
    state = tuple(simulate(DAMPED_PAIR, 0.7, periods=100).final_state.values)
    run_options = {"periods": 7, "record_periods": record_periods, "initial_state": state}
    run = simulate(DAMPED_PAIR, 0.7, method=method, options=options, **run_options)
    assert int(run.evaluations) == count


@pytest.mark.parametrize(
    ("method", "options"),
    [("exact", {}), ("taylor", {}), *(row for row in METHOD_VARIANTS if row[0] != "smoothed")],
)
def test_samples_satisfy_the_equation_of_motion(method, options):
    """Displacement, velocity and acceleration of all samples must satisfy the equation of motion.

    It is x'' + 2 beta / nu x' + (F - 1) / nu^2 = 0 with the mesh force F and the tuning nu; the
    damping ratio beta is 0 without contact.
    """
    nu = 0.9
    run = simulate(
        PAIR_DAMPED_IN_CONTACT, nu, periods=12, record_periods=3, method=method, options=options
    )
    displacement, is_touching = run.displacement, run.contact != 0
    is_in_contact_range = (displacement >= 0) | (
        displacement <= -PAIR_DAMPED_IN_CONTACT.backlash_ratio
    )
    assert np.array_equal(is_touching, is_in_contact_range)
    assert not run.dynamic_force.values[~is_touching.values].any() and not is_touching.all()
    assert np.array_equal(run.modified_stiffness, run.stiffness * is_touching)
    beta = np.where(is_touching, PAIR_DAMPED_IN_CONTACT.damping_ratio, 0.0)
    residual = run.acceleration + 2 * beta / nu * run.velocity + (run.dynamic_force - 1) / nu**2
    assert float(abs(residual).max()) < 1e-12


@pytest.mark.parametrize(("method", "options"), METHOD_VARIANTS)
def test_an_unbounded_motion_ends_with_the_status_overflow(method, options):
    """A motion that grows without bound must end with the status OVERFLOW and NaN."""
    if method == "scipy":
        # From rest this run would take minutes.
        run_options = {"periods": 50, "initial_state": (9e149, 0.0)}
    else:
        run_options = {"periods": 5000}
    run = simulate(UNSTABLE_PAIR, 2.0, method=method, options=options, **run_options)
    assert int(run.status) == OVERFLOW and run.displacement.isnull().all()


def test_iterations_that_do_not_converge_end_the_run_with_a_status():
    """A run whose Newton iteration fails must end with a status that names the option to change."""
    # For a hardening contact stiffness and steps of 20 natural periods, the iteration oscillates.
    model = OneDegreePair(pair=DAMPED_PAIR, cubic_stiffness=2e9)
    run = simulate(model, 0.05, periods=200, method="newmark", options={"steps_per_period": 1})
    assert int(run.status) == NOT_CONVERGED and "steps_per_period" in run.status.attrs["message"]
    assert run.displacement.isnull().all()


def test_a_missing_package_is_named_in_the_refusal(monkeypatch):
    """If heyoka is not installed, the list of methods and the error must name its package."""
    package, find_spec = integrators.METHODS["heyoka"].PACKAGE, importlib.util.find_spec

    def find_spec_without_heyoka(module):
        """Return the specification of an installed module, but None for heyoka."""
        return None if module == package.module else find_spec(module)

    monkeypatch.setattr("gearlib.integrators.method.find_spec", find_spec_without_heyoka)
    (method,) = [method for method in gearlib.methods() if method.name == "heyoka"]
    assert not method.available and package.distribution in method.note
    for error_type in (ValueError, ImportError):
        with pytest.raises(error_type, match=f"heyoka.*{package.distribution}") as refusal:
            simulate(DAMPED_PAIR, 0.9, periods=1, method="heyoka")
        assert "\n" not in str(refusal.value)
