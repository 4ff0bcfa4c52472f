"""Forces of the turning frame: a rotor of Jeffcott, whose whirl has closed forms; orbits.

Its support, which stands still, has a stiffness and the damping `outer`. A shaft with bending
stiffness and the damping `inner` connects it to a plate that turns with the frame.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib import Body, Shaft, periodic_orbit, planetary
from gearlib.analysis.orbits.shooting import floquet_multipliers

MASS, SUPPORT, SHAFT = 2.0, 6e7, 4e7
NATURAL = math.sqrt((SUPPORT + SHAFT) / MASS)


def whirl(outer, inner, speed):
    """Return the eigenvalues of the rotor in the frame that turns at `speed`.

    It is the sun of a planetary train, all meshes of which are in their backlash.
    """
    train = planetary(turning=True, gyroscopic=True, backlash_damping=0.0, load=0.0)
    support = {"support_stiffness": SUPPORT, "support_damping": outer}
    bodies = [
        replace(body, mass=MASS, **support) if body.name == "sun" else body for body in train.bodies
    ]
    bodies.append(Body(name="plate", inertia=1.0, base_radius=0.1))
    bending = {"bending_stiffness": SHAFT, "bending_damping": inner}
    shaft = Shaft(bodies=("sun", "plate"), stiffness=1.0, **bending)
    train = train.replace(bodies=bodies, shafts=[shaft])
    frequency = train.reference_angular_frequency
    frame_speed_at_tuning_1 = float(train.speeds.frame) * frequency
    sun = [train.structure.coordinates.index(("sun", axis)) for axis in "xy"]
    sun += [train.size // 2 + i for i in sun]
    system = train.system(speed / frame_speed_at_tuning_1)
    return np.linalg.eigvals(system.base_matrix[np.ix_(sun, sun)]) * frequency


@pytest.mark.parametrize("share", [0.1, 0.9, 1.1, 5.0])
def test_an_undamped_rotor_whirls_at_one_frequency_of_the_fixed_frame(share):
    values, speed = whirl(0.0, 0.0, share * NATURAL), share * NATURAL
    # Forward and backward whirl at +-w0, seen from a frame that turns by W.
    expected = sorted(s * NATURAL - c * speed for s in (1, -1) for c in (1, -1))
    np.testing.assert_allclose(np.sort(values.imag), expected, atol=1e-9 * (NATURAL + speed))
    np.testing.assert_allclose(values.real, 0.0, atol=1e-7 * NATURAL)


@pytest.mark.parametrize(
    ("outer", "inner"), [(500.0, 400.0), (200.0, 400.0), (0.0, 300.0), (300.0, 0.0)]
)
def test_rotating_damping_destabilises_a_rotor_above_its_critical_speed(outer, inner):
    # Damping of a support that stands still raises the limit to w0 (1 + c_outer / c_inner).
    limit = NATURAL * (1.0 + outer / inner) if inner else math.inf
    near_limit = (0.999 * limit, 1.001 * limit) if inner else ()
    for speed in (0.5 * NATURAL, *near_limit, 3.5 * NATURAL):
        assert (whirl(outer, inner, speed).real.max() > 0.0) == (speed > limit)


@pytest.mark.parametrize("planets", [3, 4])
def test_an_orbit_omits_only_the_two_multipliers_of_the_rigid_body_rotation(planets):
    # Coriolis forces exchange angular momentum between the planets and the free rotation.
    train = planetary(
        planets=planets, teeth=(24, 72), stiffness_ratio=(0.8, 0.8), turning=True, gyroscopic=True
    )
    orbit = periodic_orbit(train, 0.9)
    _, maps, _ = train.propagator(0.9).maps(orbit.state, orbit.period, 100)
    expected = floquet_multipliers(maps[0])
    # Rounding divides the double multiplier 1 by its root.
    np.testing.assert_allclose(expected[:2], 1.0, atol=1e-6)
    # Coefficients do not depend on the order of the others, which rounding decides.
    np.testing.assert_allclose(np.poly(orbit.multipliers), np.poly(expected[2:]), atol=1e-11)


def test_friction_on_the_rigid_body_rotation_of_a_turning_train_leaves_no_orbit():
    train = planetary(turning=True, gyroscopic=True)
    train = train.replace(meshes=[replace(mesh, friction=0.05) for mesh in train.meshes])
    with pytest.raises(ValueError, match="gyroscopic = True.*friction"):
        periodic_orbit(train, 0.9)
