"""From a drawn mesh, its load and damping to parameters of a `GearPair` or of a mesh of a train."""

import math

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.geometry.iso import iso_rectangle

#: Largest static deflection, in modules: a hardened tooth breaks at about 0.02, plastic at 0.1.
MAX_DEFLECTION = 0.1


def pair_parameters(mesh, *, torque=None, power=None, speed=None, **options):
    """Return the parameters of a `GearPair` as a dict; see `GearPair.from_geometry`."""
    stated = ("torque", torque, "N m") if power is None else ("power", power, "W")
    torque = torque_of(torque, power, speed)
    parameters = {
        **mesh_parameters(mesh, torque=torque, **options),
        "reduced_mass": mesh.reduced_mass,
        "load": mesh.load(torque),
        "teeth": mesh.pinion.teeth,
    }
    mean = _check_deflection(mesh, torque, parameters, *stated)
    if speed is not None:
        resonance = math.sqrt(mean / mesh.reduced_mass) * 60.0 / (math.tau * mesh.pinion.teeth)
        checks.speed("speed", speed, resonance)
    return parameters


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
    options = {"torque": torque, **checks.options(options)}
    # Those of ISO 6336 without the numerical stack, which a start of the workflow does not load.
    if isinstance(stiffness, str) and stiffness == "iso":
        high, kappa, epsilon = iso_rectangle(mesh, **options)
    else:
        high, kappa, epsilon = mesh.stiffness(stiffness, **options).ratios().values()
    mean = high * mean_over_max(epsilon, kappa)
    names = "damping_ratio", "logarithmic_decrement", "material_damping"
    values = damping_ratio, logarithmic_decrement, material_damping
    dampings = [x for x in zip(names, values, strict=True) if x[1] is not None]
    if len(dampings) > 1:
        together = " and ".join(name for name, _ in dampings)
        raise ValueError(f"{together} are not allowed together: it must be one of them at most")
    damping = drawn_damping(*dampings[0], mean, mesh.reduced_mass) if dampings else None
    oil = "backlash_damping_ratio", backlash_damping_ratio
    return {
        "max_stiffness": high,
        "stiffness_ratio": kappa,
        "contact_ratio": epsilon,
        "backlash": mesh.line_backlash,
        "material_damping": damping,
        "backlash_damping": drawn_damping(*oil, mean, mesh.reduced_mass),
    }


def _check_deflection(mesh, torque, parameters, name, value, unit):
    """Refuse a load that deflects the teeth too far; return the mean stiffness of parameters."""
    ratios = parameters["contact_ratio"], parameters["stiffness_ratio"]
    mean = parameters["max_stiffness"] * mean_over_max(*ratios)
    share = abs(mesh.load(torque)) / mean / (MAX_DEFLECTION * mesh.pinion.module)
    most = f"at most {abs(value) / (share or 1.0):.4g} {unit}"
    words = f"{most}, at which the static deflection is {MAX_DEFLECTION:g} modules"
    checks.require(share <= 1.0, name, value, words)
    return mean


def drawn_damping(name, value, stiffness, mass):
    """Return the coefficient, N s/m, of a damping by its name; its damping ratio is below 1."""
    critical = coefficient(1.0, stiffness, mass)
    if name in ("material_damping", "backlash_damping"):
        words = f"a finite number >= 0 and < {critical:.4g} N s/m, a damping ratio of 1"
        return checks.number(name, value, words, lambda v: 0.0 <= v < critical)
    if name == "logarithmic_decrement":
        return coefficient(checks.finite_nonnegative(name, value), stiffness, mass, decrement=True)
    words = "a finite number >= 0 and < 1"
    return checks.number(name, value, words, lambda v: 0.0 <= v < 1.0) * critical


def train_parameters(mesh, *, torque=None, stated=None, **options):
    """Return the parameters of a `gearlib.Mesh` as a dict; see `gearlib.Mesh.from_geometry`.

    `stated` is what the user gave in place of the torque: name, value, unit.
    """
    parameters = mesh_parameters(mesh, torque=torque, **options)
    if torque is not None:
        _check_deflection(mesh, torque, parameters, *(stated or ("torque", torque, "N m")))
    angle = mesh.working_pressure_angle
    # Tooth thickness over the pitch, on the working circles.
    gears = mesh.pinion, mesh.wheel
    circles = [(gear, gear.base_diameter / math.cos(angle)) for gear in gears]
    thickness = tuple(x.thickness_at(d) / (math.pi * d / x.teeth) for x, d in circles)
    of_mesh = {"internal": mesh.wheel.internal, "pressure_angle": angle}
    return parameters | of_mesh | {"pitch_phase": mesh.pitch_phase, "tooth_thickness": thickness}


def coefficient(ratio, stiffness, mass, decrement=False):
    """Return k = 2 beta sqrt(C_s m), N s/m, of a damping ratio beta or a logarithmic decrement."""
    if decrement:
        ratio /= math.hypot(math.tau, ratio)
    return 2.0 * ratio * math.sqrt(stiffness * mass)


def bodies(mesh):
    """Return what a `SixDegreePair` takes of a drawing as a dict; see its `from_geometry`."""
    gears = mesh.pinion, mesh.wheel
    return {
        "base_radii": [gear.base_diameter / 2.0 for gear in gears],
        "inertias": [gear.inertia for gear in gears],
        "masses": [gear.mass for gear in gears],
        "teeth": [gear.teeth for gear in gears],
        "pitch_phase": mesh.pitch_phase,
    }


def torque_of(torque, power, speed):
    """Return the torque of the pinion, N m, from itself or from power in W and speed in rpm."""
    if torque is not None and power is not None:
        raise ValueError("torque and power are not allowed together: it must be one of them")
    if torque is None and power is None:
        raise ValueError("torque is missing: it must be given in N m, or power and speed")
    if power is not None and speed is None:
        raise ValueError("speed is missing: it must be given in rpm, where power is given")
    if speed is not None:
        speed = checks.finite_positive("speed", speed)
    if power is None:
        return checks.finite_positive("torque", torque)
    return checks.finite_positive("power", power) / (math.tau / 60.0 * speed)
