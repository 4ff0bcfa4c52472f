"""The far flanks under a backlash that moves with bearings and run-out: forces, work, grazing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib import periodic_orbit, simulate
from gearlib.analysis.orbits.shooting import contacts
from gearlib.models.piecewise_linear import by_phase
from gearlib.runs.variational import without_rotation
from tests.physics.test_six_degrees import EVERYTHING, gears
from tests.physics.test_variational import differences

LIMIT = 2000
FRICTION = {"friction": (0.06, 0.04), "pitch_phase": 0.7}


@pytest.mark.parametrize("moving", [True, False])
def test_no_force_jumps_at_a_flank_that_is_just_touched(moving):
    model = gears(1e9, 3953.7, 800.0, **EVERYTHING, moving_backlash=moving)
    system = model.system(0.9)
    rng = np.random.default_rng(0)
    for contact, (line,) in ((-1, system.far), (1, system.near)):
        for q in range(system.effect.shape[1]):
            own, free = (by_phase(system, [code], q) for code in (contact, 0))
            # States on the line, at rest relative to it.
            held = np.array([line, line @ free])
            for _ in range(20):
                z = rng.normal(size=line.size)
                z -= np.linalg.pinv(held) @ (held @ z)
                jump = (own - free) @ z
                # A sum of twenty terms of the size of the matrix.
                assert abs(jump).max() < 1e-13 * abs(own).max()


def test_a_backlash_at_rest_is_that_of_one_degree():
    # With the far flank s_k behind the normal one, k acts on y' in inverse mesh as in Eq. (6).
    model = gears(1e9, 3953.7, 800.0, moving_backlash=False)
    system, n = model.system(0.9), model.size
    for q in range(system.effect.shape[1]):
        one, other = (by_phase(system, [code], q) for code in (1, -1))
        # Only the constant of y + s_k differs.
        assert abs((one - other)[:, :n]).max() < 1e-15 * abs(one).max()


@pytest.mark.parametrize("moving", [True, False])
def test_conservative_gears_keep_their_energy(moving):
    # No damping, no run-out and, at a contact ratio of 2, one stiffness: kinetic energy, springs,
    # the mesh and the load sum up to a constant, whichever flanks touch.
    nu = 0.9
    model = gears(1e9, share=0.0, backlash=12e-6, moving_backlash=moving)
    model = replace(model, pair=model.pair.replace(contact_ratio=2.0))
    pair, m = model.pair, 6
    mass = np.array([*(j / 0.01 for j in model.inertias), *np.repeat(model.masses, 2)])
    bearings = np.array(model.bearing_stiffness) / pair.mean_stiffness

    def energy(z):
        q, v = z[:m], z[m:]
        turn, slide = q[0] + q[1], q[2] - q[4]
        far = turn + pair.backlash_ratio + (0.0 if moving else slide)
        mesh = max(turn + slide, 0.0) ** 2 + min(far, 0.0) ** 2
        kinetic = nu**2 * (mass @ v**2) / pair.reduced_mass
        return 0.5 * (kinetic + bearings @ q[2:] ** 2 + mesh) - turn

    state = model.propagator(nu).start((5.0, 0.0))
    run = simulate(model, nu, periods=12, record_periods=12, initial_state=(5.0, 0.0))
    assert float(run.fraction_inverse) > 0.1
    energies = [energy(state)]
    for _ in range(12):
        state = model.propagator(nu).maps(state, 1, LIMIT)[0]
        energies.append(energy(state))
    # Some fifty events, each placed to rounding times the energies of the parts.
    np.testing.assert_allclose(energies, energies[0], rtol=0, atol=1e-11)


def touching(model, speed):
    """Return a state on the far line, with bearings that pass each other, and (y - s)' given."""
    z = np.zeros(12)
    z[:2] = -model.pair.backlash_ratio / 2.0
    z[2], z[4] = -0.05, 0.05
    z[6], z[8], z[10] = speed, 3.0, -3.0
    return z


@pytest.mark.parametrize(("material", "oil"), [(0.0, 4e4), (3953.7, 4e4), (4e4, 0.0)])
def test_the_far_flank_is_grazed_without_chatter(material, oil):
    # Oil that damps far more than the material: y' then drives the flanks together.
    model = gears(1e9, material, oil, backlash=200e-6)
    ends = {}
    for speed in (-1e-6, 0.0, 1e-6):
        state = touching(model, speed)
        events, _, _ = model.propagator(0.9).record(state.copy(), 1, LIMIT)
        assert len(events) <= 2
        ends[speed] = model.propagator(0.9).maps(state, 1, LIMIT)
        assert ends[speed][2] == 0
    # A microscopic difference stays one; the map of a touch is one of the two sides, and no spike.
    for speed in (-1e-6, 1e-6):
        assert abs(ends[speed][0] - ends[0.0][0]).max() < 1e-4
    assert max(abs(end[1]).max() for end in ends.values()) < 10.0


@pytest.mark.parametrize(("material", "oil"), [(1500.0, 300.0), (600.0, 1200.0)])
@pytest.mark.parametrize("more", [FRICTION, EVERYTHING])
def test_maps_through_inverse_mesh_are_the_differences(material, oil, more):
    model = gears(3e9, material, oil, backlash=14e-6, **more)
    state = model.propagator(0.8).start((5.0, 0.0))
    for _ in range(2):
        _, maps, code = model.propagator(0.8).maps(state, 1, LIMIT)
        events, _, _ = model.propagator(0.8).record(state.copy(), 1, LIMIT)
        assert code == 0 and -1 in events[:, 3]
        expected = differences(model, 0.8, state)
        # Truncation of the differences, as in test_variational.
        np.testing.assert_allclose(maps[0], expected, rtol=0, atol=2e-6 * abs(expected).max())
        state = model.propagator(0.8).maps(state, 1, LIMIT)[0]


@pytest.mark.parametrize(("material", "oil"), [(1500.0, 300.0), (600.0, 1200.0)])
def test_a_periodic_orbit_with_inverse_mesh(material, oil):
    model = gears(3e9, material, oil, share=0.2, backlash=12e-6, **FRICTION)
    orbit = periodic_orbit(model, 0.8)
    pattern, _ = contacts(model, 0.8, orbit.state, 1, LIMIT)
    assert -1 in pattern and 1 in pattern
    end = model.propagator(0.8).maps(orbit.state, 1, LIMIT)[0]
    np.testing.assert_allclose(end[2:6], orbit.state[2:6], rtol=0, atol=1e-11)
    reduced = without_rotation(model, differences(model, 0.8, orbit.state))
    found = np.linalg.eigvals(reduced)
    by_size = [np.sort(abs(values)) for values in (orbit.multipliers, found)]
    # Two multipliers close to each other move by the root of the 1e-7 of the differences.
    np.testing.assert_allclose(*by_size, rtol=0, atol=1e-4)
    # Where it goes by itself, from rest.
    run = simulate(model, 0.8, periods=300)
    assert int(run.period) == 1 and float(run.fraction_inverse) > 0.2
    assert math.isclose(
        float(run.final_state[0]), sum(orbit.state[:3]) - orbit.state[4], abs_tol=1e-7
    )
