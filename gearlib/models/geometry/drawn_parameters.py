"""From a drawn mesh, its load and damping to parameters of a `GearPair` or of a mesh of a train."""

import math

from gearlib import checks
from gearlib.models.geometry.iso import iso_rectangle
from gearlib.models.stiffness import mean_over_max


def pair_parameters(mesh, *, torque=None, power=None, speed=None, **options):
    """Return the parameters of a `GearPair` as a dict; see `GearPair.from_geometry`."""
    torque = torque_of(torque, power, speed)
    return {
        **mesh_parameters(mesh, torque=torque, **options),
        "reduced_mass": mesh.reduced_mass,
        "load": mesh.load(torque),
        "teeth": mesh.pinion.teeth,
    }


def mesh_parameters(
    mesh,
    *,
    torque=None,
    damping_ratio=None,
    logarithmic_decrement=None,
    material_damping=None,
    backlash_damping_ratio=0.0,
    stiffness="iso",
    options=None,
):
    """Return stiffness, backlash and damping of a mesh as a dict; see `GearPair.from_geometry`."""
    ratios = rectangle(mesh, stiffness, torque=torque, **checks.options(options))
    high, kappa, epsilon = ratios
    mean = high * mean_over_max(epsilon, kappa)
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
        if name != "material_damping":
            damping = coefficient(damping, mean, mesh.reduced_mass, name == "logarithmic_decrement")
    oil = checks.finite_nonnegative("backlash_damping_ratio", backlash_damping_ratio)
    return {
        "max_stiffness": high,
        "stiffness_ratio": kappa,
        "contact_ratio": epsilon,
        "backlash": mesh.line_backlash,
        "material_damping": damping,
        "backlash_damping": coefficient(oil, mean, mesh.reduced_mass) if oil else 0.0,
    }


def train_parameters(mesh, **options):
    """Return the parameters of a `gearlib.Mesh` as a dict; see `gearlib.Mesh.from_geometry`."""
    angle = mesh.working_pressure_angle
    # Tooth thickness over the pitch, on the working circles.
    thickness = (
        gear.thickness_at(circle) / (math.pi * circle / gear.teeth)
        for gear in (mesh.pinion, mesh.wheel)
        for circle in [gear.base_diameter / math.cos(angle)]
    )
    return {
        **mesh_parameters(mesh, **options),
        "internal": mesh.wheel.internal,
        "pressure_angle": angle,
        "pitch_phase": mesh.pitch_phase,
        "tooth_thickness": tuple(thickness),
    }


def coefficient(ratio, stiffness, mass, decrement=False):
    """Return k = 2 beta sqrt(C_s m), N s/m, of a damping ratio beta or a logarithmic decrement."""
    if decrement:
        ratio /= math.hypot(math.tau, ratio)
    return 2.0 * ratio * math.sqrt(stiffness * mass)


def rectangle(mesh, method, **options):
    """Return C_max, kappa and epsilon by a method; see `mesh_stiffness`.

    Those of ISO 6336 without the numerical stack, which a start of the workflow does not load.
    """
    if isinstance(method, str) and method == "iso":
        return iso_rectangle(mesh, **options)
    return tuple(mesh.stiffness(method, **options).ratios().values())


def torque_of(torque, power, speed):
    """Return the torque of the pinion, N m, given itself or by power in W and speed in rpm."""
    if (torque is None) == (power is None) or (power is not None and speed is None):
        raise ValueError(
            f"torque = {torque!r} with power = {power!r} and speed = {speed!r} is not allowed: it "
            "must be either torque, or power and speed"
        )
    if power is None:
        if speed is not None:
            checks.finite_positive("speed", speed)
        return checks.finite_positive("torque", torque)
    turning = math.tau / 60.0 * checks.finite_positive("speed", speed)
    return checks.finite_positive("power", power) / turning
