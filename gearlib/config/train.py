"""Sections of the gear train: a ready-made one, or of one's own parts; its sweep over speed."""

from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from gearlib.config.drawn_trains import (
    Central,
    DampingByRatio,
    PinErrors,
    PlanetarySet,
    Support,
    Time,
    check_meshes,
)
from gearlib.config.gears import BodyGear
from gearlib.config.types import (
    Angle,
    Backlash,
    ContactRatio,
    DampingCoefficient,
    DampingName,
    Finite,
    Given,
    Inertia,
    Length,
    Mass,
    NonNegative,
    RunOut,
    Section,
    Start,
    Started,
    Step,
    Stiffness,
    StiffnessRatio,
    Stop,
    Truth,
    check_record,
    integer_within,
    number_within,
    numbers,
    quantity,
    read_integer,
)

Twist = quantity("N m/rad", "1 kN m/rad", ge=0, infinite=True)
ShaftStiffness = quantity("N m/rad", "1 MN m/rad", gt=0)
TwistDamping = quantity("N m s/rad", "10 N m s/rad", ge=0)
BendingStiffness = quantity("N/m", "1 kN/um", ge=0)
Torque = quantity("N m", "200 N m")
Force = quantity("N", "2 kN")
Error = quantity("m", "10 um")
Frequency = quantity("Hz", "2 kHz", gt=0)
PressureAngle = quantity("rad", "20 deg", ge=0, lt=1.57)
Teeth = integer_within(ge=3, le=100_000)
Label = Annotated[
    str,
    Field(
        min_length=1,
        max_length=60,
        json_schema_extra={"$comment": "a text of 1 to 60 characters"},
    ),
]


def _not_zero(value):
    if value == 0:
        raise PydanticCustomError("direction", "no direction")
    return value


Direction = Annotated[
    int,
    Field(ge=-1, le=1, json_schema_extra={"$comment": "other than 0"}),
    BeforeValidator(read_integer),
    AfterValidator(_not_zero),
]


class Planetary(Given):
    """Sun, ring, carrier and planets, of Lin and Parker where left out.

    All keys are arguments of `gearlib.planetary`; gear_pair has no part in it.
    """

    planets: integer_within(ge=1, le=100) = Field(default=None, description="Planets.")
    teeth: numbers(Teeth, 2, "Of sun and ring.") = None
    planet_teeth: Teeth = Field(default=None, description="Of a planet.")
    positions: Annotated[list[Angle], Field(min_length=1)] = Field(
        default=None, description="Angles of the planets, rad; equally spaced if left out."
    )
    masses: numbers(Mass, 4, "Of sun, ring, carrier and one planet, kg.") = None
    reduced_inertias: numbers(Mass, 4, "Of the same, I / r^2, kg.") = None
    sun_base_radius: Length = Field(default=None, description="Base radius of the sun, m.")
    pressure_angle: PressureAngle = Field(
        default=None, description="Of the sun's meshes in operation, rad."
    )
    support_stiffness: numbers(Support, 4, "Of sun, ring, carrier and planets, N/m.") = None
    torsional_stiffness: numbers(Support, 3, "Of sun, ring and carrier at their radius, N/m.") = (
        None
    )
    structural_damping: Time = Field(
        default=None, description="Damping of all supports over their stiffness, s."
    )
    mean_stiffness: numbers(Stiffness, 2, "Of the meshes of sun and ring, N/m.") = None
    stiffness_ratio: numbers(StiffnessRatio, 2, "Of the same, kappa = C_min / C_max.") = None
    contact_ratio: numbers(ContactRatio, 2, "Of the same.") = None
    material_damping: DampingCoefficient = Field(
        default=None, description="Of all meshes in contact, N s/m."
    )
    backlash_damping: DampingCoefficient = Field(
        default=None, description="Of all meshes in the backlash, N s/m."
    )
    backlash: Backlash = Field(default=None, description="Of all meshes, m.")
    load: Force = Field(default=None, description="On every mesh of the sun, N.")
    ring_phase: Finite = Field(
        default=None, description="Phase of the first ring mesh, in mesh periods."
    )
    pin_errors: PinErrors = None
    turning: Truth = Field(default=None, description="Whether the carrier turns.")
    driving: Central = None
    gyroscopic: Truth = Field(
        default=None, description="Whether the forces of the turning frame are felt."
    )


class _OfPairs(Given):
    structural_damping: Time = Field(
        default=None, description="Damping of supports and shafts over their stiffness, s."
    )
    support_stiffness: Support = Field(default=None, description="Of all axes, N/m.")
    pressure_angle: PressureAngle = Field(default=None, description="In operation, rad.")


class Idler(_OfPairs):
    """Pinion, idler and wheel; both meshes are gear_pair. Arguments of `gearlib.idler`."""

    teeth: numbers(Teeth, 3, "Of pinion, idler and wheel.") = None
    angle: Angle = Field(
        default=None, description="Between both lines of centres at the idler, rad."
    )
    module: Length = Field(default=None, description="m.")
    reduced_inertias: numbers(Mass, 3, "I / r^2 of each, kg.") = None
    masses: numbers(Mass, 3, "Of each, kg.") = None


class TwoStage(_OfPairs):
    """Two stages with a shaft; both meshes are gear_pair. Arguments of `gearlib.two_stage`."""

    teeth: numbers(Teeth, 4, "Of pinion and wheel, stage by stage.") = None
    modules: numbers(Length, 2, "Of both stages, m.") = None
    shaft_stiffness: ShaftStiffness = Field(
        default=None, description="Of the shaft against torsion, N m/rad."
    )
    reduced_inertias: numbers(Mass, 4, "I / r^2 of each, kg.") = None
    masses: numbers(Mass, 4, "Of each, kg.") = None


class SplitPowerReducer(_OfPairs):
    """The paper's Fig. 1 a, every mesh a gear_pair. Arguments of `gearlib.split_power_reducer`."""

    branches: integer_within(ge=1, le=100) = Field(default=None, description="Double satellites.")
    teeth: numbers(Teeth, 4, "Of input, both gears of a satellite, output.") = None
    internal: Truth = Field(default=None, description="Whether the output is a ring gear.")
    modules: numbers(Length, 2, "Of both stages, m.") = None
    shaft_stiffness: ShaftStiffness = Field(
        default=None, description="Of each satellite's shaft against torsion, N m/rad."
    )
    reduced_inertias: numbers(Mass, 4, "I / r^2 of the gears as in `teeth`, kg.") = None
    masses: numbers(Mass, 4, "Of the gears as in `teeth`, kg.") = None
    pin_errors: PinErrors = None
    backlashes: Annotated[
        list[numbers(Backlash, 2, "Of its first and second mesh.")],
        Field(min_length=1, description="Of each branch, m; that of gear_pair if left out."),
    ] = None


class BodyPart(Given):
    """A gear or a carrier, see `gearlib.Body`."""

    name: Label = Field(description="Name of the body.")
    gear: BodyGear = Field(
        default=None, description="Its drawing, which gives inertia, base radius, teeth and mass."
    )
    inertia: Inertia = Field(default=None, description="About its axis, kg m^2.")
    base_radius: Length = Field(default=None, description="m; of a carrier the radius of its pins.")
    teeth: Teeth = Field(default=None, description="Left out for a carrier.")
    mass: Mass = Field(default=None, description="kg; needed where the axis can move.")
    support_stiffness: numbers(Support, 2, "Along x and y, N/m.") = None
    support_damping: numbers(DampingCoefficient, 2, "Along x and y, N s/m.") = None
    torsional_stiffness: Twist = Field(
        default=None, description="Of a support against rotation, N m/rad."
    )
    torsional_damping: TwistDamping = Field(default=None, description="Of the same, N m s/rad.")
    torque: Torque = Field(default=None, description="Counterclockwise, N m.")
    eccentricity: RunOut = Field(default=None, description="Run-out of the base circle, m.")
    eccentricity_phase: Angle = Field(
        default=None, description="Its direction at tau = 0, rad; on a carrier from the pin."
    )
    offset: numbers(Error, 2, "By how much the axis is misplaced, m.") = None
    carrier: Label = Field(default=None, description="Name of the body that carries the axis.")
    angle: Angle = Field(default=None, description="Of the pin on the carrier, rad.")

    @model_validator(mode="after")
    def _check(self):
        for key in ("inertia", "base_radius"):
            if self.gear is None and getattr(self, key) is None:
                raise PydanticCustomError("missing_one", "", {"key": key})
        return self


class ShaftPart(Given):
    """An elastic shaft between two bodies, see `gearlib.Shaft`."""

    bodies: numbers(Label, 2, "Their names.")
    stiffness: ShaftStiffness = Field(description="Against torsion, N m/rad.")
    damping: TwistDamping = Field(default=None, description="N m s/rad.")
    bending_stiffness: BendingStiffness = Field(default=None, description="N/m.")
    bending_damping: DampingCoefficient = Field(default=None, description="N s/m.")
    keying: Angle = Field(
        default=None,
        description="From a tooth of the first gear to one of the second, rad. Default: in line, "
        "or what loops of meshes ask for.",
    )


class Deviation(Section):
    """Deviation of the flanks over the mesh phase."""

    cosines: list[Error] = Field(default=[], description="Amplitudes of orders 1, 2, ..., m.")
    sines: list[Error] = Field(default=[], description="Amplitudes of orders 1, 2, ..., m.")


class MeshPart(DampingByRatio):
    """Two gears in mesh, see `gearlib.Mesh`; stiffness and ratios follow where both are drawn."""

    pinion: Label = Field(description="Name of a body.")
    wheel: Label = Field(description="Name of a body; of an internal mesh the ring gear.")
    centre_distance: Length = Field(
        default=None, description="Of drawn gears, m. Default: without backlash by the shifts."
    )
    torque: Torque = Field(
        default=None, description="Of the pinion, N m; the stiffness of drawn gears may need it."
    )
    max_stiffness: Stiffness = Field(default=None, description="C_max, N/m.")
    stiffness_ratio: StiffnessRatio = Field(default=None, description="kappa = C_min / C_max.")
    contact_ratio: ContactRatio = Field(default=None, description="Contact ratio epsilon.")
    name: Label = Field(default=None, description="pinion-wheel if left out.")
    internal: Truth = Field(default=None, description="Whether the wheel is a ring gear.")
    position: Angle = Field(default=None, description="Of the line of centres, rad.")
    pressure_angle: PressureAngle = Field(default=None, description="In operation, rad.")
    line_of_action: Angle = Field(default=None, description="In place of `position`, rad.")
    direction: Direction = Field(default=None, description="Which flanks are the drive side.")
    driving: Label = Field(
        default=None,
        description="Pinion or wheel, which drives through the drive side. Default: as other "
        "meshes have it; of the reference mesh the pinion.",
    )
    phase: Finite = Field(default=None, description="Of the stiffness, in mesh periods.")
    inverse_phase: Finite = Field(
        default=None,
        description="The same of the coast side. Default: by tooth_thickness, else `phase`.",
    )
    backlash: Backlash = Field(default=None, description="m.")
    backlash_damping: DampingCoefficient = Field(
        default=None, description="In the backlash, N s/m."
    )
    moving_backlash: Truth = Field(
        default=None, description="Whether the coast side moves with supports and run-out."
    )
    deviation: Deviation = Field(default=None, description="Of the drive-side flanks.")
    inverse_deviation: Deviation = Field(default=None, description="Of the coast-side flanks.")
    error: Error = Field(default=None, description="Of assembly, along the line of action, m.")
    friction: numbers(NonNegative, 2, "Coefficients in normal and inverse mesh.") = None
    pitch_phase: Angle = Field(
        default=None, description="Mesh phase of the pitch point where the pinion drives, rad."
    )
    tooth_thickness: numbers(
        number_within(gt=0, lt=1), 2, "Of pinion and wheel on their working circles, in pitches."
    ) = None


class Own(Given):
    """Bodies, shafts and meshes, arguments of `gearlib.GearTrain`."""

    bodies: list[BodyPart] = Field(default=[], description="The bodies.")
    shafts: list[ShaftPart] = Field(default=[], description="The shafts.")
    meshes: list[MeshPart] = Field(default=[], description="The meshes.")
    carrier_ratio: Finite = Field(
        default=None, description="Speed of the frame over that of the reference pinion in it."
    )
    gyroscopic: Truth = Field(
        default=None, description="Whether the forces of the turning frame are felt."
    )


#: Kinds whose meshes are all a gear_pair with a damping.
OF_PAIRS = ("split_power_reducer", "idler", "two_stage")


class Train(Given):
    """A gear train; `kind` says which of the sections below it is.

    Their keys are arguments of the functions of the library, which have the defaults. Ready-made
    trains but the planetary one make every mesh of gear_pair and a damping.
    """

    kind: Literal[
        "split_power_reducer", "planetary", "idler", "two_stage", "own", "planetary_set"
    ] = Field(default="split_power_reducer", description="The section that describes the train.")
    reference: Label = Field(
        default=None, description="Mesh that sets scales and tuning; the first if left out."
    )
    reference_frequency: Frequency = Field(
        default=None,
        description="Hz, unit of the tuning; that of the mode that deforms the reference mesh "
        "most if left out.",
    )
    split_power_reducer: SplitPowerReducer = SplitPowerReducer()
    planetary: Planetary = Planetary()
    idler: Idler = Idler()
    two_stage: TwoStage = TwoStage()
    own: Own = Own()
    planetary_set: PlanetarySet = Field(
        default=None, description="Sun, planets and ring by their drawing."
    )

    @model_validator(mode="after")
    def _check(self):
        if self.kind == "planetary_set" and self.planetary_set is None:
            raise PydanticCustomError("missing_one", "", {"key": "planetary_set"})
        check_meshes("train.own", self.own)
        for key in ("bodies", "meshes"):
            if self.kind == "own" and not getattr(self.own, key):
                raise ValueError(
                    f"train.own.{key} = [] is not allowed: it must be a list of at least one entry "
                    "where train.kind is own"
                )
        return self

    def arguments(self):
        """Return what the function or class of this kind is called with, as plain values."""
        given = self.model_dump()
        if self.kind == "planetary_set":
            given[self.kind] = self.planetary_set.arguments()
        common = {key: given[key] for key in ("reference", "reference_frequency") if key in given}
        return given[self.kind] | common


class TrainSweep(Started):
    """Every mesh of the train of the section `train` over speed; the target of this name."""

    key: ClassVar = "train_sweep"

    start: Start = 0.5
    stop: Stop = 1.4
    step: Step = 0.01
    damping: DampingName
    periods: integer_within(ge=1, le=1_000_000) = Field(
        default=120, description="Mesh periods of a run."
    )
    record_periods: integer_within(ge=1) = Field(
        default=12, description="The last ones, which are evaluated; at most `periods`."
    )

    @model_validator(mode="after")
    def _check(self):
        check_record("train_sweep", self)
        return self
