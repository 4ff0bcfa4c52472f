"""A planetary train by the drawing of its gears."""

import dataclasses
import math
from typing import Annotated

from gearlib import parameters
from gearlib.models.geometry.drawings import planets_of
from gearlib.models.trains import parts
from gearlib.models.trains.ready_made import planetary


@parameters.checked
def planetary_set(
    sun,
    planet,
    ring,
    *,
    torque: Annotated[
        float,
        parameters.DRIVING_TORQUE,
        "Of the sun; those of ring and carrier, where they turn, balance it",
    ],
    planets: Annotated[int, parameters.Integer(1, limit=100), "Number of planets"] = 3,
    positions: Annotated[
        tuple | None,
        parameters.Many(parameters.ANGLE),
        "Angles of the planets; equally spaced by default",
    ] = None,
    centre_distance: Annotated[
        float | None, parameters.DIAMETER, "; by default that of sun and planet without backlash"
    ] = None,
    backlashes: Annotated[
        tuple | None,
        parameters.Many(parameters.RUN_OUT, 2),
        "Normal backlash of the meshes of sun and ring; by default what the gears leave",
    ] = None,
    carrier_mass: Annotated[
        float | None, parameters.MASS, "Without planets; by default of a disc, see the inertia"
    ] = None,
    carrier_inertia: Annotated[
        float | None,
        parameters.INERTIA,
        "Without planets; by default of a disc of the planet's material through the pins, as wide "
        "as the planet",
    ] = None,
    support_stiffness: parts.SetSupports = (math.inf,) * 4,
    torsional_stiffness: parts.SetTwists = (0.0, math.inf, 0.0),
    structural_damping: parts.StructuralDamping = parts.STRUCTURAL_DAMPING,
    damping_ratio: parameters.DampingRatio = None,
    logarithmic_decrement: parameters.Decrement = None,
    material_damping: parameters.DrawnDamping = None,
    backlash_damping_ratio: parameters.BacklashDampingRatio = 0.0,
    stiffness="iso",
    options=None,
    pin_errors: parts.PinErrors = None,
    turning: parts.Turning = True,
    driving: parts.Driving = "sun",
    gyroscopic: parts.Gyroscopic = False,
    **more,
):
    """Return the `GearTrain` of a drawn sun, planets and ring, each a `gearlib.geometry.SpurGear`.

    Stiffness, contact ratios, backlash, inertias, pressure angles and phases are those of the
    drawing, the ring's with its `outer_diameter`; bodies and meshes have the names that
    `gearlib.planetary` gives them. `stiffness`, `options` and the damping, which only motions need,
    are as of `gearlib.Mesh.from_geometry`, others of `GearTrain`.

    Raises
    ------
    ValueError
        If gears do not mesh, planets cannot be assembled or strike each other, or a value is
        impossible.
    """
    drawn = planets_of(
        sun,
        planet,
        ring,
        planets=planets,
        positions=positions,
        centre_distance=centre_distance,
        backlashes=backlashes,
    )
    n = len(drawn.positions)
    centre = drawn.sun_mesh.centre_distance
    disc = math.pi * centre**2 * planet.width * planet.material.density
    mass = disc if carrier_mass is None else carrier_mass
    inertia = disc * centre**2 / 2.0 if carrier_inertia is None else carrier_inertia
    gears = (sun, ring, planet)
    reduced = [gear.inertia / (gear.base_diameter / 2.0) ** 2 for gear in gears]
    reduced.insert(2, inertia / centre**2)
    # On each pinion: of the sun its share, of a planet the same force at its own base circle.
    share = torque / n
    torques = share, share * planet.teeth / sun.teeth
    stated = {"stated": ("torque", torque, "N m")}
    damping = {
        "damping_ratio": damping_ratio,
        "logarithmic_decrement": logarithmic_decrement,
        "material_damping": material_damping,
        "backlash_damping_ratio": backlash_damping_ratio,
    }
    flanks = [
        mesh.train_parameters(torque=one, stiffness=stiffness, options=options, **damping, **stated)
        for mesh, one in zip((drawn.sun_mesh, drawn.ring_mesh), torques, strict=True)
    ]
    train = planetary(
        planets=n,
        teeth=(sun.teeth, ring.teeth),
        planet_teeth=planet.teeth,
        positions=list(drawn.positions),
        masses=(sun.mass, ring.mass, mass, planet.mass),
        reduced_inertias=reduced,
        sun_base_radius=sun.base_diameter / 2.0,
        pressure_angle=drawn.sun_mesh.working_pressure_angle,
        support_stiffness=support_stiffness,
        torsional_stiffness=torsional_stiffness,
        structural_damping=structural_damping,
        load=share / (sun.base_diameter / 2.0),
        pin_errors=pin_errors,
        turning=turning,
        driving=driving,
        gyroscopic=gyroscopic,
        **more,
    )
    meshes = [dataclasses.replace(mesh, **flanks[mesh.internal]) for mesh in train.meshes]
    return dataclasses.replace(train, meshes=tuple(meshes))
