"""Trains ready made: planetary, idler, two stages; `reducer` has the paper's.

Where inertias are not given, gears of one stage have I / r^2 in proportion to z^2, as discs of one
width have, in such a way that the first mesh has the reduced mass of the `GearPair`.
"""

import dataclasses
import math

from gearlib import checks
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.parts import (
    PRESSURE_ANGLE,
    STRUCTURAL_DAMPING,
    base_radius,
    checked_angle,
    damping_of,
    gear,
    gear_masses,
    mesh_of,
    support,
    teeth_of,
)
from gearlib.models.trains.train import GearTrain

#: Of the planetary train, rad.
_LIN_PARKER = math.radians(24.6)
#: Of a ring's mesh, rad: teeth jam before.
_STEEPEST = math.radians(45.0)


def planetary(
    *,
    planets=3,
    teeth=(27, 99),
    planet_teeth=None,
    positions=None,
    masses=(0.4, 2.35, 5.43, 0.66),
    reduced_inertias=(0.39, 3.0, 6.29, 0.61),
    sun_base_radius=0.0387,
    pressure_angle=_LIN_PARKER,
    support_stiffness=(1e8, 1e8, 1e8, 1e8),
    torsional_stiffness=(0.0, 1e9, 0.0),
    structural_damping=STRUCTURAL_DAMPING,
    mean_stiffness=(5e8, 5e8),
    stiffness_ratio=(1.0, 1.0),
    contact_ratio=(1.4, 1.6),
    material_damping=1000.0,
    backlash_damping=300.0,
    backlash=30e-6,
    load=2000.0,
    ring_phase=None,
    pin_errors=None,
    turning=False,
    driving="sun",
    gyroscopic=False,
    **options,
):
    """Return a planetary train: sun, ring, carrier and planets, by default of Lin and Parker.

    J. Vib. Acoust. 121 (1999) 316-321, where the mesh data beside the mean stiffness are choices.
    Bodies are called ``sun``, ``ring``, ``carrier``, ``planet 1``, ..., meshes ``sun 1``, ...,
    ``ring 1``, .... The sun's torque is counterclockwise.

    Parameters
    ----------
    planets : int, default 3
    teeth : pair of int, default (27, 99)
        Of sun and ring.
    planet_teeth : int, optional
        By default half the difference of the others.
    positions : sequence of float, optional
        Angles of the planets, rad; equally spaced by default.
    masses, reduced_inertias : 4 floats
        Of sun, ring, carrier and one planet, kg; the latter are I / r^2, r being the base radius,
        of the carrier the centre distance.
    sun_base_radius : float
        m; those of ring and planets follow from the teeth.
    pressure_angle : float
        Of the sun's meshes in operation, rad; that of the ring's meshes follows.
    support_stiffness : 4 floats
        Of sun, ring, carrier and planets (on the carrier), N/m; infinity: rigid.
    torsional_stiffness : 3 floats
        Of the supports of sun, ring and carrier, at their radius, N/m; infinity: fixed.
    structural_damping : float
        Damping of all supports over their stiffness, s.
    mean_stiffness, stiffness_ratio, contact_ratio : pairs of float
        Of the meshes of sun and ring; N/m.
    material_damping, backlash_damping, backlash
        As of a `Mesh`, of all meshes.
    load : float
        On every sun mesh, N. The torques of ring and carrier, where they can turn freely, are
        those in balance with it.
    ring_phase : float, optional
        Phase of the first ring mesh; by default from the teeth of the planets.
    pin_errors : sequence of pair of float, optional
        By how much the pins are misplaced, radial and tangential, m.
    turning : bool, default False
        Whether the frame turns with the carrier, the ring standing still: decides `speed` in rpm.
    driving : {"sun", "ring"}, default "sun"
        Which of them drives, seen from the carrier; "ring" also where the carrier drives the sun.
        So the sun turns as its torque has it, or against it.
    gyroscopic : bool, default False
        Whether axes that can move feel it, by Coriolis and centrifugal forces.
    **options
        Of `GearTrain`.

    Raises
    ------
    ValueError
        If a value is impossible or the planets do not fit between sun and ring.
    """
    n = checks.integer("planets", planets, 1)
    sun, ring = (
        checks.integer(f"teeth[{i}]", z, 3) for i, z in enumerate(checks.many("teeth", teeth, 2))
    )
    if planet_teeth is None:
        if ring <= sun or (ring - sun) % 2:
            raise ValueError(
                f"teeth = {teeth!r} is not allowed: the ring must have an even number of teeth "
                "more than the sun, unless planet_teeth is given"
            )
        planet_teeth = (ring - sun) // 2
    planet_teeth = checks.integer("planet_teeth", planet_teeth, 3, ring - 1)
    if positions is None:
        if (sun + ring) % n:
            raise ValueError(
                f"planets = {n!r} is not allowed: (z_s + z_r) / N = ({sun} + {ring}) / {n} must be "
                "an integer for equal spacing"
            )
        positions = [2.0 * math.pi * i / n for i in range(n)]
    positions = checks.numbers("positions", positions, n)
    if ring_phase is not None:
        checks.number("ring_phase", ring_phase, "finite", math.isfinite)
    errors = checks.many("pin_errors", pin_errors or [(0.0, 0.0)] * n, n)
    r_sun = checks.finite_positive("sun_base_radius", sun_base_radius)
    pressure_angle = checked_angle(pressure_angle)
    r_planet, r_ring = r_sun * planet_teeth / sun, r_sun * ring / sun
    centre = (r_sun + r_planet) / math.cos(pressure_angle)
    cosine = (r_ring - r_planet) / centre
    if not math.cos(_STEEPEST) <= cosine <= 1.0:
        raise ValueError(
            f"planet_teeth = {planet_teeth!r} is not allowed: at this pressure_angle the planets "
            "must fit into the ring, where the pressure angle must be from 0 to 45 degrees"
        )
    ring_angle = pressure_angle if planet_teeth * 2 == ring - sun else math.acos(cosine)
    radii = (r_sun, r_ring, centre, r_planet)
    masses, reduced = (
        checks.numbers("masses", masses, 4),
        checks.numbers("reduced_inertias", reduced_inertias, 4),
    )
    supports = checks.numbers("support_stiffness", support_stiffness, 4)
    twists = (*checks.numbers("torsional_stiffness", torsional_stiffness, 3), 0.0)
    torque = n * checks.number("load", load, "finite", math.isfinite) * r_sun
    torques = [torque, torque * ring / sun, -torque * (1.0 + ring / sun), 0.0]

    def body(i, name, z, **more):
        # A support takes the torque itself.
        stands = i in (1, 2) and twists[i] > 0.0
        return Body(
            name=name,
            teeth=z,
            mass=masses[i],
            inertia=reduced[i] * radii[i] ** 2,
            base_radius=radii[i],
            torque=0.0 if stands else torques[i],
            **support(supports[i], structural_damping),
            torsional_stiffness=twists[i] * radii[i] ** 2,
            torsional_damping=damping_of(twists[i], structural_damping) * radii[i] ** 2,
            **more,
        )

    bodies = [body(0, "sun", sun), body(1, "ring", ring), body(2, "carrier", None)]
    meshes = []
    stiffness = checks.numbers("mean_stiffness", mean_stiffness, 2)
    kappa = checks.numbers("stiffness_ratio", stiffness_ratio, 2)
    epsilon = checks.numbers("contact_ratio", contact_ratio, 2)
    common = dict(
        material_damping=material_damping, backlash_damping=backlash_damping, backlash=backlash
    )
    for i, psi in enumerate(positions):
        planet = f"planet {i + 1}"
        carried = body(3, planet, planet_teeth, carrier="carrier", angle=psi, offset=errors[i])
        bodies.append(carried)
        for k, (central, angle) in enumerate((("sun", pressure_angle), ("ring", ring_angle))):
            mean = kappa[k] + (1.0 - kappa[k]) * (epsilon[k] - 1.0)
            phase = None
            if k and ring_phase is not None:
                phase = ring_phase - ring * (psi - positions[0]) / (2.0 * math.pi)
            meshes.append(
                Mesh(
                    name=f"{central} {i + 1}",
                    pinion=planet if k else central,
                    wheel=central if k else planet,
                    internal=bool(k),
                    position=psi,
                    pressure_angle=angle,
                    max_stiffness=stiffness[k] / mean,
                    stiffness_ratio=kappa[k],
                    contact_ratio=epsilon[k],
                    phase=phase,
                    **common,
                )
            )
    meshes.sort(key=lambda mesh: mesh.internal)
    checks.one_of("turning", turning, (False, True))
    if checks.one_of("driving", driving, ("sun", "ring")) == "ring":
        meshes = [dataclasses.replace(mesh, driving=mesh.wheel) for mesh in meshes]
    return GearTrain(
        bodies=bodies,
        meshes=meshes,
        carrier_ratio=sun / ring if turning else 0.0,
        gyroscopic=gyroscopic,
        **options,
    )


def idler(
    pair,
    *,
    teeth=(24, 24, 24),
    angle=math.pi,
    module=0.004,
    reduced_inertias=None,
    masses=None,
    support_stiffness=math.inf,
    structural_damping=STRUCTURAL_DAMPING,
    pressure_angle=PRESSURE_ANGLE,
    **options,
):
    """Return a train of three gears in a row, ``pinion``, ``idler``, ``wheel``, with two meshes.

    Parameters
    ----------
    pair : GearPair
        Stiffness, damping, backlash and load of both meshes; its reduced mass is that of the first.
    teeth : 3 ints
    angle : float, default pi
        Between both lines of centres at the idler, rad; pi: in a row.
    module : float
        m.
    reduced_inertias : 3 floats, optional
        I / r^2, kg; by default in proportion to z^2.
    masses : 3 floats, optional
        kg; by default twice the reduced inertias, as of discs.
    support_stiffness : float, default infinite
        Of all axes, N/m.
    structural_damping : float
        Of the supports over their stiffness, s.
    pressure_angle : float
        rad.
    **options
        Of `GearTrain`.
    """
    z = teeth_of(teeth, 3)
    reduced = checks.numbers("reduced_inertias", reduced_inertias or gear_masses(pair, *z), 3)
    masses = checks.numbers("masses", masses or [2.0 * value for value in reduced], 3)
    force, angle = pair.load, checks.number("angle", angle, "finite", math.isfinite)
    bodies = [
        gear(name, z[i], module, pressure_angle, reduced[i], masses[i], sign * force)
        | support(support_stiffness, structural_damping)
        for i, (name, sign) in enumerate((("pinion", 1.0), ("idler", 0.0), ("wheel", -1.0)))
    ]
    # From the wheel's side of the idler the drive flanks are the other ones.
    meshes = [
        mesh_of(pair, "pinion", "idler", position=0.0, pressure_angle=pressure_angle),
        mesh_of(
            pair,
            "idler",
            "wheel",
            position=math.pi + angle,
            direction=-1,
            pressure_angle=pressure_angle,
        ),
    ]
    return GearTrain(bodies=[Body(**body) for body in bodies], meshes=meshes, **options)


def two_stage(
    pair,
    *,
    teeth=(24, 36, 24, 36),
    modules=(0.004, 0.004),
    shaft_stiffness=1e6,
    reduced_inertias=None,
    masses=None,
    support_stiffness=math.inf,
    structural_damping=STRUCTURAL_DAMPING,
    pressure_angle=PRESSURE_ANGLE,
    **options,
):
    """Return two stages, ``pinion 1`` and ``wheel 1``, ``pinion 2`` and ``wheel 2``, with a shaft.

    Parameters as of `idler`, with 4 gears, a module for each stage, and

    Parameters
    ----------
    shaft_stiffness : float
        Of the shaft against torsion, N m/rad.
    """
    z = teeth_of(teeth, 4)
    reduced = reduced_inertias or [*gear_masses(pair, *z[:2]), *gear_masses(pair, *z[2:])]
    reduced = checks.numbers("reduced_inertias", reduced, 4)
    masses = checks.numbers("masses", masses or [2.0 * value for value in reduced], 4)
    sizes = [checks.numbers("modules", modules, 2)[i // 2] for i in range(4)]
    radii = [base_radius(z[i], sizes[i], pressure_angle) for i in range(4)]
    names = ("pinion 1", "wheel 1", "pinion 2", "wheel 2")
    # The shaft turns clockwise, and the second wheel counterclockwise against its load.
    forces = (pair.load, 0.0, 0.0, -pair.load * radii[1] / radii[2])
    bodies = [
        gear(names[i], z[i], sizes[i], pressure_angle, reduced[i], masses[i], forces[i])
        | support(support_stiffness, structural_damping)
        for i in range(4)
    ]
    meshes = [
        mesh_of(pair, *names[:2], position=0.0, pressure_angle=pressure_angle),
        mesh_of(pair, *names[2:], position=0.0, direction=-1, pressure_angle=pressure_angle),
    ]
    shaft = Shaft(
        bodies=names[1:3],
        stiffness=shaft_stiffness,
        damping=damping_of(shaft_stiffness, structural_damping),
    )
    return GearTrain(
        bodies=[Body(**body) for body in bodies], meshes=meshes, shafts=[shaft], **options
    )
