"""Forces of the turning frame: whirl of a Jeffcott rotor, which has closed forms, and orbits.

The rotor has a support at rest with a stiffness and the damping `outer`. A shaft with bending
stiffness and the damping `inner` connects it to a plate that rotates with the frame.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib import Body, Shaft, periodic_orbit, planetary
from gearlib.analysis.orbits.shooting import floquet_multipliers

MASS, SUPPORT, SHAFT = 2.0, 6e7, 4e7
NATURAL = math.sqrt((SUPPORT + SHAFT) / MASS)


def whirl_eigenvalues(outer, inner, speed):
    """Return the eigenvalues of a Jeffcott rotor in the frame that rotates at `speed`, rad/s.

    `outer` and `inner` are the damping of its support and of its rotating shaft, Ns/m. The rotor is
    the sun of a planetary train without contact in any mesh.
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


@pytest.mark.parametrize("speed_ratio", [0.1, 0.9, 1.1, 5.0])
def test_an_undamped_rotor_whirls_at_one_frequency_of_the_fixed_frame(speed_ratio):
    """Whirl frequencies in the rotating frame must be the natural frequency +- the speed."""
    values, speed = whirl_eigenvalues(0.0, 0.0, speed_ratio * NATURAL), speed_ratio * NATURAL
    # In a frame that rotates at W, forward and backward whirl at +-w0 have the frequencies
    # +-w0 +- W.
    expected = sorted(s * NATURAL - c * speed for s in (1, -1) for c in (1, -1))
    np.testing.assert_allclose(np.sort(values.imag), expected, atol=1e-9 * (NATURAL + speed))
    np.testing.assert_allclose(values.real, 0.0, atol=1e-7 * NATURAL)


@pytest.mark.parametrize(
    ("outer", "inner"), [(500.0, 400.0), (200.0, 400.0), (0.0, 300.0), (300.0, 0.0)]
)
def test_rotating_damping_destabilises_a_rotor_above_its_critical_speed(outer, inner):
    """A rotor must become unstable at the known limit w0 (1 + c_outer / c_inner)."""
    # Damping of the support at rest raises the limit to w0 (1 + c_outer / c_inner).
    stability_limit = NATURAL * (1.0 + outer / inner) if inner else math.inf
    near_limit = (0.999 * stability_limit, 1.001 * stability_limit) if inner else ()
    for speed in (0.5 * NATURAL, *near_limit, 3.5 * NATURAL):
        assert (whirl_eigenvalues(outer, inner, speed).real.max() > 0.0) == (
            speed > stability_limit
        )


@pytest.mark.parametrize("planets", [3, 4])
def test_an_orbit_omits_only_the_two_multipliers_of_the_rigid_body_rotation(planets):
    """Compare with all multipliers of the period map, of which the first two are 1."""
    # Coriolis forces couple the planets to the rigid-body rotation by angular momentum.
    train = planetary(
        planets=planets, teeth=(24, 72), stiffness_ratio=(0.8, 0.8), turning=True, gyroscopic=True
    )
    orbit = periodic_orbit(train, 0.9)
    _, maps, _ = train.propagator(0.9).maps(orbit.state, orbit.period, 100)
    all_multipliers = floquet_multipliers(maps[0])
    # Rounding splits the double multiplier 1 by the root of its size.
    np.testing.assert_allclose(all_multipliers[:2], 1.0, atol=1e-6)
    # Coefficients of the polynomial do not depend on the order of the multipliers.
    np.testing.assert_allclose(np.poly(orbit.multipliers), np.poly(all_multipliers[2:]), atol=1e-11)


def test_friction_on_the_rigid_body_rotation_of_a_turning_train_leaves_no_orbit():
    """Friction that drives the rigid-body rotation must be refused, since no orbit exists."""
    train = planetary(turning=True, gyroscopic=True)
    train = train.replace(meshes=[replace(mesh, friction=0.05) for mesh in train.meshes])
    with pytest.raises(ValueError, match="gyroscopic = True.*friction"):
        periodic_orbit(train, 0.9)
