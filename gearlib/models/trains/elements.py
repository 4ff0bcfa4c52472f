"""What a gear train is made of: bodies, shafts and meshes, in SI units.

A body turns about its axis and, where its support is elastic, moves in two directions. Angles and
torques count counterclockwise; the rotation is the arc length u = base_radius theta, with the mass
inertia / base_radius^2. See `gearlib.models.trains` for the functionals of the elements.
"""

import math
from dataclasses import dataclass, field

from gearlib import checks
from gearlib.models.harmonics import Harmonics
from gearlib.models.stiffness import mean_over_max

#: Arguments of `Mesh.from_geometry` by which others are derived.
_OF_DRAWING = (
    "torque",
    "damping_ratio",
    "logarithmic_decrement",
    "material_damping",
    "backlash_damping_ratio",
    "stiffness",
    "options",
)


@dataclass(frozen=True, kw_only=True)
class Body:
    """A gear or a carrier of a `GearTrain`; immutable.

    Parameters
    ----------
    name : str
    inertia : float
        About its axis, kg m^2; finite, > 0.
    base_radius : float
        m; of a carrier the radius of the circle of its pins; finite, > 0.
    teeth : int, optional
        >= 3; none for a carrier.
    mass : float, optional
        kg, > 0; needed where the axis can move.
    support_stiffness : float or pair of float, default infinite
        Along x and y, N/m; >= 0, infinity: rigid. A body on a carrier: radial and tangential.
    support_damping : float or pair of float, default 0
        N s/m; finite, >= 0.
    torsional_stiffness : float, default 0
        Of a support against rotation, N m/rad; >= 0, infinity: the body does not turn.
    torsional_damping : float, default 0
        N m s/rad; finite, >= 0.
    torque : float, default 0
        Constant, N m, counterclockwise.
    eccentricity, eccentricity_phase : float, default 0
        Run-out of the base circle, m, >= 0, and its direction at the start, rad; of a body on a
        carrier from the radius of its pin.
    offset : pair of float, default (0, 0)
        By how much the axis is misplaced, m: an error of a pin or bore.
    carrier : str, optional
        Name of the body that carries the axis.
    angle : float, default 0
        Of the pin on the carrier, rad.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    name: str
    inertia: float
    base_radius: float
    teeth: int | None = None
    mass: float | None = None
    support_stiffness: tuple = (math.inf, math.inf)
    support_damping: tuple = (0.0, 0.0)
    torsional_stiffness: float = 0.0
    torsional_damping: float = 0.0
    torque: float = 0.0
    eccentricity: float = 0.0
    eccentricity_phase: float = 0.0
    offset: tuple = (0.0, 0.0)
    carrier: str | None = None
    angle: float = 0.0

    def __post_init__(self):
        _text("name of a body", self.name)
        put = _Setter(self, f"of body {self.name}")
        put("inertia", checks.finite_positive)
        put("base_radius", checks.finite_positive)
        put.pair("support_stiffness", _stiffness)
        put.pair("support_damping", checks.finite_nonnegative)
        put.pair("offset", _finite)
        put("torsional_stiffness", _stiffness)
        for name in ("torsional_damping", "eccentricity"):
            put(name, checks.finite_nonnegative)
        for name in ("torque", "eccentricity_phase", "angle"):
            put(name, _finite)
        if self.teeth is not None:
            put("teeth", lambda name, value: checks.integer(name, value, 3))
        if self.mass is not None:
            put("mass", checks.finite_positive)
        if self.mass is None and not all(map(math.isinf, self.support_stiffness)):
            raise ValueError(
                f"mass of body {self.name} = None is not allowed: it must be a finite number > 0 "
                "where the support is elastic"
            )
        if self.carrier is not None:
            _text(f"carrier of body {self.name}", self.carrier)
        if self.eccentricity and self.teeth is None:
            raise ValueError(
                f"eccentricity of body {self.name} = {self.eccentricity!r} is not allowed: it must "
                "be 0 for a body without teeth"
            )

    @classmethod
    def from_gear(cls, gear, name, **more):
        """Return a drawn gear: its teeth, base radius, mass and inertia.

        Parameters
        ----------
        gear : gearlib.geometry.SpurGear
        name : str
        **more
            Other parameters, also in place of these.
        """
        if not hasattr(gear, "base_diameter"):
            raise ValueError(
                f"gear = {gear!r} is not allowed: it must be a gearlib.geometry.SpurGear"
            )
        own = {"teeth": gear.teeth, "base_radius": gear.base_diameter / 2.0}
        for key in ("mass", "inertia"):
            if key not in more:
                own[key] = getattr(gear, key)
        return cls(name=name, **(own | more))


@dataclass(frozen=True, kw_only=True)
class Shaft:
    """An elastic shaft that joins two bodies; immutable.

    Parameters
    ----------
    bodies : pair of str
        Their names.
    stiffness : float
        Against torsion, N m/rad; finite, > 0.
    damping : float, default 0
        N m s/rad; finite, >= 0.
    bending_stiffness : float, default 0
        Between the displacements of both bodies, the same along x and y, N/m; finite, >= 0.
    bending_damping : float, default 0
        N s/m; finite, >= 0.
    keying : float, optional
        Angle from a tooth of the first gear to one of the second, from middle to middle, rad,
        counterclockwise; by default 0, teeth in line, or what loops of meshes ask for.
    """

    bodies: tuple
    stiffness: float
    damping: float = 0.0
    bending_stiffness: float = 0.0
    bending_damping: float = 0.0
    keying: float | None = None

    def __post_init__(self):
        names = self.bodies
        if (
            not isinstance(names, (tuple, list))
            or len(names) != 2
            or not all(isinstance(name, str) for name in names)
            or names[0] == names[1]
        ):
            raise ValueError(
                f"bodies of a shaft = {names!r} is not allowed: it must be the names of two bodies"
            )
        object.__setattr__(self, "bodies", tuple(names))
        put = _Setter(self, f"of shaft {names[0]}-{names[1]}")
        put("stiffness", checks.finite_positive)
        for name in ("damping", "bending_stiffness", "bending_damping"):
            put(name, checks.finite_nonnegative)
        if self.keying is not None:
            put("keying", _finite)


@dataclass(frozen=True, kw_only=True)
class Mesh:
    """Two gears in mesh; immutable.

    Parameters
    ----------
    pinion, wheel : str
        Names of the bodies; of an internal mesh the wheel is the ring gear.
    max_stiffness, stiffness_ratio, contact_ratio : float
        C_max in N/m, kappa in (0, 1], epsilon in [1, 2], as of a `GearPair`.
    name : str, optional
        By default ``pinion-wheel``.
    internal : bool, default False
    position : float, optional
        Angle of the line of centres, rad: from the pinion to the wheel; internal: from the axis of
        the wheel to that of the pinion. 0 by default.
    pressure_angle : float, default 20 degrees
        In operation, rad, in [0, pi / 2).
    line_of_action : float, optional
        Angle, rad, of the direction in which the mesh presses against the gear at which the
        position begins; in place of `position`.
    direction : {1, -1}, default 1
        Which flanks are the drive side: 1, if they touch when the gear at which the position begins
        is turned counterclockwise.
    driving : str, optional
        Name of the gear, pinion or wheel, that drives through the drive-side flanks; decides in
        which sense the train turns. Where no mesh says so, the reference mesh's pinion drives.
    phase : float, optional
        By how many of its mesh periods the stiffness comes after that of the reference mesh; by
        default as tooth numbers, positions, `tooth_thickness` and `pitch_phase` have it.
    inverse_phase : float, optional
        The same of the coast-side flanks; by default as `tooth_thickness` and `pitch_phase` have
        it, or `phase` where no thickness is given.
    backlash : float, default infinite
        m, >= 0.
    material_damping, backlash_damping : float, default 0
        In contact and in the backlash, N s/m; finite, >= 0.
    deviation, inverse_deviation : Harmonics
        m, over the phase of this mesh, of drive-side and coast-side flanks; by default none, and
        that of the drive side.
    error : float, default 0
        Constant displacement along the line of action, m: an error of assembly.
    friction : pair of float, default (0, 0)
        Coefficients in normal and inverse mesh, >= 0. The force acts on the axes across the line of
        action, against the sliding, which turns at the pitch point and half a mesh period later.
    pitch_phase : float, default 0
        Phase of this mesh at which drive-side flanks touch at the pitch point, rad, when the pinion
        drives; it counts negative where the wheel does. Those of the coast side do a tooth
        thickness later or earlier.
    tooth_thickness : pair of float, optional
        Of pinion and wheel on their working circles, in pitches, in (0, 1); by default half a
        pitch.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    pinion: str
    wheel: str
    max_stiffness: float
    stiffness_ratio: float
    contact_ratio: float
    name: str | None = None
    internal: bool = False
    position: float | None = None
    pressure_angle: float = math.radians(20.0)
    line_of_action: float | None = None
    direction: int = 1
    driving: str | None = None
    phase: float | None = None
    inverse_phase: float | None = None
    backlash: float = math.inf
    material_damping: float = 0.0
    backlash_damping: float = 0.0
    deviation: Harmonics = field(default_factory=Harmonics)
    inverse_deviation: Harmonics | None = None
    error: float = 0.0
    friction: tuple = (0.0, 0.0)
    pitch_phase: float = 0.0
    tooth_thickness: tuple | None = None

    def __post_init__(self):
        for name in ("pinion", "wheel"):
            _text(f"{name} of a mesh", getattr(self, name))
        if self.name is None:
            object.__setattr__(self, "name", f"{self.pinion}-{self.wheel}")
        _text("name of a mesh", self.name)
        put = _Setter(self, f"of mesh {self.name}")
        put("max_stiffness", checks.finite_positive)
        put("stiffness_ratio", _number("> 0 and <= 1", lambda v: 0.0 < v <= 1.0))
        put("contact_ratio", _number("from 1 to 2", lambda v: 1.0 <= v <= 2.0))
        put("pressure_angle", _number("from 0 to below pi / 2", lambda v: 0.0 <= v < math.pi / 2))
        put("backlash", _number(">= 0 (infinity included)", lambda v: v >= 0.0))
        put("internal", lambda name, value: checks.one_of(name, value, (False, True)))
        put("direction", lambda name, value: checks.one_of(name, value, (1, -1)))
        for name in ("material_damping", "backlash_damping"):
            put(name, checks.finite_nonnegative)
        for name in ("error", "pitch_phase"):
            put(name, _finite)
        for name in ("position", "line_of_action", "phase", "inverse_phase"):
            if getattr(self, name) is not None:
                put(name, _finite)
        put.pair("friction", checks.finite_nonnegative)
        if self.tooth_thickness is not None:
            put.pair("tooth_thickness", _number("> 0 and < 1", lambda v: 0.0 < v < 1.0))
        if self.driving is not None:
            put("driving", lambda name, v: checks.one_of(name, v, (self.pinion, self.wheel)))
        if self.inverse_deviation is None:
            object.__setattr__(self, "inverse_deviation", self.deviation)
        for name in ("deviation", "inverse_deviation"):
            if not isinstance(getattr(self, name), Harmonics):
                raise ValueError(
                    f"{name} of mesh {self.name} = {getattr(self, name)!r} is not allowed: it must "
                    "be Harmonics"
                )
        if self.line_of_action is not None and self.position is not None:
            raise ValueError(
                f"line_of_action of mesh {self.name} = {self.line_of_action!r} is not allowed: it "
                "must be left out where position is given"
            )

    @classmethod
    def from_geometry(cls, mesh, pinion, wheel, **more):
        """Return a drawn mesh: stiffness, contact ratio, backlash, pressure angle and phases.

        Parameters
        ----------
        mesh : gearlib.geometry.Mesh
        pinion, wheel : str
            Names of the bodies.
        torque : float, optional
            Of its pinion, N m; matters to "iso" at low load and to the logarithmic contact.
        damping_ratio, logarithmic_decrement, material_damping : float, optional
            Damping in contact, one of them at most; ratios are those of both gears by themselves,
            see `GearPair.from_geometry`.
        backlash_damping_ratio : float, default 0
        stiffness, options
            As of `GearPair.from_geometry`.
        **more
            Other parameters, also in place of what is derived.
        """
        drawn = {name: more.pop(name) for name in _OF_DRAWING if name in more}
        return cls(
            pinion=pinion, wheel=wheel, **(checks.drawn_mesh(mesh).train_parameters(**drawn) | more)
        )

    @property
    def line(self):
        """Angle of the line of action, rad."""
        if self.line_of_action is not None:
            return self.line_of_action
        return (self.position or 0.0) + self.direction * (math.pi / 2.0 + self._tilt)

    @property
    def centres(self):
        """Angle of the line of centres, rad, see `position`."""
        if self.line_of_action is None:
            return self.position or 0.0
        return self.line_of_action - self.direction * (math.pi / 2.0 + self._tilt)

    @property
    def _tilt(self):
        return self.pressure_angle if self.internal else -self.pressure_angle

    @property
    def mean_stiffness(self):
        """C_s, N/m, Eq. (2)."""
        return self.max_stiffness * mean_over_max(self.contact_ratio, self.stiffness_ratio)

    @property
    def varies(self):
        """Whether the stiffness has two levels in a mesh period."""
        return self.stiffness_ratio < 1.0 and 1.0 < self.contact_ratio < 2.0


class _Setter:
    """Checks the fields of one element and sets them to plain values."""

    def __init__(self, element, words):
        self.element, self.words = element, words

    def __call__(self, name, check):
        value = check(f"{name} {self.words}", getattr(self.element, name))
        object.__setattr__(self.element, name, value)

    def pair(self, name, check):
        values, key = getattr(self.element, name), f"{name} {self.words}"
        if not isinstance(values, (tuple, list)):
            values = (values, values)
        if len(values) != 2:
            raise ValueError(f"{key} = {values!r} is not allowed: it must be one or two numbers")
        checked = tuple(check(f"{key}, {axis}", v) for axis, v in zip("xy", values, strict=True))
        object.__setattr__(self.element, name, checked)


def _number(allowed, accept):
    return lambda name, value: checks.number(name, value, allowed, accept)


_finite = _number("finite", math.isfinite)
_stiffness = _number(">= 0 (infinity: rigid)", lambda value: value >= 0.0)


def _text(name, value):
    if not isinstance(value, str) or not value:
        raise ValueError(f"{name} = {value!r} is not allowed: it must be a text")
