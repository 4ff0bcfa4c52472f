"""Planetary trains with given parameters, `planetary`, or gear geometries, `planetary_set`."""

import dataclasses
import math
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le

from gearlib import checks
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.geometry.from_values import build_planetary_meshes, equally_spaced_positions
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
TorsionalSupports = Annotated[
    tuple[Support, ...],
    Values(3),
    described("Tangential stiffness of the supports of sun, ring and carrier at their base radius"),
]
CarrierRotates = Annotated[
    Boolean,
    described("Whether the carrier rotates and the ring is fixed; it determines the speed in rpm"),
]
DrivingGear = Annotated[
    Literal["sun", "ring"],
    CHOICE,
    described('Driving gear relative to the carrier; "ring" also if the carrier drives the sun'),
]
Gyroscopic = Annotated[
    Boolean,
    described("Whether Coriolis and centrifugal forces of the rotating carrier act on moving axes"),
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
        Length, described("Base radius of the sun, which determines the radii of ring and planets")
    ] = 0.0387,
    pressure_angle: Annotated[
        WorkingAngle,
        described("Working pressure angle of sun meshes, which sets that of ring meshes"),
    ] = _PRESSURE_ANGLE,
    support_stiffness: Supports = (1e8, 1e8, 1e8, 1e8),
    torsional_stiffness: TorsionalSupports = (0.0, 1e9, 0.0),
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
    load: Annotated[Force, described("Force on each mesh of the sun")] = 2000.0,
    ring_phase: Annotated[
        Finite | None, described("Phase of the first ring mesh; by default from the planets' teeth")
    ] = None,
    pin_errors: PinErrors = None,
    turning: CarrierRotates = False,
    driving: DrivingGear = "sun",
    gyroscopic: Gyroscopic = False,
    **options,
):
    """Return a planetary train of sun, ring, carrier and planets.

    The defaults are the example of Lin and Parker, J. Vib. Acoust. 121 (1999) 316-321, except for
    mesh data other than the mean stiffness. Bodies are called ``sun``, ``ring``, ``carrier``,
    ``planet 1``, ..., meshes ``sun 1``, ..., ``ring 1``, .... The torque on the sun is
    counterclockwise; torques on ring and carrier balance it if they can rotate freely. Other
    options are passed to `GearTrain`.

    Raises
    ------
    ValueError
        If a value is impossible or the planets do not fit between sun and ring.
    """
    n = planets
    sun_teeth, ring_teeth = teeth
    planet_teeth = _check_planet_teeth(teeth, planet_teeth)
    if positions is None:
        positions = equally_spaced_positions(sun_teeth, ring_teeth, n)
    positions = checks.check_sequence("positions", positions, n)
    pin_errors = [(0.0, 0.0)] * n if pin_errors is None else pin_errors
    offsets = checks.check_sequence("pin_errors", pin_errors, n)
    pin_radius, pressure_angles = _pin_radius_and_pressure_angles(
        sun_base_radius, teeth, planet_teeth, pressure_angle
    )
    torsional_stiffness = (*torsional_stiffness, 0.0)
    ring_base_radius = sun_base_radius * ring_teeth / sun_teeth
    planet_base_radius = sun_base_radius * planet_teeth / sun_teeth
    radii = sun_base_radius, ring_base_radius, pin_radius, planet_base_radius
    # The squares of the radii must not overflow.
    allowed = "a radius in m, far below 1e150"
    checks.require(max(radii) < 1e150, "sun_base_radius", sun_base_radius, allowed)
    sun_torque = n * load * sun_base_radius
    ring_torque = sun_torque * ring_teeth / sun_teeth
    carrier_torque = -sun_torque * (1.0 + ring_teeth / sun_teeth)
    torques = [sun_torque, ring_torque, carrier_torque, 0.0]

    def body(kind: str, teeth: int | None, name: str | None = None, **fields: Any) -> Body:
        """Create the `Body` of a kind: "sun", "ring", "carrier" or "planet".

        `teeth` is None for the carrier; the default of `name` is the kind; `fields` are further
        fields of `Body`.
        """
        i = ("sun", "ring", "carrier", "planet").index(kind)
        stiffness = torsional_stiffness[i]
        # The torque of a fixed ring or carrier acts on its torsional support instead of the body.
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

    bodies = [body("sun", sun_teeth), body("ring", ring_teeth), body("carrier", None)]
    for i, angle in enumerate(positions):
        pin = {"carrier": "carrier", "angle": angle, "offset": offsets[i]}
        bodies.append(body("planet", planet_teeth, f"planet {i + 1}", **pin))
    meshes = []
    for k, central_gear in enumerate(("sun", "ring")):
        is_ring = central_gear == "ring"
        for i, angle in enumerate(positions):
            planet = f"planet {i + 1}"
            phase = driving_gear = None
            if is_ring and ring_phase is not None:
                phase = ring_phase - ring_teeth * (angle - positions[0]) / (2.0 * math.pi)
            if driving == "ring":
                driving_gear = "ring" if is_ring else planet
            mesh = Mesh(
                name=f"{central_gear} {i + 1}",
                pinion=planet if is_ring else central_gear,
                wheel=central_gear if is_ring else planet,
                internal=is_ring,
                driving=driving_gear,
                position=angle,
                pressure_angle=pressure_angles[k],
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
        carrier_ratio=sun_teeth / ring_teeth if turning else 0.0,
        gyroscopic=gyroscopic,
        **options,
    )


def _check_planet_teeth(teeth: tuple[int, int], planet_teeth: int | None) -> int:
    """Check and return the number of teeth of a planet.

    `teeth` are the tooth numbers of (sun, ring). If `planet_teeth` is None, the default is half the
    difference of the tooth numbers of ring and sun, which must be an integer. Raises ValueError for
    an impossible number.
    """
    sun_teeth, ring_teeth = teeth
    if planet_teeth is None:
        difference = ring_teeth - sun_teeth
        if difference <= 0 or difference % 2:
            raise ValueError(
                f"teeth = {teeth!r} is not allowed: the ring must have more teeth than the sun by "
                "an even number, unless planet_teeth is given"
            )
        planet_teeth = difference // 2
    allowed = f"an integer from 3 to {ring_teeth - 1}"
    checks.require(3 <= planet_teeth < ring_teeth, "planet_teeth", planet_teeth, allowed)
    return planet_teeth


def _pin_radius_and_pressure_angles(sun_base_radius, teeth, planet_teeth, pressure_angle):
    """Return (pin radius, (pressure angle of sun meshes, pressure angle of ring meshes)).

    The pin radius of the carrier, in m, is the centre distance of sun and planet. `sun_base_radius`
    is in m, `teeth` are the tooth numbers of (sun, ring), and `pressure_angle` is the working
    pressure angle of the sun meshes. All angles are in rad. Raises ValueError if the planets do not
    fit into the ring.
    """
    sun_teeth, ring_teeth = teeth
    planet_base_radius = sun_base_radius * planet_teeth / sun_teeth
    ring_base_radius = sun_base_radius * ring_teeth / sun_teeth
    pin_radius = (sun_base_radius + planet_base_radius) / math.cos(pressure_angle)
    ring_cosine = (ring_base_radius - planet_base_radius) / pin_radius
    if not math.cos(_MAX_RING_ANGLE) <= ring_cosine <= 1.0:
        raise ValueError(
            f"planet_teeth = {planet_teeth!r} is not allowed: at this pressure_angle the planets "
            "must fit into the ring, where the pressure angle must be from 0 to 45 degrees"
        )
    ring_pressure_angle = math.acos(ring_cosine)
    if planet_teeth * 2 == ring_teeth - sun_teeth:
        ring_pressure_angle = pressure_angle  # exact, whereas the arc cosine is rounded
    return pin_radius, (pressure_angle, ring_pressure_angle)


@declared()
class ParallelStage:
    """A gear pair on fixed axes, one gear of which is on a shaft of a planetary set; immutable.

    The torque of the body at the other end of the shaft is set to 0. Instead, a torque with the
    same power acts on the gear that is not on the shaft.
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
        Angle, described("Angle of the line from the axis of the pinion to the axis of the wheel")
    ] = 0.0

    def elements(
        self, number: int, bodies: dict[str, Body], structural_damping: float, options: dict
    ) -> tuple[dict[str, Body], Mesh, Shaft]:
        """Return the elements (bodies, mesh, shaft) that the stage adds to a planetary train.

        The new bodies, a dict by name, are the two gears and a copy of the body at the other end of
        the shaft without its torque. `number` is the number of the stage, from 1, and `bodies` maps
        names to the existing bodies of the train. `structural_damping` is the ratio of damping to
        stiffness of the shaft in s. `options` are arguments of `Mesh.from_geometry`, such as
        damping_ratio.
        """
        key = f"stages[{number - 1}].on"
        checks.check_choice(key, self.on, list(bodies))
        torque = bodies[self.on].torque
        allowed = "a body with a torque, which is transferred to the stage"
        checks.require(torque != 0.0, key, self.on, allowed)
        pinion, wheel = self.stage.pinion, self.stage.wheel
        names = {"pinion": f"pinion {number}", "wheel": f"wheel {number}"}
        sign = 1 if wheel.internal else -1
        speed_ratio = sign * pinion.teeth / wheel.teeth  # wheel speed over pinion speed
        # Both gears transmit the same power. The reaction of the shaft on its gear is opposite to
        # the torque of the body.
        if self.gear == "pinion":
            free_gear = "wheel"
            torques = {"pinion": -torque, "wheel": torque / speed_ratio}
        else:
            free_gear = "pinion"
            torques = {"wheel": -torque, "pinion": torque / (1 / speed_ratio)}
        direction_torque = torques["wheel"] if wheel.internal else torques["pinion"]
        new_bodies = {
            self.on: dataclasses.replace(bodies[self.on], torque=0.0),
            names["pinion"]: Body.from_gear(pinion, names["pinion"]),
            names["wheel"]: Body.from_gear(wheel, names["wheel"]),
        }
        free_name = names[free_gear]
        loaded = dataclasses.replace(new_bodies[free_name], torque=torques[free_gear])
        new_bodies[free_name] = loaded
        mesh = Mesh.from_geometry(
            self.stage,
            names["pinion"],
            names["wheel"],
            name=f"stage {number}",
            torque=torques["pinion"],
            position=self.position,
            direction=1 if direction_torque > 0.0 else -1,
            **options,
        )
        ends, stiffness = (self.on, names[self.gear]), self.shaft_stiffness
        damping = proportional_damping(stiffness, structural_damping)
        return new_bodies, mesh, Shaft(bodies=ends, stiffness=stiffness, damping=damping)


@checked
def planetary_set(
    sun,
    planet,
    ring,
    *,
    torque: Annotated[
        Torque,
        described(
            "Torque on the sun, negative to load the coast sides; the torques on ring and carrier, "
            "if they rotate, balance it"
        ),
    ],
    planets: Planets = 3,
    positions: Positions = None,
    centre_distance: Annotated[
        Diameter | None,
        described("Centre distance; by default of a sun mesh without backlash"),
    ] = None,
    backlashes: Annotated[
        tuple[RunOut, ...] | None,
        Values(2),
        described("Normal backlash of sun and ring meshes; by default it follows from the gears"),
    ] = None,
    carrier_mass: Annotated[
        Mass | None, described("Mass of the carrier without planets; by default the mass of a disc")
    ] = None,
    carrier_inertia: Annotated[
        Inertia | None,
        described(
            "Inertia of the carrier without planets; by default the inertia of a disc with the "
            "material and width of a planet and the radius of the pins"
        ),
    ] = None,
    support_stiffness: Supports = (math.inf,) * 4,
    torsional_stiffness: TorsionalSupports = (0.0, math.inf, 0.0),
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
    turning: CarrierRotates = True,
    driving: DrivingGear = "sun",
    gyroscopic: Gyroscopic = False,
    stages: Annotated[
        tuple[ParallelStage, ...],
        Values(),
        described("Parallel stages on shafts of the sun, the carrier or earlier stages"),
    ] = (),
    **train_options,
):
    """Return a planetary train whose sun, planets and ring are given by their geometry.

    Each gear is a `gearlib.geometry.SpurGear`; the ring needs its `outer_diameter`. Stiffness,
    contact ratios, backlash, inertias, pressure angles and phases follow from the geometry. Bodies
    and meshes have the same names as in `gearlib.planetary`; parallel stages add ``pinion 1``,
    ``wheel 1`` and ``stage 1``, .... `model`, `stiffness`, `options` and the damping are described
    in `gearlib.Mesh.from_geometry`; other options are passed to `GearTrain`.

    Raises
    ------
    ValueError
        If gears do not mesh, planets cannot be assembled or strike each other, or a value is
        impossible.
    """
    set_meshes = build_planetary_meshes(
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
    # The default carrier is a disc.
    disc_mass = math.pi * pin_radius**2 * planet.width * planet.material.density
    if carrier_mass is None:
        carrier_mass = disc_mass
    if carrier_inertia is None:
        carrier_inertia = disc_mass * pin_radius**2 / 2.0
    reduced_inertias = [
        gear.inertia / (gear.base_diameter / 2.0) ** 2 for gear in (sun, ring, planet)
    ]
    reduced_inertias.insert(2, carrier_inertia / pin_radius**2)
    # All sun meshes carry equal parts of the torque, and each ring mesh carries the same force.
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
        masses=(sun.mass, ring.mass, carrier_mass, planet.mass),
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
    bodies = {body.name: body for body in train.bodies}
    shafts = []
    del mesh_options["load_argument"]  # It is used only for errors in the argument `torque`.
    for number, stage in enumerate(stages, 1):
        new_bodies, mesh, shaft = stage.elements(number, bodies, structural_damping, mesh_options)
        bodies |= new_bodies
        meshes.append(mesh)
        shafts.append(shaft)
    return dataclasses.replace(
        train, bodies=tuple(bodies.values()), meshes=tuple(meshes), shafts=(*train.shafts, *shafts)
    )
