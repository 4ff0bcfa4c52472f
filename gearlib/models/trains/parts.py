"""Parts of ready-made trains: gears by module and teeth, meshes by a `GearPair`."""

import math
from numbers import Real

from gearlib import checks
from gearlib.models.pair import GearPair
from gearlib.models.trains.elements import Mesh

#: Of supports and shafts, s times their stiffness: choice, as in the trial of speed.
STRUCTURAL_DAMPING = 1e-6
#: In operation, rad.
PRESSURE_ANGLE = math.radians(20.0)


def mesh_of(pair, pinion, wheel, **more):
    """Return a `Mesh` with the values of a `GearPair`."""
    if not isinstance(pair, GearPair):
        raise ValueError(f"pair = {pair!r} is not allowed: it must be a GearPair")
    own = ("max_stiffness", "stiffness_ratio", "contact_ratio", "backlash", "material_damping")
    values = {name: getattr(pair, name) for name in (*own, "backlash_damping")}
    return Mesh(pinion=pinion, wheel=wheel, **(values | more))


def gear(name, teeth, module, pressure_angle, reduced, mass, force):
    """Return the parameters of a `Body`; `force` acts at the base circle."""
    radius = base_radius(teeth, module, pressure_angle)
    inertia = reduced * radius**2
    torque = force * radius
    return dict(
        name=name, teeth=teeth, base_radius=radius, inertia=inertia, mass=mass, torque=torque
    )


def base_radius(teeth, module, pressure_angle):
    """Return the base radius of a gear, m."""
    angle = checked_angle(pressure_angle)
    return checks.finite_positive("module", module) * teeth / 2.0 * math.cos(angle)


def checked_angle(pressure_angle):
    """Return a pressure angle, else raise ValueError."""
    below = math.pi / 2.0
    return checks.number(
        "pressure_angle", pressure_angle, "from 0 to below pi / 2", lambda v: 0.0 <= v < below
    )


def gear_masses(pair, first, second, *others):
    """Return I / r^2 in proportion to z^2, the first two gears with the reduced mass of a pair."""
    if not isinstance(pair, GearPair):
        raise ValueError(f"pair = {pair!r} is not allowed: it must be a GearPair")
    unit = pair.reduced_mass * (1.0 / first**2 + 1.0 / second**2)
    return [unit * z**2 for z in (first, second, *others)]


def support(stiffness, structural_damping):
    """Return the parameters of the support of a `Body`, N/m and N s/m."""
    damping = damping_of(stiffness, structural_damping)
    return dict(support_stiffness=stiffness, support_damping=damping)


def damping_of(stiffness, structural_damping):
    """Return the damping of a stiffness, N s/m; what is none is left to the part that it is for."""
    share = checks.finite_nonnegative("structural_damping", structural_damping)
    return share * stiffness if isinstance(stiffness, Real) and stiffness < math.inf else 0.0


def teeth_of(teeth, count):
    """Return the numbers of teeth of so many gears, else raise ValueError."""
    values = checks.many("teeth", teeth, count)
    return [checks.integer(f"teeth[{i}]", z, 3) for i, z in enumerate(values)]
