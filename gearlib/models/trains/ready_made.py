"""Trains ready made: planetary, idler, two stages; `reducer` has the paper's.

Where inertias are not given, gears of one stage have I / r^2 in proportion to z^2, as discs of one
width have, in such a way that the first mesh has the reduced mass of the `GearPair`.
"""

import dataclasses
import math
from typing import Annotated

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.geometry.drawings import equal_positions
from gearlib.models.trains import parts
from gearlib.models.trains.elements import Body, Mesh
from gearlib.parameters import (
    ANGLE,
    CONTACT_RATIO,
    FINITE,
    FORCE,
    LENGTH,
    MASS,
    MODULE,
    STIFFNESS,
    STIFFNESS_RATIO,
    TEETH,
    WORKING_ANGLE,
    Backlash,
    BacklashDamping,
    Integer,
    Many,
    MaterialDamping,
    PressureAngle,
    checked,
)

#: Of the planetary train, rad.
_LIN_PARKER = math.radians(24.6)
_MASSES, _STIFFNESSES = (0.4, 2.35, 5.43, 0.66), (5e8, 5e8)
#: Of a ring's mesh, rad: teeth jam before.
_STEEPEST = math.radians(45.0)


@checked
def planetary(
    *,
    planets: Annotated[int, Integer(1, limit=100), "Number of planets"] = 3,
    teeth: Annotated[tuple, Many(TEETH, 2), "Of sun and ring"] = (27, 99),
    planet_teeth: Annotated[
        int | None, TEETH, "Of a planet; by default half the difference of the others"
    ] = None,
    positions: Annotated[
        tuple | None, Many(ANGLE), "Angles of the planets; equally spaced by default"
    ] = None,
    masses: Annotated[tuple, Many(MASS, 4), "Of sun, ring, carrier and one planet"] = _MASSES,
    reduced_inertias: Annotated[
        tuple, Many(MASS, 4), "I / r^2 of the same; r: base radius, of the carrier that of the pins"
    ] = (0.39, 3.0, 6.29, 0.61),
    sun_base_radius: Annotated[
        float, LENGTH, "Of the sun; those of ring and planets follow from the teeth"
    ] = 0.0387,
    pressure_angle: Annotated[
        float, WORKING_ANGLE, "Of the sun's meshes in operation; that of the ring's follows"
    ] = _LIN_PARKER,
    support_stiffness: parts.SetSupports = (1e8, 1e8, 1e8, 1e8),
    torsional_stiffness: parts.SetTwists = (0.0, 1e9, 0.0),
    structural_damping: parts.StructuralDamping = parts.STRUCTURAL_DAMPING,
    mean_stiffness: Annotated[
        tuple, Many(STIFFNESS, 2), "Of the meshes of sun and ring"
    ] = _STIFFNESSES,
    stiffness_ratio: Annotated[tuple, Many(STIFFNESS_RATIO, 2), "Of the same, kappa"] = (1.0, 1.0),
    contact_ratio: Annotated[tuple, Many(CONTACT_RATIO, 2), "Of the same, epsilon"] = (1.4, 1.6),
    material_damping: MaterialDamping = 1000.0,
    backlash_damping: BacklashDamping = 300.0,
    backlash: Backlash = 30e-6,
    load: Annotated[float, FORCE, "On every mesh of the sun"] = 2000.0,
    ring_phase: Annotated[
        float | None, FINITE, "Phase of the first ring mesh; by default from the planets' teeth"
    ] = None,
    pin_errors: parts.PinErrors = None,
    turning: parts.Turning = False,
    driving: parts.Driving = "sun",
    gyroscopic: parts.Gyroscopic = False,
    **options,
):
    """Return a planetary train: sun, ring, carrier and planets, by default of Lin and Parker.

    J. Vib. Acoust. 121 (1999) 316-321, where the mesh data beside the mean stiffness are choices.
    Bodies are called ``sun``, ``ring``, ``carrier``, ``planet 1``, ..., meshes ``sun 1``, ...,
    ``ring 1``, .... The sun's torque is counterclockwise; those of ring and carrier, where they can
    turn freely, are in balance with it. Other options are those of `GearTrain`.

    Raises
    ------
    ValueError
        If a value is impossible or the planets do not fit between sun and ring.
    """
    n, (sun, ring) = planets, teeth
    if planet_teeth is None:
        if ring <= sun or (ring - sun) % 2:
            raise ValueError(
                f"teeth = {teeth!r} is not allowed: the ring must have an even number of teeth "
                "more than the sun, unless planet_teeth is given"
            )
        planet_teeth = (ring - sun) // 2
    planet_teeth = checks.integer("planet_teeth", planet_teeth, 3, ring - 1)
    positions = equal_positions(sun, ring, n) if positions is None else positions
    positions = checks.numbers("positions", positions, n)
    if ring_phase is not None:
        checks.number("ring_phase", ring_phase, "finite", math.isfinite)
    errors = checks.many("pin_errors", pin_errors or [(0.0, 0.0)] * n, n)
    r_sun = sun_base_radius
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
    twists = (*torsional_stiffness, 0.0)
    torque = n * load * r_sun
    torques = [torque, torque * ring / sun, -torque * (1.0 + ring / sun), 0.0]

    def body(i, name, z, **more):
        # A support takes the torque itself.
        stands = i in (1, 2) and twists[i] > 0.0
        return Body(
            name=name,
            teeth=z,
            mass=masses[i],
            inertia=reduced_inertias[i] * radii[i] ** 2,
            base_radius=radii[i],
            torque=0.0 if stands else torques[i],
            **parts.support(support_stiffness[i], structural_damping),
            torsional_stiffness=twists[i] * radii[i] ** 2,
            torsional_damping=parts.damping_of(twists[i], structural_damping) * radii[i] ** 2,
            **more,
        )

    bodies = [body(0, "sun", sun), body(1, "ring", ring), body(2, "carrier", None)]
    meshes = []
    kappa, epsilon = stiffness_ratio, contact_ratio
    common = dict(
        material_damping=material_damping, backlash_damping=backlash_damping, backlash=backlash
    )
    for i, psi in enumerate(positions):
        planet = f"planet {i + 1}"
        carried = body(3, planet, planet_teeth, carrier="carrier", angle=psi, offset=errors[i])
        bodies.append(carried)
        for k, (central, angle) in enumerate((("sun", pressure_angle), ("ring", ring_angle))):
            mean = mean_over_max(epsilon[k], kappa[k])
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
                    max_stiffness=mean_stiffness[k] / mean,
                    stiffness_ratio=kappa[k],
                    contact_ratio=epsilon[k],
                    phase=phase,
                    **common,
                )
            )
    meshes.sort(key=lambda mesh: mesh.internal)
    if driving == "ring":
        meshes = [dataclasses.replace(mesh, driving=mesh.wheel) for mesh in meshes]
    return parts.train_of(
        bodies=bodies,
        meshes=meshes,
        carrier_ratio=sun / ring if turning else 0.0,
        gyroscopic=gyroscopic,
        **options,
    )


@checked
def idler(
    pair,
    *,
    teeth: Annotated[tuple, Many(TEETH, 3), "Of pinion, idler and wheel"] = (24, 24, 24),
    angle: Annotated[
        float, ANGLE, "Between both lines of centres at the idler; pi: in a row"
    ] = math.pi,
    module: Annotated[float, MODULE, "Of all gears"] = 0.004,
    reduced_inertias: parts.ThreeReduced = None,
    masses: parts.ThreeMasses = None,
    support_stiffness: parts.AxisStiffness = math.inf,
    structural_damping: parts.StructuralDamping = parts.STRUCTURAL_DAMPING,
    pressure_angle: PressureAngle = parts.PRESSURE_ANGLE,
    **options,
):
    """Return a train of three gears in a row, ``pinion``, ``idler``, ``wheel``, with two meshes.

    `pair`, a `GearPair`, gives stiffness, damping, backlash and load of both meshes; its reduced
    mass is that of the first. Other options are those of `GearTrain`.
    """
    pair = parts.pair_of(pair)
    reduced = reduced_inertias or parts.gear_masses(pair, *teeth)
    bearing = support_stiffness, structural_damping
    gears = parts.Gears(pair, teeth, [module] * 3, pressure_angle, reduced, masses, bearing)
    bodies = [
        gears.body(0, "pinion", pair.load),
        gears.body(1, "idler"),
        gears.body(2, "wheel", -pair.load),
    ]
    # From the wheel's side of the idler the drive flanks are the other ones.
    meshes = [
        gears.mesh("pinion", "idler", position=0.0),
        gears.mesh("idler", "wheel", position=math.pi + angle, direction=-1),
    ]
    return parts.train_of(bodies=bodies, meshes=meshes, **options)


@checked
def two_stage(
    pair,
    *,
    teeth: Annotated[tuple, Many(TEETH, 4), "Of both gears of each stage"] = (24, 36, 24, 36),
    modules: parts.Modules = (0.004, 0.004),
    shaft_stiffness: parts.ShaftStiffness = 1e6,
    reduced_inertias: parts.FourReduced = None,
    masses: parts.FourMasses = None,
    support_stiffness: parts.AxisStiffness = math.inf,
    structural_damping: parts.StructuralDamping = parts.STRUCTURAL_DAMPING,
    pressure_angle: PressureAngle = parts.PRESSURE_ANGLE,
    **options,
):
    """Return two stages, ``pinion 1`` and ``wheel 1``, ``pinion 2`` and ``wheel 2``, with a shaft.

    `pair` as of `idler`: I / r^2 of each stage follows from it. Other options are those of
    `GearTrain`.
    """
    z, pair = teeth, parts.pair_of(pair)
    stages = parts.gear_masses(pair, *z[:2]) + parts.gear_masses(pair, *z[2:])
    sizes, bearing = [modules[i // 2] for i in range(4)], (support_stiffness, structural_damping)
    gears = parts.Gears(pair, z, sizes, pressure_angle, reduced_inertias or stages, masses, bearing)
    # The shaft turns clockwise, and the second wheel counterclockwise against its load.
    out = -pair.load * gears.radii[1] / gears.radii[2]
    bodies = [
        gears.body(0, "pinion 1", pair.load),
        gears.body(1, "wheel 1"),
        gears.body(2, "pinion 2"),
        gears.body(3, "wheel 2", out),
    ]
    meshes = [
        gears.mesh("pinion 1", "wheel 1", position=0.0),
        gears.mesh("pinion 2", "wheel 2", position=0.0, direction=-1),
    ]
    shaft = parts.shaft_of(("wheel 1", "pinion 2"), shaft_stiffness, structural_damping)
    return parts.train_of(bodies=bodies, meshes=meshes, shafts=[shaft], **options)
