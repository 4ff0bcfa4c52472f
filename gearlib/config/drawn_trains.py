"""Sections of drawn gears in a train, and their check before any job runs."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gearlib.config import drawing
from gearlib.config.gears import GearSection, MethodSection, PinionSection, Power, Speed, Torque
from gearlib.config.types import (
    Angle,
    DampingCoefficient,
    Inertia,
    Length,
    Mass,
    NonNegative,
    RunOut,
    Truth,
    integer_within,
    numbers,
    quantity,
)

Support = quantity("N/m", "1 kN/um", ge=0, infinite=True)
Time = quantity("s", "1 us", ge=0)
PinErrors = Annotated[
    list[numbers(quantity("m", "10 um"), 2, "Radial and tangential.")],
    Field(min_length=1, description="By how much the axis of each is misplaced, m."),
]
Central = Annotated[
    Literal["sun", "ring"],
    Field(description="Which gear drives, seen from the carrier. Default: sun."),
]


class RingSection(GearSection):
    """The ring gear of a planetary set; what it shares with the sun is the sun's by default."""

    outer_diameter: Length = Field(description="Of its rim, m.")


class DampingByRatio(MethodSection):
    """Stiffness and damping of drawn meshes."""

    damping_ratio: NonNegative = Field(default=None, description="beta of each mesh by itself.")
    logarithmic_decrement: NonNegative = Field(
        default=None, description="delta, in place of damping_ratio."
    )
    material_damping: DampingCoefficient = Field(
        default=None, description="k_1 in contact, N s/m, in place of damping_ratio."
    )
    backlash_damping_ratio: NonNegative = Field(default=None, description="beta_m.")


class PlanetarySet(DampingByRatio):
    """Sun, planets and ring by their drawing. Arguments of `gearlib.geometry.planetary_set`."""

    sun: PinionSection
    planet: GearSection
    ring: RingSection
    torque: Torque = Field(default=None, description="Of the sun, N m; or power and speed.")
    power: Power = Field(default=None, description="Of the sun, W.")
    speed: Speed = Field(default=None, description="Of the sun, rpm.")
    planets: integer_within(ge=1, le=100) = Field(default=None, description="Planets. Default: 3.")
    positions: Annotated[list[Angle], Field(min_length=1)] = Field(
        default=None, description="Angles of the planets, rad; equally spaced if left out."
    )
    centre_distance: Length = Field(
        default=None, description="m. Default: that of sun and planet without backlash."
    )
    backlashes: numbers(RunOut, 2, "Normal backlash of the meshes of sun and ring, m.") = None
    carrier_mass: Mass = Field(default=None, description="Without planets, kg. Default: a disc.")
    carrier_inertia: Inertia = Field(default=None, description="kg m^2. Default: a disc.")
    support_stiffness: numbers(Support, 4, "Of sun, ring, carrier and planets, N/m.") = None
    torsional_stiffness: numbers(Support, 3, "Of sun, ring and carrier at their radius, N/m.") = (
        None
    )
    structural_damping: Time = Field(
        default=None, description="Damping of all supports over their stiffness, s."
    )
    pin_errors: PinErrors = None
    turning: Truth = Field(default=None, description="Whether the carrier turns. Default: true.")
    driving: Central = None
    gyroscopic: Truth = Field(
        default=None, description="Whether the forces of the turning frame are felt."
    )

    @model_validator(mode="after")
    def _check(self):
        check_planets("train.planetary_set", self)
        return self

    def arguments(self):
        """Return the arguments of `planetary_set` as plain values, gears as dicts."""
        from gearlib.models.geometry.parameters import torque_of

        given = self.model_dump(exclude={"torque", "power", "speed", "stiffness_options"})
        given |= drawing.method("train.planetary_set", self)
        given["torque"] = drawing.rounded(torque_of(self.torque, self.power, self.speed))
        return given


#: Keys of a mesh that suit drawn gears only, and the coefficient in place of ratios.
OF_DRAWN = {*DampingByRatio.model_fields, "torque", "centre_distance"}


def check_planets(key, section):
    """Refuse a planetary set that cannot be, before any job; the message names the key."""
    from gearlib.models.geometry.planets import planets_of

    keys = {name: f"{key}.{name}" for name in ("sun", "planet", "ring")}
    sun = drawing.gear_of(keys["sun"], section.sun)
    planet = drawing.gear_of(keys["planet"], section.planet, like=section.sun)
    ring = drawing.gear_of(keys["ring"], section.ring, like=section.sun, internal=True)
    places = {"planets", "positions", "centre_distance", "backlashes"}
    with drawing.naming(key, section.stiffness_options, **keys):
        drawn = planets_of(sun, planet, ring, **section.model_dump(include=places))
        given = section.arguments()
        names = (*DampingByRatio.model_fields, "options", "torque")
        for mesh in (drawn.sun_mesh, drawn.ring_mesh):
            mesh.train_parameters(**{name: given[name] for name in names if name in given})


def check_meshes(key, section):
    """Refuse drawn gears of a train of one's own that do not mesh; the message names the key."""
    drawn = {}
    for i, body in enumerate(section.bodies):
        if body.gear is not None:
            place = f"{key}.bodies[{i}].gear"
            drawn[body.name] = place, drawing.gear_of(place, body.gear)
    for i, mesh in enumerate(section.meshes):
        here = f"{key}.meshes[{i}]"
        ends = [drawn.get(name) for name in (mesh.pinion, mesh.wheel)]
        if None in ends or mesh.max_stiffness is not None:
            _check_numbers(here, mesh)
        else:
            _check_drawn(here, mesh, *ends)


def _check_numbers(here, mesh):
    for name in ("max_stiffness", "stiffness_ratio", "contact_ratio"):
        if getattr(mesh, name) is None:
            raise ValueError(
                f"{here}.{name} is missing: it must be given unless both gears are drawn"
            )
    given = mesh.model_dump(include=OF_DRAWN - {"material_damping"})
    if given:
        name, value = next(iter(given.items()))
        raise ValueError(
            f"{here}.{name} = {value!r} is not allowed: it must be left out where the stiffness is "
            "given or a gear is not drawn"
        )


def _check_drawn(here, mesh, pinion, wheel):
    from gearlib.models.geometry.mesh import Mesh

    own = mesh.model_dump(include=OF_DRAWN - {"centre_distance", "stiffness", "stiffness_options"})
    own |= drawing.method(here, mesh)
    with drawing.naming(here, mesh.stiffness_options, pinion=pinion[0], wheel=wheel[0]):
        Mesh(pinion[1], wheel[1], mesh.centre_distance).train_parameters(**own)
