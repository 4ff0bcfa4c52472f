"""The far flanks under a backlash that moves with bearings and run-out: work and grazing."""

from dataclasses import replace

import numpy as np
import pytest

from gearlib import simulate
from tests.properties.known_models import gears

LIMIT = 2000


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
