"""Planetary trains, from numbers or from gear geometries."""

import dataclasses
import math
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.geometry.from_values import equal_positions, planetary_meshes
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.models.trains.elements import Body, Mesh, Shaft
from gearlib.models.trains.ready_made import (
    STRUCTURAL_DAMPING,
    PinErrors,
    StructuralDamping,
    create_train,
    proportional_damping,
)
from gearlib.parameters import (
    CHOICE,
    INTEGER,
    Angle,
    Backlash,
    BacklashDamping,
    BacklashDampingRatio,
    Boolean,
    ContactDamping,
    ContactRatio,
    DampingRatio,
    Decrement,
    Diameter,
    Finite,
    Force,
    Inertia,
    Length,
    Mass,
    MaterialDamping,
    RunOut,
    ShaftStiffness,
    Stiffness,
    StiffnessRatio,
    Support,
    Teeth,
    Text,
    Torque,
    Values,
    WorkingAngle,
    checked,
    declared,
    described,
)

#: Largest pressure angle of a ring mesh, rad.
_MAX_RING_ANGLE = math.radians(45.0)
_PRESSURE_ANGLE = math.radians(24.6)

Planets = Annotated[int, Ge(1), Le(100), INTEGER, described("Number of planets")]
Positions = Annotated[
    tuple[Angle, ...] | None,
    Values(),
    described("Angles of the planets; equally spaced by default"),
]
Supports = Annotated[
    tuple[Support, ...],
    Values(4),
    described("Stiffness of the supports of sun, ring, carrier and planets"),
]
Twists = Annotated[
    tuple[Support, ...],
    Values(3),
    described("Tangential stiffness of the supports of sun, ring and carrier at their base radius"),
]
Turning = Annotated[
    Boolean,
    described("Whether the carrier turns and the ring stands, which determines the speed in rpm"),
]
Driving = Annotated[
    Literal["sun", "ring"],
    CHOICE,
    described('Gear that drives, seen from the carrier; "ring" also if the carrier drives the sun'),
]
Gyroscopic = Annotated[
    Boolean,
    described("Whether Coriolis and centrifugal forces of the turning carrier act on moving axes"),
]


@checked
def planetary(
    *,
    planets: Planets = 3,
    teeth: Annotated[
        tuple[Teeth, ...], Values(2), described("Numbers of teeth of sun and ring")
    ] = (27, 99),
    planet_teeth: Annotated[
        Teeth | None, described("Teeth of a planet; by default half the difference of ring and sun")
    ] = None,
    positions: Positions = None,
    masses: Annotated[
        tuple[Mass, ...], Values(4), described("Masses of sun, ring, carrier and one planet")
    ] = (0.4, 2.35, 5.43, 0.66),
    reduced_inertias: Annotated[
        tuple[Mass, ...],
        Values(4),
        described(
            "Inertias over squared base radius of sun, ring, carrier (radius of the pins) and "
            "planet"
        ),
    ] = (0.39, 3.0, 6.29, 0.61),
    sun_base_radius: Annotated[
        Length, described("Base radius of the sun; those of ring and planets follow from the teeth")
    ] = 0.0387,
    pressure_angle: Annotated[
        WorkingAngle, described("Working pressure angle of sun meshes; that of ring meshes follows")
    ] = _PRESSURE_ANGLE,
    support_stiffness: Supports = (1e8, 1e8, 1e8, 1e8),
    torsional_stiffness: Twists = (0.0, 1e9, 0.0),
    structural_damping: StructuralDamping = STRUCTURAL_DAMPING,
    mean_stiffness: Annotated[
        tuple[Stiffness, ...], Values(2), described("Mean stiffness of sun and ring meshes")
    ] = (5e8, 5e8),
    stiffness_ratio: Annotated[
        tuple[StiffnessRatio, ...],
        Values(2),
        described("Stiffness ratios kappa of sun and ring meshes"),
    ] = (1.0, 1.0),
    contact_ratio: Annotated[
        tuple[ContactRatio, ...],
        Values(2),
        described("Contact ratios epsilon of sun and ring meshes"),
    ] = (1.4, 1.6),
    material_damping: MaterialDamping = 1000.0,
    backlash_damping: BacklashDamping = 300.0,
    backlash: Backlash = 30e-6,
    load: Annotated[Force, described("Force on every mesh of the sun")] = 2000.0,
    ring_phase: Annotated[
        Finite | None, described("Phase of the first ring mesh; by default from the planets' teeth")
    ] = None,
    pin_errors: PinErrors = None,
    turning: Turning = False,
    driving: Driving = "sun",
    gyroscopic: Gyroscopic = False,
    **options,
):
    """Return a planetary train of sun, ring, carrier and planets.

    The defaults are those of Lin and Parker, J. Vib. Acoust. 121 (1999) 316-321, except for the
    mesh data beside the mean stiffness. Bodies are called ``sun``, ``ring``, ``carrier``, ``planet
    1``, ..., meshes ``sun 1``, ..., ``ring 1``, .... The torque of the sun is counterclockwise;
    those of ring and carrier balance it where they can rotate freely. Other options are those of
    `GearTrain`.

    Raises
    ------
    ValueError
        If a value is impossible or the planets do not fit between sun and ring.
    """
    n, (sun, ring) = planets, teeth
    planet_teeth = _planet_teeth(teeth, planet_teeth)
    positions = equal_positions(sun, ring, n) if positions is None else positions
    positions = checks.sequence("positions", positions, n)
    pin_errors = [(0.0, 0.0)] * n if pin_errors is None else pin_errors
    errors = checks.sequence("pin_errors", pin_errors, n)
    pin_radius, angles = _mesh_angles(sun_base_radius, teeth, planet_teeth, pressure_angle)
    r_sun, torsional_stiffness = sun_base_radius, (*torsional_stiffness, 0.0)
    radii = r_sun, r_sun * ring / sun, pin_radius, r_sun * planet_teeth / sun
    # The square of a radius must be a number.
    checks.require(max(radii) < 1e150, "sun_base_radius", r_sun, "a radius in m, far below 1e150")
    torque = n * load * r_sun
    torques = [torque, torque * ring / sun, -torque * (1.0 + ring / sun), 0.0]

    def body(kind: str, teeth: int | None, name: str | None = None, **fields: Any) -> Body:
        """Return the "sun", "ring", "carrier" or a "planet", with the kind as default name."""
        i = ("sun", "ring", "carrier", "planet").index(kind)
        stiffness = torsional_stiffness[i]
        # The torsional support of a fixed ring or carrier carries its torque.
        is_fixed = kind in ("ring", "carrier") and stiffness > 0.0
        return Body(
            name=name or kind,
            teeth=teeth,
            mass=masses[i],
            inertia=reduced_inertias[i] * radii[i] ** 2,
            base_radius=radii[i],
            torque=0.0 if is_fixed else torques[i],
            support_stiffness=support_stiffness[i],
            support_damping=proportional_damping(support_stiffness[i], structural_damping),
            torsional_stiffness=stiffness * radii[i] ** 2,
            torsional_damping=proportional_damping(stiffness, structural_damping) * radii[i] ** 2,
            **fields,
        )

    bodies = [body("sun", sun), body("ring", ring), body("carrier", None)]
    meshes = []
    for k, central in enumerate(("sun", "ring")):
        is_ring = central == "ring"
        for i, angle in enumerate(positions):
            planet, phase = f"planet {i + 1}", None
            if not is_ring:
                position = {"carrier": "carrier", "angle": angle, "offset": errors[i]}
                bodies.append(body("planet", planet_teeth, planet, **position))
            elif ring_phase is not None:
                phase = ring_phase - ring * (angle - positions[0]) / (2.0 * math.pi)
            mesh = Mesh(
                name=f"{central} {i + 1}",
                pinion=planet if is_ring else central,
                wheel=central if is_ring else planet,
                internal=is_ring,
                driving=None if driving == "sun" else ("ring" if is_ring else planet),
                position=angle,
                pressure_angle=angles[k],
                max_stiffness=mean_stiffness[k]
                / mean_over_max(contact_ratio[k], stiffness_ratio[k]),
                stiffness_ratio=stiffness_ratio[k],
                contact_ratio=contact_ratio[k],
                phase=phase,
                material_damping=material_damping,
                backlash_damping=backlash_damping,
                backlash=backlash,
            )
            meshes.append(mesh)
    return create_train(
        bodies=bodies,
        meshes=meshes,
        carrier_ratio=sun / ring if turning else 0.0,
        gyroscopic=gyroscopic,
        **options,
    )


def _planet_teeth(teeth: tuple[int, int], planet_teeth: int | None) -> int:
    """Return the checked number of teeth of a planet, by default from the teeth of (sun, ring)."""
    sun, ring = teeth
    if planet_teeth is None:
        if ring <= sun or (ring - sun) % 2:
            raise ValueError(
                f"teeth = {teeth!r} is not allowed: the ring must have an even number of teeth "
                "more than the sun, unless planet_teeth is given"
            )
        planet_teeth = (ring - sun) // 2
    allowed = f"an integer from 3 to {ring - 1}"
    checks.require(3 <= planet_teeth < ring, "planet_teeth", planet_teeth, allowed)
    return planet_teeth


def _mesh_angles(sun_base_radius, teeth, planet_teeth, pressure_angle):
    """Return the radius of the planet pins in m and the pressure angles of (sun, ring) meshes.

    `teeth` are those of (sun, ring); `pressure_angle` is that of the sun meshes in rad.
    """
    sun, ring = teeth
    r_planet, r_ring = sun_base_radius * planet_teeth / sun, sun_base_radius * ring / sun
    pin_radius = (sun_base_radius + r_planet) / math.cos(pressure_angle)
    cosine = (r_ring - r_planet) / pin_radius
    if not math.cos(_MAX_RING_ANGLE) <= cosine <= 1.0:
        raise ValueError(
            f"planet_teeth = {planet_teeth!r} is not allowed: at this pressure_angle the planets "
            "must fit into the ring, where the pressure angle must be from 0 to 45 degrees"
        )
    equal_angles = planet_teeth * 2 == ring - sun
    return pin_radius, (pressure_angle, pressure_angle if equal_angles else math.acos(cosine))


@declared()
class ParallelStage:
    """A pair of gears on fixed axes, one of which is on a shaft of a planetary set; immutable.

    The torque of the body on the other end of this shaft moves to the other gear.
    """

    stage: Annotated[GearStage, described("The two gears")]
    on: Annotated[
        Text, described("Body at the other end of the shaft: sun, carrier, or as wheel 1")
    ]
    shaft_stiffness: Annotated[ShaftStiffness, described("Torsional stiffness of the shaft")]
    gear: Annotated[
        Literal["pinion", "wheel"], CHOICE, described("Gear of the stage that is on the shaft")
    ] = "pinion"
    position: Annotated[
        Angle, described("Angle of the line from the axis of the pinion to that of the wheel")
    ] = 0.0

    def elements(
        self, number: int, bodies: dict[str, Body], structural_damping: float, options: dict
    ) -> tuple[dict[str, Body], Mesh, Shaft]:
        """Return the changed bodies by name, the mesh and the shaft of the stage with a number.

        `bodies` are those of the train so far, and `options` those of `Mesh.from_geometry`.
        """
        owner = f"stages[{number - 1}]"
        checks.one_of(f"{owner}.on", self.on, list(bodies))
        torque = bodies[self.on].torque
        allowed = "a body with a torque, which the stage takes over"
        checks.require(torque != 0.0, f"{owner}.on", self.on, allowed)
        pinion, wheel = self.stage.pinion, self.stage.wheel
        names = {"pinion": f"pinion {number}", "wheel": f"wheel {number}"}
        sign = 1 if wheel.internal else -1
        ratio = sign * pinion.teeth / wheel.teeth  # speed of the wheel over that of the pinion
        other = "wheel" if self.gear == "pinion" else "pinion"
        # The power is the same; the shaft acts on its gear against the torque of the body.
        torques = {
            self.gear: -torque,
            other: torque / (ratio if self.gear == "pinion" else 1 / ratio),
        }
        loading = torques["wheel"] if wheel.internal else torques["pinion"]
        changed = {
            self.on: dataclasses.replace(bodies[self.on], torque=0.0),
            names["pinion"]: Body.from_gear(pinion, names["pinion"]),
            names["wheel"]: Body.from_gear(wheel, names["wheel"]),
        }
        free = names[other]
        changed[free] = dataclasses.replace(changed[free], torque=torques[other])
        mesh = Mesh.from_geometry(
            self.stage,
            names["pinion"],
            names["wheel"],
            name=f"stage {number}",
            torque=torques["pinion"],
            position=self.position,
            direction=1 if loading > 0.0 else -1,
            **options,
        )
        ends = self.on, names[self.gear]
        damping = proportional_damping(self.shaft_stiffness, structural_damping)
        return changed, mesh, Shaft(bodies=ends, stiffness=self.shaft_stiffness, damping=damping)


@checked
def planetary_set(
    sun,
    planet,
    ring,
    *,
    torque: Annotated[
        Torque,
        described(
            "Torque on the sun, negative on the coast sides; the torques on ring and carrier, if "
            "they turn, balance it"
        ),
    ],
    planets: Planets = 3,
    positions: Positions = None,
    centre_distance: Annotated[
        Diameter | None,
        described("Centre distance; by default that of sun and planet without backlash"),
    ] = None,
    backlashes: Annotated[
        tuple[RunOut, ...] | None,
        Values(2),
        described("Normal backlash of sun and ring meshes; by default it follows from the gears"),
    ] = None,
    carrier_mass: Annotated[
        Mass | None, described("Mass of the carrier without planets; by default that of a disc")
    ] = None,
    carrier_inertia: Annotated[
        Inertia | None,
        described(
            "Inertia of the carrier without planets; by default that of a disc with the material "
            "and width of a planet and the radius of the pins"
        ),
    ] = None,
    support_stiffness: Supports = (math.inf,) * 4,
    torsional_stiffness: Twists = (0.0, math.inf, 0.0),
    structural_damping: StructuralDamping = STRUCTURAL_DAMPING,
    damping_ratio: DampingRatio = None,
    logarithmic_decrement: Decrement = None,
    material_damping: ContactDamping = None,
    backlash_damping_ratio: BacklashDampingRatio = 0.0,
    model: Annotated[
        Literal["teeth", "rectangle"],
        CHOICE,
        described(
            "Mean stiffness excited by the transmission error of loaded teeth, or two levels"
        ),
    ] = "teeth",
    stiffness=None,
    options=None,
    pin_errors: PinErrors = None,
    turning: Turning = True,
    driving: Driving = "sun",
    gyroscopic: Gyroscopic = False,
    stages: Annotated[
        tuple[ParallelStage, ...],
        Values(),
        described("Parallel stages on shafts of the sun, the carrier or earlier stages"),
    ] = (),
    **train_options,
):
    """Return the planetary train of the geometries of a sun, planet and ring.

    Each gear is a `gearlib.geometry.SpurGear`; the ring needs its `outer_diameter`. Stiffness,
    contact ratios, backlash, inertias, pressure angles and phases follow from the geometry. Bodies
    and meshes have the same names as in `gearlib.planetary`; those of the parallel stages are
    ``pinion 1``, ``wheel 1`` and ``stage 1``, .... `model`, `stiffness`, `options` and the damping
    are those of `gearlib.Mesh.from_geometry`, other options those of `GearTrain`.

    Raises
    ------
    ValueError
        If gears do not mesh, planets cannot be assembled or strike each other, or a value is
        impossible.
    """
    set_meshes = planetary_meshes(
        sun,
        planet,
        ring,
        planets=planets,
        positions=positions,
        centre_distance=centre_distance,
        backlashes=backlashes,
    )
    n = len(set_meshes.positions)
    pin_radius = float(set_meshes.sun_mesh.centre_distance)
    disc_mass = math.pi * pin_radius**2 * planet.width * planet.material.density
    mass = disc_mass if carrier_mass is None else carrier_mass
    inertia = disc_mass * pin_radius**2 / 2.0 if carrier_inertia is None else carrier_inertia
    reduced_inertias = [
        gear.inertia / (gear.base_diameter / 2.0) ** 2 for gear in (sun, ring, planet)
    ]
    reduced_inertias.insert(2, inertia / pin_radius**2)
    # All sun meshes carry the same part of the torque, and each ring mesh the same force.
    sun_torque = torque / n
    planet_torque = sun_torque * planet.teeth / sun.teeth
    mesh_options = {
        "model": model,
        "stiffness": stiffness,
        "options": options,
        "load_argument": ("torque", torque, "N m"),
        "damping_ratio": damping_ratio,
        "logarithmic_decrement": logarithmic_decrement,
        "material_damping": material_damping,
        "backlash_damping_ratio": backlash_damping_ratio,
    }
    sun_mesh_fields = set_meshes.sun_mesh.train_parameters(torque=sun_torque, **mesh_options)
    ring_mesh_fields = set_meshes.ring_mesh.train_parameters(torque=planet_torque, **mesh_options)
    train = planetary(
        planets=n,
        teeth=(sun.teeth, ring.teeth),
        planet_teeth=planet.teeth,
        positions=list(set_meshes.positions),
        masses=(sun.mass, ring.mass, mass, planet.mass),
        reduced_inertias=reduced_inertias,
        sun_base_radius=sun.base_diameter / 2.0,
        pressure_angle=set_meshes.sun_mesh.working_pressure_angle,
        support_stiffness=support_stiffness,
        torsional_stiffness=torsional_stiffness,
        structural_damping=structural_damping,
        load=sun_torque / (sun.base_diameter / 2.0),
        pin_errors=pin_errors,
        turning=turning,
        driving=driving,
        gyroscopic=gyroscopic,
        **train_options,
    )
    meshes = [
        dataclasses.replace(mesh, **(ring_mesh_fields if mesh.internal else sun_mesh_fields))
        for mesh in train.meshes
    ]
    bodies, shafts = {body.name: body for body in train.bodies}, []
    del mesh_options["load_argument"]
    for number, stage in enumerate(stages, 1):
        added = stage.elements(number, bodies, structural_damping, mesh_options)
        bodies |= added[0]
        meshes.append(added[1])
        shafts.append(added[2])
    return dataclasses.replace(
        train, bodies=tuple(bodies.values()), meshes=tuple(meshes), shafts=(*train.shafts, *shafts)
    )
