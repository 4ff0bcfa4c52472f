"""From a drawn mesh, its load and a damping to the parameters of a `GearPair`."""

import math

from gearlib import checks


def pair_parameters(
    mesh,
    *,
    torque=None,
    power=None,
    speed=None,
    damping_ratio=None,
    logarithmic_decrement=None,
    material_damping=None,
    backlash_damping_ratio=0.0,
    stiffness="iso",
    options=None,
):
    """Return the parameters of a `GearPair` as a dict; see `GearPair.from_geometry`."""
    torque = _torque(torque, power, speed)
    found = mesh.stiffness(stiffness, torque=torque, **(options or {}))
    mass = mesh.reduced_mass
    # k = 2 beta m Omega_s, with m Omega_s = sqrt(C_s m).
    unit = 2.0 * math.sqrt(found.mean_stiffness * mass)
    given = {
        "damping_ratio": damping_ratio,
        "logarithmic_decrement": logarithmic_decrement,
        "material_damping": material_damping,
    }
    given = {name: value for name, value in given.items() if value is not None}
    if len(given) > 1:
        raise ValueError(
            f"{' and '.join(given)} are not allowed together: it must be one of them at most"
        )
    damping = 0.0
    for name, value in given.items():
        damping = checks.finite_nonnegative(name, value)
        if name == "logarithmic_decrement":
            damping /= math.hypot(math.tau, damping)
        if name != "material_damping":
            damping *= unit
    oil = checks.finite_nonnegative("backlash_damping_ratio", backlash_damping_ratio)
    return {
        **found.ratios(),
        "reduced_mass": mass,
        "load": mesh.load(torque),
        "backlash": mesh.line_backlash,
        "material_damping": damping,
        "backlash_damping": oil * unit,
        "teeth": mesh.pinion.teeth,
    }


def _torque(torque, power, speed):
    if (torque is None) == (power is None) or (power is None) != (speed is None):
        raise ValueError(
            f"torque = {torque!r} with power = {power!r} and speed = {speed!r} is not allowed: it "
            "must be either torque, or power and speed"
        )
    if power is None:
        return checks.finite_positive("torque", torque)
    turning = math.tau / 60.0 * checks.finite_positive("speed", speed)
    return checks.finite_positive("power", power) / turning
