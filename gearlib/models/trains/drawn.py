"""A planetary train by the drawing of its gears."""

import dataclasses
import math

from gearlib import checks
from gearlib.models.geometry.planets import planets_of
from gearlib.models.trains.parts import STRUCTURAL_DAMPING
from gearlib.models.trains.ready_made import planetary


def planetary_set(
    sun,
    planet,
    ring,
    *,
    torque,
    planets=3,
    positions=None,
    centre_distance=None,
    backlashes=None,
    carrier_mass=None,
    carrier_inertia=None,
    support_stiffness=(math.inf,) * 4,
    torsional_stiffness=(0.0, math.inf, 0.0),
    structural_damping=STRUCTURAL_DAMPING,
    damping_ratio=None,
    logarithmic_decrement=None,
    material_damping=None,
    backlash_damping_ratio=0.0,
    stiffness="iso",
    options=None,
    pin_errors=None,
    turning=True,
    driving="sun",
    gyroscopic=False,
    **more,
):
    """Return the `GearTrain` of a drawn sun, planets and ring.

    Stiffness, contact ratios, backlash, inertias, pressure angles and phases are those of the
    drawing; bodies and meshes have the names that `gearlib.planetary` gives them.

    Parameters
    ----------
    sun, planet, ring : SpurGear
        The ring with `outer_diameter`.
    torque : float
        Of the sun, N m; finite, > 0. Those of ring and carrier, where they turn, balance it.
    planets : int, default 3
    positions : sequence of float, optional
        Angles of the planets, rad; equally spaced by default.
    centre_distance : float, optional
        m; by default that of sun and planet without backlash.
    backlashes : pair of float, optional
        Normal backlash of the meshes of sun and ring, m; by default what the gears leave.
    carrier_mass, carrier_inertia : float, optional
        kg and kg m^2, without planets; by default of a disc of the planet's material through the
        pins, as wide as the planet.
    support_stiffness : 4 floats
        Of sun, ring, carrier and planets (on the carrier), N/m; rigid by default.
    torsional_stiffness : 3 floats
        Of the supports of sun, ring and carrier at their radius, N/m; by default the ring is fixed.
    structural_damping : float
        Damping of all supports over their stiffness, s.
    damping_ratio, logarithmic_decrement, material_damping, backlash_damping_ratio : float, optional
        Of all meshes, as of `gearlib.Mesh.from_geometry`.
    stiffness, options
        Likewise.
    pin_errors : sequence of pair of float, optional
        By how much the pins are misplaced, radial and tangential, m.
    turning : bool, default True
        Whether the carrier turns and the ring stands still: decides the speed in rpm.
    driving : {"sun", "ring"}, default "sun"
        As of `gearlib.planetary`.
    gyroscopic : bool, default False
        Whether axes that can move feel that.
    **more
        Of `GearTrain`.

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
    torque = checks.finite_positive("torque", torque)
    centre = drawn.sun_mesh.centre_distance
    disc = math.pi * centre**2 * planet.width * planet.material.density
    mass = disc if carrier_mass is None else carrier_mass
    inertia = disc * centre**2 / 2.0 if carrier_inertia is None else carrier_inertia
    inertia = checks.finite_positive("carrier_inertia", inertia)
    gears = (sun, ring, planet)
    reduced = [gear.inertia / (gear.base_diameter / 2.0) ** 2 for gear in gears]
    reduced.insert(2, inertia / centre**2)
    # On each pinion: of the sun its share, of a planet the same force at its own base circle.
    share = torque / n
    torques = share, share * planet.teeth / sun.teeth
    damping = {
        "damping_ratio": damping_ratio,
        "logarithmic_decrement": logarithmic_decrement,
        "material_damping": material_damping,
        "backlash_damping_ratio": backlash_damping_ratio,
    }
    flanks = [
        mesh.train_parameters(torque=one, stiffness=stiffness, options=options, **damping)
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
        support_stiffness=checks.numbers("support_stiffness", support_stiffness, 4),
        torsional_stiffness=checks.numbers("torsional_stiffness", torsional_stiffness, 3),
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
