"""Forces of the turning frame: whirl of a Jeffcott rotor, which has closed forms, and orbits.

The rotor has a support at rest with a stiffness and a damping. A shaft with bending stiffness and
damping connects it to a plate that rotates with the frame.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib import Body, Shaft, periodic_orbit, planetary
from gearlib.analysis.orbits.shooting import floquet_multipliers

ROTOR_MASS, SUPPORT_STIFFNESS, SHAFT_STIFFNESS = 2.0, 6e7, 4e7
NATURAL_FREQUENCY = math.sqrt((SUPPORT_STIFFNESS + SHAFT_STIFFNESS) / ROTOR_MASS)


def find_whirl_eigenvalues(support_damping, shaft_damping, speed):
    """Return the eigenvalues of a Jeffcott rotor in the frame that rotates at `speed`, rad/s.

    Both dampings, of the support at rest and of the rotating shaft, are in N s/m. The rotor is the
    sun of a planetary train without contact in any mesh.
    """
    train = planetary(turning=True, gyroscopic=True, backlash_damping=0.0, load=0.0)
    support = {"support_stiffness": SUPPORT_STIFFNESS, "support_damping": support_damping}
    bodies = [
        replace(body, mass=ROTOR_MASS, **support) if body.name == "sun" else body
        for body in train.bodies
    ]
    bodies.append(Body(name="plate", inertia=1.0, base_radius=0.1))
    bending = {"bending_stiffness": SHAFT_STIFFNESS, "bending_damping": shaft_damping}
    shaft = Shaft(bodies=("sun", "plate"), stiffness=1.0, **bending)
    train = train.replace(bodies=bodies, shafts=[shaft])
    frequency = train.reference_angular_frequency
    frame_speed_at_tuning_1 = float(train.speeds.frame) * frequency
    sun_coordinates = [train.structure.coordinates.index(("sun", axis)) for axis in "xy"]
    sun_coordinates += [train.size // 2 + i for i in sun_coordinates]
    system = train.system(speed / frame_speed_at_tuning_1)
    rotor_matrix = system.base_matrix[np.ix_(sun_coordinates, sun_coordinates)]
    return np.linalg.eigvals(rotor_matrix) * frequency


@pytest.mark.parametrize("speed_ratio", [0.1, 0.9, 1.1, 5.0])
def test_an_undamped_rotor_whirls_at_one_frequency_of_the_fixed_frame(speed_ratio):
    """Whirl frequencies in the rotating frame must be the natural frequency +- the speed."""
    speed = speed_ratio * NATURAL_FREQUENCY
    eigenvalues = find_whirl_eigenvalues(0.0, 0.0, speed)
    # In a frame that rotates at W, forward and backward whirl at +-w0 have the frequencies
    # +-w0 +- W.
    signs = itertools.product((1, -1), repeat=2)
    expected = sorted(i * NATURAL_FREQUENCY - k * speed for i, k in signs)
    np.testing.assert_allclose(
        np.sort(eigenvalues.imag), expected, atol=1e-9 * (NATURAL_FREQUENCY + speed)
    )
    np.testing.assert_allclose(eigenvalues.real, 0.0, atol=1e-7 * NATURAL_FREQUENCY)


@pytest.mark.parametrize(
    ("support_damping", "shaft_damping"),
    [(500.0, 400.0), (200.0, 400.0), (0.0, 300.0), (300.0, 0.0)],
)
def test_rotating_damping_destabilises_a_rotor_above_its_critical_speed(
    support_damping, shaft_damping
):
    """A rotor must become unstable at the known limit w0 (1 + c_support / c_shaft)."""
    stability_limit = (
        NATURAL_FREQUENCY * (1.0 + support_damping / shaft_damping) if shaft_damping else math.inf
    )
    speeds_near_limit = (0.999 * stability_limit, 1.001 * stability_limit) if shaft_damping else ()
    for speed in (0.5 * NATURAL_FREQUENCY, *speeds_near_limit, 3.5 * NATURAL_FREQUENCY):
        assert (find_whirl_eigenvalues(support_damping, shaft_damping, speed).real.max() > 0.0) == (
            speed > stability_limit
        )


@pytest.mark.parametrize("planets", [3, 4])
def test_an_orbit_omits_only_both_multipliers_of_the_rigid_body_rotation(planets):
    """Without the two multipliers 1 of the period map, both lists must have equal polynomials."""
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
