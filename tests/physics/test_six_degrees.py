"""Six degrees of freedom against other ways to the same motion."""

import math

import numpy as np
import pytest
from scipy.linalg import eigh, expm

from benchmarks.scipy_split import run as scipy_run
from gearlib import Harmonics, SixDegreePair, periodic_orbit, simulate, sweep
from gearlib.analysis.orbits.touching import turning_points
from gearlib.data import status
from gearlib.models.excitation import segments_of
from gearlib.models.piecewise_linear import by_phase
from tests.paper import PAPER

RADIUS, BODY = 0.1, 17.27


def pair(material=0.0, oil=0.0, backlash=40e-6):
    return PAPER.replace(backlash=backlash, material_damping=material, backlash_damping=oil)


def gears(bearing, material=0.0, oil=0.0, free=False, share=0.02, **more):
    """Equal gears of the paper's reduced mass: torsional, or free with the bodies."""
    torsional = 1.0 / (1.0 / 3.123 - 2.0 / BODY) if free else 3.123
    damping = 0.0 if math.isinf(bearing) else 2.0 * share * math.sqrt(bearing * BODY)
    inertia = 2.0 * torsional * RADIUS**2
    backlash = more.pop("backlash", 40e-6)
    return SixDegreePair(
        pair=pair(material, oil, backlash),
        base_radii=(RADIUS, RADIUS),
        inertias=(inertia, inertia),
        masses=(BODY, BODY),
        bearing_stiffness=(bearing,) * 4,
        bearing_damping=(damping,) * 4,
        **more,
    )


EVERYTHING = {
    "friction": (0.06, 0.04),
    "pitch_phase": 0.7,
    "eccentricities": (8e-6, 5e-6),
    "run_out_phase": 0.9,
    "teeth": (24, 31),
    "deviation": Harmonics((1e-6, 0.5e-6), (0.3e-6,)),
    "inverse_deviation": Harmonics((0.7e-6,), (0.0, 0.4e-6)),
}


@pytest.mark.parametrize(("damping", "periods"), [(3953.7, 100), (0.0, 8)])
@pytest.mark.parametrize("nu", [0.5, 0.7, 0.82, 0.9])
def test_rigid_bearings_are_the_model_of_one_degree(nu, damping, periods):
    model = gears(math.inf, damping, damping)
    options = {"periods": periods, "record_periods": 4}
    six, one = simulate(model, nu, **options), simulate(model.pair, nu, **options)
    assert np.array_equal(six.event_to, one.event_to)
    for name in ("displacement", "velocity", "acceleration", "dynamic_force", "event_phase"):
        np.testing.assert_allclose(six[name], one[name], rtol=0, atol=1e-9, err_msg=name)
    for name in ("displacement_max", "displacement_min", "fraction_min_stiffness", "bounces"):
        np.testing.assert_allclose(six[name], one[name], rtol=0, atol=1e-9, err_msg=name)


def test_stiff_bearings_approach_rigid_ones_like_their_compliance():
    options = {"periods": 60, "record_periods": 1}
    rigid = simulate(gears(math.inf, 3953.7, 3953.7), 0.7, **options)
    stiffness = np.array([1e12, 4e12, 16e12])
    # Well damped bearings: what is left is their static give.
    errors = [
        float(
            abs(
                simulate(gears(c, 3953.7, 3953.7, share=0.5), 0.7, **options).displacement
                - rigid.displacement
            ).max()
        )
        for c in stiffness
    ]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(stiffness))
    np.testing.assert_allclose(slopes, -1.0, atol=0.1)


@pytest.mark.parametrize("bearing", [3e7, 1e9])
def test_eigenfrequencies(bearing):
    model = gears(bearing, share=0.0)
    # C_max in normal mesh, no damping: imaginary eigenvalues, in pairs; one free rotation.
    found = np.linalg.eigvals(by_phase(model.system(0.8), [1], 0)[:12, :12])
    inertia = model.inertias[0] / RADIUS**2
    mass = np.diag([inertia, inertia, BODY, BODY, BODY, BODY])
    y = np.array([1.0, 1.0, 1.0, 0.0, -1.0, 0.0])
    stiffness = 4e8 * np.outer(y, y) + np.diag([0, 0, *[bearing] * 4])
    squares = eigh(stiffness, mass, eigvals_only=True)
    expected = np.sqrt(np.abs(squares[1:])) / model.mesh_frequency(0.8)
    got = np.sort(found.imag[found.imag > 1e-6])
    np.testing.assert_allclose(got, np.sort(expected), rtol=1e-9)


@pytest.mark.parametrize(
    ("model", "nu", "state"),
    [
        (gears(3e7, free=True), 0.66, (0.0, 0.0)),
        (gears(3e7, 3953.7, 500.0, free=True, **EVERYTHING), 0.9, (0.0, 0.0)),
        (gears(1e8, 3953.7, 3953.7, **EVERYTHING, backlash=12e-6), 0.55, (1.0, -2.5)),
        (gears(1e9, 1000.0, 0.0, **EVERYTHING), 0.8, (0.5, 1.0)),
        (gears(1e8, 3953.7, 500.0, preload=False), 0.8, (0.0, 0.0)),
        (gears(1e8, 100.0, 0.0, **EVERYTHING, moving_backlash=False), 0.6, (1.0, -4.5)),
    ],
)
def test_against_scipy_split_at_events(model, nu, state):
    periods = 8
    x, v, events, _ = scipy_run(model, nu, periods, state, rtol=1e-13)
    run = simulate(model, nu, periods=periods, record_periods=periods, initial_state=state)
    assert run.event_to.values.tolist() == [event[2] for event in events]
    np.testing.assert_allclose(run.event_phase, [event[0] for event in events], rtol=0, atol=1e-7)
    np.testing.assert_allclose(run.final_state, [x, v], rtol=0, atol=1e-8)
    fast = simulate(model, nu, periods=periods, initial_state=state)
    np.testing.assert_allclose(fast.final_state, run.final_state, rtol=0, atol=1e-9)


def pieces(model, nu, periods, state):
    """Yield (length, contact code, segment, matrix, state at its start) from event to event."""
    propagator = model.propagator(nu)
    system = propagator.system
    motion, _ = propagator.motion(propagator.start(state), periods, 10**6)
    (code,) = motion.codes
    for i, z in enumerate(motion.states):
        own = motion.events[motion.events[:, 0] == i]
        cuts = sorted([(t, None) for t in system.starts] + [(row[1], int(row[3])) for row in own])
        for (t, after), (end, _) in zip(cuts, cuts[1:], strict=False):
            code = code if after is None else after
            segment = int(np.searchsorted(system.starts, (t + end) / 2.0)) - 1
            matrix = by_phase(system, [code], segment)
            # Steps as short as a mode is slow, for Gauss's rule.
            count = max(math.ceil((end - t) * np.abs(matrix).max() ** 0.5), 1)
            one = expm(matrix * (end - t) / count)
            for _ in range(count if end > t else 0):
                yield (end - t) / count, code, segment, matrix, z
                z = one @ z


def energy_gap(model, nu, periods=6, state=(0.0, 0.0)):
    """Return |stored - work| over the largest stored energy, and the share of inverse mesh.

    In units of load times static deflection; the integrals by Gauss's rule.
    """
    system = model.system(nu)
    (near,), (far,) = system.near, system.far
    m = 2 + len(model.flexible())
    nodes, weights = np.polynomial.legendre.leggauss(16)
    radii = np.array(model.base_radii)
    mass = np.array(model.inertias) / radii**2
    bodies = [model.masses[0], model.masses[0], model.masses[1], model.masses[1]]
    mass = np.concatenate([mass, bodies])[:m] / model.reduced_mass * nu**2
    bearings = np.zeros(m)
    drag = np.zeros(m)
    if m > 2:
        bearings[2:] = np.array(model.bearing_stiffness) / model.mean_stiffness
        speed = model.mean_eigenfrequency * nu
        drag[2:] = np.array(model.bearing_damping) * speed / model.mean_stiffness
    torque = np.append(np.array(model.torques) / radii / model.load, np.zeros(m - 2))
    across = np.zeros(m)
    if m > 2:
        across[[3, 5]] = -1.0, 1.0
    worst, last, inverse, exponentials = 0.0, None, 0.0, {}
    for length, code, p, matrix, z in pieces(model, nu, periods, state):
        elastic = {1: near, 0: 0.0 * near, -1: far}[code]
        c = system.stiffness[code + 1, p, 0]
        oil = 2.0 * model.pair.backlash_damping_ratio * nu
        more = 2.0 * model.pair.damping_ratio * nu - oil if code else 0.0
        inverse += length if code == -1 else 0.0
        sense = segments_of(model)[3][p]
        mu = {1: model.friction[0], 0: 0.0, -1: model.friction[1]}[code]

        def stored(at, elastic=elastic, c=c):
            kinetic = 0.5 * mass @ at[m : 2 * m] ** 2
            return kinetic + 0.5 * bearings @ at[:m] ** 2 + 0.5 * c * (elastic @ at) ** 2

        key = length, code, p
        if key not in exponentials:
            times = [0.5 * length * (node + 1.0) for node in nodes]
            exponentials[key] = expm(matrix * np.array([*times, length])[:, None, None])
        # A switch of stiffness puts energy into the mesh: each step for itself.
        *inside, end = exponentials[key] @ z
        last, initial, gained = stored(end), stored(z), 0.0
        for at, weight in zip(inside, weights, strict=True):
            rate = matrix @ at
            v, force = at[m : 2 * m], c * (elastic @ at)
            y_rate, touch_rate = near @ rate, elastic @ rate
            power = torque @ v - drag @ v**2 + mu * sense * force * (across @ v)
            # What oil and material dissipate, and what run-out and deviation put in: the
            # rates of the distances but for what the coordinates do.
            power -= oil * y_rate**2 + more * touch_rate**2
            power += oil * y_rate * (y_rate - near[:m] @ v)
            power += (force + more * touch_rate) * (touch_rate - elastic[:m] @ v)
            gained += 0.5 * length * weight * power
        worst = max(worst, abs(last - initial - gained))
    return worst / max(1.0, abs(last)), inverse / (2.0 * math.pi * periods)


@pytest.mark.parametrize(
    ("model", "nu", "inverse"),
    [
        (gears(3e7, free=True), 0.66, False),
        (gears(3e7, 3953.7, 500.0, free=True, **EVERYTHING), 0.9, False),
        (gears(1e10, 1500.0, 300.0, **EVERYTHING, backlash=8e-6), 0.82, True),
        (gears(1e9, 600.0, 3953.7, **EVERYTHING, backlash=12e-6), 0.82, True),
        (gears(1e9, 600.0, 0.0, **EVERYTHING, backlash=8e-6, moving_backlash=False), 0.9, True),
        (gears(math.inf), 0.82, True),
    ],
)
def test_energy_balance_closes(model, nu, inverse):
    # Before bearings close the backlash.
    gap, share = energy_gap(model, nu, 4, (5.0, 0.0) if inverse else (0.0, 0.0))
    # Some hundred steps, each with the rounding of its parts.
    assert gap < 1e-12
    assert (share > 0.1) == inverse


def test_soft_and_rigid_bearings_bounce_near_two_thirds():
    # As in the paper's Fig. 8: conservative mesh, rest start; bearing damping 2 % is a choice.
    for model in (gears(math.inf), gears(3e7, free=True)):
        curve = sweep(model, [0.62, 0.66, 0.70], periods=120, record_periods=24)
        assert (curve.bounces.values > 0).tolist() == [False, True, False]


def test_recorded_and_unrecorded_periods_agree():
    rng = np.random.default_rng(1)
    compared = 0
    for _ in range(60):
        model = gears(
            10 ** rng.uniform(7, 9.5),
            rng.choice([0.0, 10 ** rng.uniform(2, 4)]),
            rng.choice([0.0, 10 ** rng.uniform(2, 4)]),
            backlash=10 ** rng.uniform(-6, -4),
            friction=tuple(rng.uniform(0, 0.1, 2)),
            eccentricities=tuple(rng.uniform(0, 1e-5, 2)),
        )
        nu, state = 10 ** rng.uniform(-0.5, 0.3), tuple(rng.uniform(-3, 3, 2))
        whole = simulate(model, nu, periods=4, record_periods=4, initial_state=state)
        fast = simulate(model, nu, periods=4, initial_state=state)
        nudged = simulate(model, nu, periods=4, initial_state=(state[0], state[1] + 1e-12))
        spread = float(abs(nudged.final_state - fast.final_state).max())
        error = float(abs(whole.final_state - fast.final_state).max())
        assert whole.status == fast.status
        if whole.status == status.JAMMED:
            # Soft bearings closed the backlash.
            continue
        assert error <= 1e-10 + 10 * spread
        compared += spread < 1e-8
    assert compared > 40


def test_courses_and_units():
    run = simulate(gears(3e7, free=True, **EVERYTHING), 0.9, periods=3)
    y = run.rotation_3 + run.rotation_2 + run.bearing_y3 - run.bearing_y2
    s = run.backlash + 4.0 - (run.bearing_y3 - run.bearing_y2)
    # What is left of y is run-out and deviation; of s run-out and both deviations.
    far_deviation = run.displacement - y - s
    tau = run.phase
    expected = 0.07 * np.cos(tau) + 0.04 * np.sin(2 * tau)
    np.testing.assert_allclose(far_deviation, expected, atol=1e-12)
    for name in ("friction_force", "bearing_force_y3", "bearing_force_z2"):
        assert run[name].attrs["units"] == "1" and float(abs(run[name]).max()) > 0


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"masses": (1.0,)}, "masses"),
        ({"inertias": (1.0, -1.0)}, "inertias[1] = -1.0"),
        ({"bearing_stiffness": (0.0, 1.0, 1.0, 1.0)}, "bearing_stiffness[0]"),
        ({"friction": (0.1, math.nan)}, "friction[1]"),
        ({"teeth": (0, 3)}, "teeth[0]"),
        ({"pair": 3}, "pair = 3"),
        ({"deviation": 1.0}, "deviation"),
    ],
)
def test_wrong_input(change, part):
    good = {
        "pair": pair(),
        "base_radii": (0.1, 0.1),
        "inertias": (0.06, 0.06),
        "masses": (10.0, 10.0),
        "bearing_stiffness": (1e8,) * 4,
    }
    with pytest.raises(ValueError) as error:
        SixDegreePair(**good | change)
    assert part in str(error.value) and "must be" in str(error.value)


def test_a_backlash_closed_by_the_bearings_is_refused():
    # The far flank, moving with the bearings as in Eq. (4), is left above the normal one.
    options = {"friction": (0.019, 0.054), "eccentricities": (4.5e-6, 9.6e-6)}
    start = {"initial_state": (1.03, 2.07), "periods": 8}
    for record in (1, 8):
        model = gears(2.43e9, 4000.0, 0.0, backlash=1.98e-5, **options)
        run = simulate(model, 1.808, record_periods=record, **start)
        assert run.status == status.JAMMED
        assert np.isnan(run.displacement_max)
        assert "moving_backlash=False" in run.status.attrs["message"]
    fixed = gears(2.43e9, 4000.0, 0.0, backlash=1.98e-5, moving_backlash=False, **options)
    assert simulate(fixed, 1.808, **start).status == status.OK


def test_an_orbit_is_found_from_the_mesh_and_from_all_coordinates():
    model = gears(3e7, 3953.7, 3953.7, free=True, share=0.2)
    orbit = periodic_orbit(model, 0.7)
    assert orbit.state.size == model.size > 2
    expected = turning_points(model, 0.7, orbit.state, 1, 10_000)
    # The mesh alone: other coordinates where they rest under the load. Both gears may have turned.
    for guess in (orbit.state, (1.0, 0.0)):
        again = periodic_orbit(model, 0.7, guess=guess)
        found = turning_points(model, 0.7, again.state, 1, 10_000)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
