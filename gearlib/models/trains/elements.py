"""Bodies, shafts, meshes and harmonic forces of gear trains in SI units, and checks of trains.

A body rotates about its axis; if its support is elastic, it also moves along x and y. Angles and
torques are positive counterclockwise. The rotation theta is described by the arc length
u = base_radius theta, whose mass is inertia / base_radius^2. `gearlib.models.trains.structure`
assembles the matrices.
"""

import math
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le, Lt

from gearlib import checks, parameters
from gearlib.engines.pair.stiffness import mean_over_max
from gearlib.models.harmonics import Harmonics
from gearlib.parameters import (
    CHOICE,
    INTEGER,
    Angle,
    Backlash,
    BacklashDamping,
    Boolean,
    ContactRatio,
    Damping,
    Error,
    Finite,
    Inertia,
    Length,
    Mass,
    MaterialDamping,
    MaxStiffness,
    NonNegative,
    PressureAngle,
    RunOut,
    ShaftStiffness,
    StiffnessRatio,
    Support,
    Teeth,
    Text,
    Torque,
    TwistDamping,
    Unit,
    Values,
    declared,
    described,
)

#: Arguments of `Mesh.from_geometry` that determine the stiffness and damping of the mesh.
_STIFFNESS_AND_DAMPING = (
    *("torque", "damping_ratio", "logarithmic_decrement", "material_damping"),
    *("backlash_damping_ratio", "model", "stiffness", "options"),
)
#: Largest relative difference of base pitches in a mesh, to allow for rounded base radii.
_PITCH_TOLERANCE = 1e-4
#: Largest number of meshes, as in a planetary train with 100 planets.
_MAX_MESHES = 200
_Thickness = Annotated[float, Gt(0), Lt(1), Unit("1")]


@declared()
class Body:
    """A gear or a carrier of a `GearTrain`; immutable.

    Its support acts along x and y, or radially and tangentially if the body is on a carrier.
    """

    name: Annotated[Text, described("Name of the body")]
    inertia: Annotated[Inertia, described("Moment of inertia about its axis")]
    base_radius: Annotated[Length, described("Base radius; for a carrier the radius of its pins")]
    teeth: Annotated[Teeth | None, described("Number of teeth; carriers have none")] = None
    mass: Annotated[Mass | None, described("Mass; needed if the axis can move")] = None
    support_stiffness: Annotated[
        tuple[Support, ...],
        Values(2, repeat=True),
        described("Stiffness of the support along x and y"),
    ] = (math.inf, math.inf)
    support_damping: Annotated[
        tuple[Damping, ...],
        Values(2, repeat=True),
        described("Damping of the support along x and y"),
    ] = (0.0, 0.0)
    torsional_stiffness: Annotated[
        float,
        Ge(0),
        Unit("N m/rad", "1 kN m/rad", "infinity: rigid"),
        described("Stiffness of a support against rotation"),
    ] = 0.0
    torsional_damping: Annotated[
        TwistDamping, described("Damping of the support against rotation")
    ] = 0.0
    torque: Annotated[
        Torque, described("Constant torque on the body; positive if counterclockwise")
    ] = 0.0
    eccentricity: Annotated[RunOut, described("Run-out of the base circle")] = 0.0
    eccentricity_phase: Annotated[
        Angle,
        described("Direction of the run-out at tau = 0; on a carrier from the radius of the pin"),
    ] = 0.0
    offset: Annotated[
        tuple[Error, ...],
        Values(2, repeat=True),
        described("Offset of the axis along x and y by assembly"),
    ] = (0.0, 0.0)
    carrier: Annotated[Text | None, described("Name of the body that carries the axis")] = None
    angle: Annotated[Angle, described("Angle of its pin on the carrier")] = 0.0

    def __post_init__(self) -> None:
        """Raise ValueError for an elastic support without a mass or a run-out without teeth.

        A support is elastic if its stiffness along x or y is finite.
        """
        owner = f"body {self.name}"
        is_rigid = all(math.isinf(stiffness) for stiffness in self.support_stiffness)
        allowed = "a finite number > 0 if the support is elastic"
        checks.require(self.mass is not None or is_rigid, "mass", None, allowed, owner)
        valid = self.teeth is not None or not self.eccentricity
        allowed = "0 for a body without teeth"
        checks.require(valid, "eccentricity", self.eccentricity, allowed, owner)

    @classmethod
    def from_gear(cls, gear: Any, name: str, **fields: Any) -> "Body":
        """Return a body with the teeth, base radius, mass and inertia of a gear geometry.

        Parameters
        ----------
        gear : gearlib.geometry.SpurGear
            Geometry of the gear.
        name : str
            Name of the body.
        **fields
            Other fields of `Body`, such as the torque; they override the values from the geometry.
        """
        checks.require(hasattr(gear, "base_diameter"), "gear", gear, "a gearlib.geometry.SpurGear")
        gear_fields = {"teeth": gear.teeth, "base_radius": gear.base_diameter / 2.0}
        for field in ("mass", "inertia"):
            # The mass and inertia of a ring gear without an outer diameter raise an error, so they
            # are accessed only if they are not given.
            if field not in fields:
                gear_fields[field] = getattr(gear, field)
        return cls(name=name, **(gear_fields | fields))


@declared()
class Shaft:
    """An elastic shaft that joins two bodies; immutable."""

    bodies: Annotated[
        tuple[Text, ...], Values(2), described("Names of the two bodies that it joins")
    ]
    stiffness: Annotated[ShaftStiffness, described("Torsional stiffness")]
    damping: Annotated[TwistDamping, described("Torsional damping")] = 0.0
    bending_stiffness: Annotated[
        float,
        Ge(0),
        Unit("N/m", "1 kN/um"),
        described("Stiffness between the displacements of both bodies; the same along x and y"),
    ] = 0.0
    bending_damping: Annotated[
        Damping, described("Damping between the displacements of both bodies")
    ] = 0.0
    keying: Annotated[
        Angle | None,
        described(
            "Angle from the middle of a tooth of the first gear counterclockwise to the middle of "
            "a tooth of the second; by default 0 or the angle that loops of meshes require"
        ),
    ] = None

    def __post_init__(self) -> None:
        """Raise ValueError if the shaft joins a body to itself."""
        valid = self.bodies[0] != self.bodies[1]
        allowed = "the names of two different bodies"
        checks.require(valid, "bodies", self.bodies, allowed, "a shaft")


@declared()
class Mesh:
    """Two gears in mesh; immutable.

    Its position is the direction from the axis of the pinion to the axis of the wheel; in an
    internal mesh, it is the direction from the axis of the wheel to the axis of the pinion.
    Friction acts on the axes across the line of action and opposes the sliding, which reverses at
    the pitch point and half a mesh period later.
    """

    pinion: Annotated[Text, described("Name of the body that is the pinion")]
    wheel: Annotated[Text, described("Name of the body that is the wheel or ring gear")]
    max_stiffness: MaxStiffness
    stiffness_ratio: StiffnessRatio
    contact_ratio: ContactRatio
    name: Annotated[Text | None, described("Name of the mesh; by default pinion-wheel")] = None
    internal: Annotated[Boolean, described("Whether the wheel is a ring gear")] = False
    position: Annotated[Angle | None, described("Angle of the line of centres; 0 by default")] = (
        None
    )
    pressure_angle: PressureAngle = math.radians(20.0)
    line_of_action: Annotated[
        Angle | None,
        described(
            "Direction of the mesh force on the wheel, or on the pinion of an internal mesh; an "
            "alternative to `position`"
        ),
    ] = None
    direction: Annotated[
        Literal[1, -1],
        parameters.CHOICE,
        described(
            "1 if the drive-side flanks touch when the pinion, or the wheel of an internal mesh, "
            "is turned counterclockwise; otherwise -1",
        ),
    ] = 1
    driving: Annotated[
        Text | None,
        described(
            "Name of the gear that drives through the drive side, which determines the sense of "
            "rotation of the train; by default it follows from other meshes, and the pinion drives"
            " in the reference mesh"
        ),
    ] = None
    phase: Annotated[
        Finite | None,
        described(
            "Lag of the stiffness behind the reference mesh in periods of this mesh; by default it "
            "follows from tooth numbers, positions, `tooth_thickness` and `pitch_phase`"
        ),
    ] = None
    coast_phase: Annotated[
        Finite | None,
        described(
            "The same lag for the coast-side flanks; by default it follows from `tooth_thickness` "
            "and `pitch_phase`, or equals `phase` if no thickness is given"
        ),
    ] = None
    backlash: Backlash = math.inf
    material_damping: MaterialDamping = 0.0
    backlash_damping: BacklashDamping = 0.0
    moving_backlash: Annotated[
        Boolean,
        described(
            "Whether the coast-side flank moves with supports and run-out as in Eq. (4), so that "
            "bearings do not close the backlash; otherwise it stays a backlash behind the drive "
            "side"
        ),
    ] = False
    deviation: Annotated[
        Harmonics, described("Deviation of the drive-side flanks over the phase of this mesh in m")
    ] = Harmonics()
    coast_deviation: Annotated[
        Harmonics | None,
        described("Deviation of the coast-side flanks in m; by default equal to `deviation`"),
    ] = None
    transmission_error: Annotated[
        Harmonics,
        described(
            "Transmission error of the teeth under load in m, without its mean, over the phase of "
            "this mesh if the pinion drives; it excites both flanks"
        ),
    ] = Harmonics()
    error: Annotated[
        Error, described("Error of assembly: constant displacement along the line of action")
    ] = 0.0
    friction: Annotated[
        tuple[NonNegative, ...],
        Values(2, repeat=True),
        described("Friction coefficients of drive-side and coast-side contact"),
    ] = (0.0, 0.0)
    pitch_phase: Annotated[
        Angle,
        described(
            "Phase of this mesh at which drive-side flanks touch at the pitch point if the pinion "
            "drives; if the wheel drives, minus that phase. Coast-side flanks touch there a tooth "
            "thickness later or earlier"
        ),
    ] = 0.0
    tooth_thickness: Annotated[
        Annotated[tuple[_Thickness, ...] | None, Values(2, repeat=True)] | None,
        described(
            "Tooth thickness of pinion and wheel on their working circles in pitches; by default "
            "half a pitch"
        ),
    ] = None

    def __post_init__(self) -> None:
        """Set the default name and coast-side deviation, and check `driving` and `line_of_action`.

        By default, the deviation of the coast-side flanks equals that of the drive-side flanks.
        Raises ValueError if `driving` is neither gear of the mesh, or if both `line_of_action` and
        `position` are given.
        """
        if self.name is None:
            object.__setattr__(self, "name", f"{self.pinion}-{self.wheel}")
        if self.coast_deviation is None:
            object.__setattr__(self, "coast_deviation", self.deviation)
        owner = f"mesh {self.name}"
        valid = self.driving in (None, self.pinion, self.wheel)
        allowed = f"one of {self.pinion!r}, {self.wheel!r}"
        checks.require(valid, "driving", self.driving, allowed, owner)
        valid = self.line_of_action is None or self.position is None
        allowed = "omitted if position is given"
        checks.require(valid, "line_of_action", self.line_of_action, allowed, owner)

    @classmethod
    def from_geometry(cls, stage: Any, pinion: str, wheel: str, **fields: Any) -> "Mesh":
        """Return a mesh whose stiffness, backlash and phases follow from a gear geometry.

        The contact ratio and the working pressure angle follow from it as well.

        Parameters
        ----------
        stage : gearlib.geometry.GearStage
            Geometry of both gears.
        pinion, wheel : str
            Names of the bodies.
        torque : float, optional
            Torque on the pinion in N m, not 0; its sign does not matter. The model "teeth" requires
            it. The model "rectangle" requires it for the stiffness "iso" at low load, and for the
            logarithmic contact.
        damping_ratio, logarithmic_decrement, material_damping : float, optional
            Damping in contact, given by at most one of these parameters; ratio and decrement refer
            to the two gears without the rest of the train. If none is given, the damping is
            unknown, and only modes and statics can be computed.
        backlash_damping_ratio : float, default 0
            Damping ratio in free flight.
        model : {"teeth", "rectangle"}, default "teeth"
            "teeth": mean stiffness, excited by the transmission error of the teeth under the
            torque, with tip reliefs and corner contact, so that the mesh force is static at low
            speed. "rectangle": two levels of stiffness, as for parametric resonance.
        stiffness, options
            Method of the mesh stiffness and its options, see `GearPair.from_geometry`. The default
            for "rectangle" is "iso"; for "teeth" it is the energy method, or "iso" if a bore is too
            large for it. If an elastic `Shaft` already includes the twist of a gear body, set the
            option twist of the energy method to False for this gear, as in
            {"twist": (False, True)}.
        **fields
            Other fields of `Mesh`; they override the values from the geometry.
        """
        options = {name: fields.pop(name) for name in _STIFFNESS_AND_DAMPING if name in fields}
        geometry_fields = checks.check_gear_stage(stage).train_parameters(**options)
        return cls(pinion=pinion, wheel=wheel, **(geometry_fields | fields))

    @property
    def line(self) -> float:
        """Angle of the line of action, rad, counterclockwise from the x axis."""
        return self.line_angle(math.pi)

    def line_angle(self, pi: Any) -> Any:
        """Return the angle of the line of action in rad, counterclockwise from the x axis.

        It is `line_of_action` if that is given; otherwise it follows from the angle of the line of
        centres and the pressure angle. `pi` is the number pi as a float or, for a result with an
        error bound, as an interval that encloses pi.
        """
        if self.line_of_action is not None:
            return self.line_of_action
        return (self.position or 0.0) + self.direction * (pi / 2.0 + self._signed_pressure_angle)

    @property
    def centre_line_angle(self) -> float:
        """Angle of the line of centres, rad, counterclockwise from the x axis.

        If `line_of_action` is given, it follows from that angle; otherwise it is `position`, which
        is 0 by default.
        """
        if self.line_of_action is None:
            return self.position or 0.0
        return self.line_of_action - self.direction * (math.pi / 2.0 + self._signed_pressure_angle)

    @property
    def _signed_pressure_angle(self):
        """Pressure angle, rad, positive in an internal and negative in an external mesh."""
        return self.pressure_angle if self.internal else -self.pressure_angle

    @property
    def mean_stiffness(self):
        """Mean mesh stiffness C_s, N/m, Eq. (2)."""
        return self.max_stiffness * mean_over_max(self.contact_ratio, self.stiffness_ratio)

    @property
    def known_damping(self):
        """Damping in contact, N s/m; ValueError is raised if it is unknown."""
        return checks.require_damping(self.material_damping, f" of mesh {self.name}")

    @property
    def two_levels(self):
        """Whether the lower stiffness level differs from the upper one."""
        return self.stiffness_ratio < 1.0

    @property
    def varies(self):
        """Whether the stiffness changes within a mesh period."""
        return self.two_levels and 1.0 < self.contact_ratio < 2.0


@declared()
class HarmonicForce:
    """A harmonic force or torque on a body of a train; immutable.

    It is amplitude cos(order theta + phase), where theta is the phase of a mesh or the angle of a
    body.
    """

    body: Annotated[
        Text, described("Name of the body on which it acts, or of a coordinate of given matrices")
    ]
    amplitude: Annotated[Finite, described("Amplitude, N, or N m of a torque")]
    order: Annotated[
        int, Ge(1), Le(1000), INTEGER, described("Waves per mesh period or revolution")
    ]
    of: Annotated[Text, described("Name of the mesh or of the body to which the order refers")]
    axis: Annotated[
        Literal["rotation", "x", "y"],
        CHOICE,
        described("Force along x or y, or torque, positive counterclockwise"),
    ] = "rotation"
    phase: Annotated[Angle, described("Phase at the start")] = 0.0


def lies_in_housing(mesh: Mesh, bodies: dict) -> bool:
    """Return whether the axes of a mesh are fixed in the housing of a train with carriers.

    In such a train, positions refer to the frame that rotates with the carriers, so that axes in
    the housing move relative to this frame. `bodies` maps the names of all bodies to `Body`.
    """
    is_carried = bodies[mesh.pinion].carrier or bodies[mesh.wheel].carrier
    return not is_carried and any(body.carrier for body in bodies.values())


def check_names(train: Any) -> None:
    """Check the names in a `GearTrain`, the number of meshes and the supports.

    Raises ValueError if two bodies or two meshes have the same name, if a shaft, force, mesh or
    body refers to an unknown name, or if there are too many meshes. With gyroscopic forces,
    supports must be isotropic, because otherwise they would vary in the rotating frame.
    """
    for field in ("bodies", "meshes"):
        names = [element.name for element in getattr(train, field)]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(
                    f"{field} = {names!r} is not allowed: the name {name!r} occurs more than once"
                )
    if len(train.meshes) > _MAX_MESHES:
        raise ValueError(
            f"the number of meshes = {len(train.meshes)} is not allowed: it must be at most "
            f"{_MAX_MESHES}"
        )
    for shaft in train.shafts:
        for name in shaft.bodies:
            checks.check_choice("bodies of a shaft", name, train.body_names)
    for force in train.forces:
        coordinates = () if train.matrices is None else train.matrices.coordinates
        checks.check_choice("body of a force", force.body, (*train.body_names, *coordinates))
        checks.check_choice(
            "reference of a force", force.of, (*train.mesh_names, *train.body_names)
        )
    for mesh in train.meshes:
        wheel_key = f"wheel of mesh {mesh.name}"
        checks.check_choice(f"pinion of mesh {mesh.name}", mesh.pinion, train.body_names)
        checks.check_choice(wheel_key, mesh.wheel, train.body_names)
        allowed = "a body other than the pinion"
        checks.require(mesh.pinion != mesh.wheel, wheel_key, mesh.wheel, allowed)
    for body in train.bodies:
        if body.carrier is not None:
            carrier_key = f"carrier of body {body.name}"
            checks.check_choice(carrier_key, body.carrier, train.body_names)
            valid = body.carrier != body.name and train.by_name[body.carrier].carrier is None
            allowed = "another body that is not on a carrier itself"
            checks.require(valid, carrier_key, body.carrier, allowed)
        elif train.gyroscopic:
            is_isotropic = len(set(body.support_stiffness)) == len(set(body.support_damping)) == 1
            if not is_isotropic:
                raise ValueError(
                    f"support_stiffness of body {body.name} = {body.support_stiffness!r} is not "
                    "allowed: with gyroscopic forces, stiffness and damping of a support must be "
                    "the same along x and y"
                )


def check_gears(train: Any) -> None:
    """Raise ValueError if gears of a `GearTrain` cannot mesh, rotate or be assembled.

    Both gears of a mesh must have the same base pitch, and a ring gear must have more teeth than
    its pinion. If carriers rotate, gears with axes in the housing must have rigid supports.
    """
    for mesh in train.meshes:
        pinion, wheel = train.by_name[mesh.pinion], train.by_name[mesh.wheel]
        for body in (pinion, wheel):
            allowed = f"an integer >= 3, because it is in mesh {mesh.name}"
            checks.require(body.teeth is not None, f"teeth of body {body.name}", None, allowed)
        pitches = [2.0 * math.pi * body.base_radius / body.teeth for body in (pinion, wheel)]
        checks.require(
            abs(pitches[0] - pitches[1]) <= _PITCH_TOLERANCE * max(pitches),
            f"base_radius of body {wheel.name}",
            wheel.base_radius,
            f"{pinion.base_radius * wheel.teeth / pinion.teeth:.6g} to have the base pitch "
            f"(module) of {pinion.name} in mesh {mesh.name}",
        )
        valid = not mesh.internal or wheel.teeth > pinion.teeth
        allowed = f"more than the {pinion.teeth} teeth of {pinion.name}, which meshes inside it"
        checks.require(valid, f"teeth of body {wheel.name}", wheel.teeth, allowed)
        if train.carrier_ratio and lies_in_housing(mesh, train.by_name):
            allowed = f"infinite, because carriers rotate relative to the axes of mesh {mesh.name}"
            for body in (pinion, wheel):
                is_rigid = all(math.isinf(stiffness) for stiffness in body.support_stiffness)
                key = f"support_stiffness of body {body.name}"
                checks.require(is_rigid, key, body.support_stiffness, allowed)
    train.phases  # noqa: B018 (raises ValueError if the train is locked or cannot be assembled)
