"""Sections for gear trains (ready-made, given by geometry or user-defined), sweeps and reducers."""

import math
from typing import Any, Literal

from pydantic import model_validator

from gearlib import checks
from gearlib import parameters as p
from gearlib.config import types as t
from gearlib.config.gear_pair_section import round_floats
from gearlib.config.gears_section import (
    BodyGear,
    GearSection,
    MethodSection,
    PinionSection,
    WheelSection,
    create_spur_gear,
)
from gearlib.config.types import Section, create_section, field, grid_with_defaults, list_of
from gearlib.models.geometry.from_values import build_planetary_meshes
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.gear_stage import GearStage, resolve_torque
from gearlib.models.trains import elements, planetary, ready_made
from gearlib.models.trains.planetary import planetary_set
from gearlib.parameters import Diameter, Module, RunOut, Torque

_RING_KEYS = ("outer_diameter",)
_DAMPINGS = ("damping_ratio", "logarithmic_decrement", "material_damping", "backlash_damping_ratio")
_DOC = "The ring gear of a planetary set; omitted common values are taken from the sun."
RingSection = create_section(
    "RingSection", _DOC, SpurGear, *_RING_KEYS, base=GearSection, required=_RING_KEYS
)
_MESH_KEYS = ("model", *_DAMPINGS)
_DOC = "Stiffness and damping of meshes of gears given by geometry."
GeometryMesh = create_section("GeometryMesh", _DOC, planetary_set, *_MESH_KEYS, base=MethodSection)
_Set = create_section(
    "_Set", "", planetary_set, base=GeometryMesh, exclude=("torque", "stages", *_MESH_KEYS)
)
_Stage = create_section("_Stage", "", planetary.ParallelStage, exclude=("stage",))
#: Keys of a mesh of gears given by geometry, among them material_damping instead of a ratio.
GEOMETRY_KEYS = {*GeometryMesh.model_fields, "torque", "centre_distance"}


def _use_rectangular_stiffness(arguments: dict) -> dict:
    """Return the arguments of `GearStage.train_parameters` for a rectangular mesh stiffness.

    A stiffness that alternates between two values is faster to check than the model "teeth": it
    requires no transmission error and, with the stiffness of ISO 6336, no NumPy.
    """
    has_teeth = arguments.get("model", "teeth") == "teeth"
    # Options of the model "teeth" belong to the energy method, not to ISO 6336.
    method = {"stiffness": "energy"} if has_teeth and arguments.get("options") else {}
    return method | arguments | {"model": "rectangle"}


class ParallelStage(_Stage):
    """Two gears with fixed axes, one of them on a shaft of the planetary set.

    See `gearlib.geometry.ParallelStage`.
    """

    pinion: PinionSection
    wheel: WheelSection
    centre_distance: Diameter = field("Centre distance, m. Default: zero backlash.", None)
    backlash: RunOut = field("Normal backlash, m. Default: computed from the geometry.", None)


class PlanetarySet(_Set):
    """Sun, planets and ring given by geometry. Arguments of `gearlib.geometry.planetary_set`."""

    sun: PinionSection
    planet: GearSection
    ring: RingSection
    torque: p.DrivingTorque = field("Torque of the sun, N m; or power and speed.", None)
    power: p.Power = field("Power of the sun, W.", None)
    speed: p.Speed = field("Speed of the sun, rpm.", None)
    stages: list[ParallelStage] = field("Parallel stages on the shafts of sun or carrier.", [])

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if the gears, positions or meshes of the planetary set are impossible.

        The meshes are checked with a rectangular stiffness, because this is fast. Return the
        section itself, as pydantic requires.
        """
        sun = create_spur_gear("sun", self.sun)
        planet = create_spur_gear("planet", self.planet, self.sun)
        ring = create_spur_gear("ring", self.ring, self.sun, internal=True)
        with checks.prefix_error_paths("", **self.option_keys()):
            layout_keys = {"planets", "positions", "centre_distance", "backlashes"}
            planets = build_planetary_meshes(
                sun, planet, ring, **self.model_dump(include=layout_keys)
            )
            arguments = self.arguments()
            mesh_keys = {*GeometryMesh.model_fields, "options"} & arguments.keys()
            mesh_arguments = _use_rectangular_stiffness({key: arguments[key] for key in mesh_keys})
            torque = arguments["torque"]
            sun_mesh_torque = torque / len(planets.positions)
            for mesh in (planets.sun_mesh, planets.ring_mesh):
                # Both meshes of a planet transmit the same force.
                pinion_torque = sun_mesh_torque * mesh.pinion.teeth / sun.teeth
                mesh_arguments["torque"] = pinion_torque
                # Called only to raise errors, which name the torque of the sun in the file.
                mesh.train_parameters(load_argument=("torque", torque, "N m"), **mesh_arguments)
        return self

    def arguments(self):
        """Return the arguments of `planetary_set` as a dict; the gears are dicts, too.

        If power and speed are given, they are replaced by the torque of the sun, N m.
        """
        torque = round_floats(resolve_torque(self.torque, self.power, self.speed))
        arguments = self.model_dump(exclude={"power", "speed", "stiffness_options"})
        return arguments | self.stiffness_arguments() | {"torque": torque}


Planetary = create_section(
    "Planetary",
    "Sun, ring, carrier and planets; omitted values are those of Lin and Parker.\n\n"
    "All keys are arguments of `gearlib.planetary`; gear_pair is not used.",
    planetary.planetary,
)
_DOC = "Pinion, idler and wheel; both meshes are gear_pair. Arguments of `gearlib.idler`."
Idler = create_section("Idler", _DOC, ready_made.idler)
_DOC = "Two stages on a shaft; both meshes are gear_pair. Arguments of `gearlib.two_stage`."
TwoStage = create_section("TwoStage", _DOC, ready_made.two_stage)
SplitPowerReducer = create_section(
    "SplitPowerReducer",
    "The paper's Fig. 1 a; all meshes are gear_pair. Arguments of `gearlib.split_power_reducer`.",
    ready_made.split_power_reducer,
)
_DOC = "An elastic shaft between two bodies, see `gearlib.Shaft`."
ShaftPart = create_section("ShaftPart", _DOC, elements.Shaft)
_DOC = "A harmonic force or torque on a body, see `gearlib.HarmonicForce`."
ForcePart = create_section("ForcePart", _DOC, elements.HarmonicForce)
_Body = create_section("_Body", "", elements.Body, optional=("inertia", "base_radius"))


class BodyPart(_Body):
    """A gear or a carrier, see `gearlib.Body`."""

    gear: BodyGear = field("Geometry, from which inertia and base radius are computed.", None)

    @model_validator(mode="after")
    def _check(self):
        """Raise an error if a body without gear geometry has no inertia or no base radius."""
        for key in ("inertia", "base_radius"):
            if self.gear is None and getattr(self, key) is None:
                raise self.missing_key_error(key)
        return self


class Deviation(Section):
    """Deviation of the flanks over the mesh phase."""

    cosines: list[p.Error] = field("Amplitudes of the cosines of orders 1, 2, ..., m.", [])
    sines: list[p.Error] = field("Amplitudes of the sines of orders 1, 2, ..., m.", [])


_DOC = "Centre distance of gears given by geometry, m. Default: zero backlash."
_TORQUE_DOC = "Torque of the pinion if both gears have a geometry, N m. Default: from the bodies."
MeshPart = create_section(
    "MeshPart",
    "Two gears in mesh, see `gearlib.Mesh`. If both bodies have a `gear`, stiffness, ratios and "
    "phases are computed from the geometry.",
    elements.Mesh,
    base=GeometryMesh,
    exclude=("material_damping",),
    optional=("max_stiffness", "stiffness_ratio", "contact_ratio"),
    centre_distance=(Diameter, field(_DOC, None)),
    torque=(Torque, field(_TORQUE_DOC, None)),
    deviation=(Deviation, field("Deviation of the drive-side flanks.", None)),
    coast_deviation=(Deviation, field("Deviation of the coast-side flanks.", None)),
    transmission_error=(
        Deviation,
        field("Transmission error of the loaded teeth, without its mean.", None),
    ),
)


class Own(Section):
    """Bodies, shafts and meshes: arguments of `gearlib.GearTrain`."""

    bodies: list[BodyPart] = field("The bodies.", [])
    shafts: list[ShaftPart] = field("The shafts.", [])
    meshes: list[MeshPart] = field("The meshes.", [])
    forces: list[ForcePart] = field("Harmonic forces and torques on bodies.", [])
    modal_damping: list[p.BelowCritical] = field(
        "Damping ratios of the elastic modes, one for each or one for all.", None
    )
    carrier_ratio: p.Finite = field(
        "Speed of the rotating frame over the speed of the first pinion in this frame.", None
    )
    gyroscopic: p.Boolean = field(
        "Whether Coriolis and centrifugal forces of the rotating frame are included.", None
    )

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if a gear given by geometry or a mesh of the train is impossible.

        A mesh of two gears given by geometry is computed for this purpose. Any other mesh must have
        a stiffness in the file.
        """
        gear_keys, gears = {}, {}
        for i, body in enumerate(self.bodies):
            if body.gear:
                gear_keys[body.name] = f"bodies[{i}].gear"
                gears[body.name] = create_spur_gear(gear_keys[body.name], body.gear)
        meshes: list[Any] = self.meshes
        for i, mesh in enumerate(meshes):
            key, pinion, wheel = f"meshes[{i}]", mesh.pinion, mesh.wheel
            if mesh.max_stiffness is not None or not {pinion, wheel} <= gears.keys():
                _check_mesh_without_geometry(key, mesh)
                continue
            # Keys of the stiffness method differ from the argument names; `stiffness_arguments`
            # converts them.
            arguments = mesh.model_dump(include=GEOMETRY_KEYS - MethodSection.model_fields.keys())
            distance = arguments.pop("centre_distance", None)
            arguments = _use_rectangular_stiffness(arguments | mesh.stiffness_arguments())
            # Names in errors -> configuration keys.
            config_keys = {"pinion": gear_keys[pinion], "wheel": gear_keys[wheel]}
            config_keys |= mesh.option_keys(f"{key}.")
            config_keys["outer_diameter"] = f"{gear_keys[wheel]}.outer_diameter"
            with checks.prefix_error_paths(key, **config_keys):
                # Called only to raise errors; the train computes the parameters again.
                GearStage(gears[pinion], gears[wheel], distance).train_parameters(**arguments)
        return self


def _check_mesh_without_geometry(mesh_key: str, mesh: Any) -> None:
    """Raise ValueError if a mesh has no stiffness, or has keys that require gear geometry.

    `mesh_key` is the configuration key of the section `mesh`, for error messages.
    """
    for key in ("max_stiffness", "stiffness_ratio", "contact_ratio"):
        if getattr(mesh, key) is None:
            problem = "is missing: it is required unless both gears have a geometry"
            raise checks.InputError(f"{mesh_key}.{key}", problem=problem)
    allowed = "omitted if the stiffness is given or a gear has no geometry"
    geometry_values = mesh.model_dump(include=GEOMETRY_KEYS - {"material_damping"})
    for key, value in geometry_values.items():
        # None of these keys is allowed; the error names the first one.
        raise checks.InputError(f"{mesh_key}.{key}", value, allowed)


#: Kinds of trains in which every mesh is the gear pair, with one of the dampings.
PAIR_TRAINS = ("split_power_reducer", "idler", "two_stage")
Kind = Literal["split_power_reducer", "planetary", "idler", "two_stage", "own", "planetary_set"]


class Train(Section):
    """A gear train, described by the section with the name `kind`.

    The keys of this section are arguments of a function of the library, which defines the defaults.
    In all ready-made trains except the planetary ones, every mesh is gear_pair with a damping.
    """

    kind: Kind = field("The section that describes the train.", "split_power_reducer")
    reference: t.Label = field(
        "Reference mesh for scales and tuning. Default: the first mesh.", None
    )
    reference_frequency: t.quantity("Hz", "2 kHz", gt=0) = field(
        "Frequency at tuning 1, Hz. Default: the natural frequency of the mode with the most "
        "strain energy in the reference mesh.",
        None,
    )
    split_power_reducer: SplitPowerReducer = t.SECTION
    planetary: Planetary = t.SECTION
    idler: Idler = t.SECTION
    two_stage: TwoStage = t.SECTION
    own: Own = t.SECTION
    planetary_set: PlanetarySet = field("Sun, planets and ring given by geometry.", None)

    @model_validator(mode="after")
    def _check(self):
        """Raise an error if the section that describes the train is missing or empty.

        The kind "own" is a train of user-defined bodies and meshes, with at least one of each.
        """
        if self.kind == "planetary_set" and self.planetary_set is None:
            raise self.missing_key_error("planetary_set")
        if self.kind == "own":
            allowed = "a list with at least one entry, because train.kind is own"
            for key in ("bodies", "meshes"):
                checks.require(getattr(self.own, key), f"own.{key}", [], allowed)
        return self

    def description(self):
        """Return a dict with the `kind` of the train, and the `arguments` with which it is built.

        The arguments include the name of the reference mesh and the reference frequency, Hz, if
        given.
        """
        section = getattr(self, self.kind)
        arguments = section.arguments() if self.kind == "planetary_set" else section.model_dump()
        arguments |= self.model_dump(include={"reference", "reference_frequency"})
        return {"kind": self.kind, "arguments": arguments}


class GearboxSection(Section):
    """A gearbox in a REXS file, see `gearlib.read_gearbox`: its stages and the whole gearbox."""

    file: t.text(
        "the path of a REXS file", pattern=r"(?i)\.(rexs|rexsj|rexsz|rexs\.zip|xml|json)$"
    ) = field("Path of the file: .rexs, .rexsj, .rexsz or .rexs.zip.")
    damping_ratio: t.number(gt=0, lt=1) = field("Damping ratio of each mesh.", 0.05)
    points: t.integer(2, 10_000) = field("Number of speeds in the curves of each stage.", 101)
    orders: t.integer(1, 20) = field("Highest multiple of each mesh frequency.", 3)
    revolutions: t.integer(1, 100_000) = field("Number of revolutions of the run-up.", 60)


class TrainFile(Section):
    """A file that contains only a train, see `gearlib.read_train`."""

    train: Train


class TrainSweep(
    t.IncreasingStarts, grid_with_defaults(0.5, 1.4, 0.01, t.NumericGrid), t.RecordedPeriods
):
    """Sweep of the gear train in the section `train` over speed, for the target train_sweep."""

    damping: t.DampingName = None
    periods: t.Periods = 120
    record_periods: t.RecordPeriods = 12


class Reducer(
    t.IncreasingStarts, grid_with_defaults(0.74, 1.84, 0.02, t.NumericGrid), t.RecordedPeriods
):
    """Fig. 1 a: three double satellites between central gears; every mesh is the gear pair."""

    damping: t.DampingName = None
    teeth: list_of(t.integer(3, 1000), 4) = field(
        "Numbers of teeth from input to output.", [24, 36, 24, 36]
    )
    modules: list_of(Module, 2) = field(
        "Modules of the two stages, m; both must have the same centre distance.", [0.004, 0.004]
    )
    shaft_stiffness: t.quantity("N m/rad", "1e6 N m/rad", gt=0) = field(
        "Torsional stiffness of the shaft of each satellite, N m/rad.", 1e6
    )
    support_stiffness: p.Stiffness = field(
        "Stiffness of the supports of all axes, N/m. Default: 2.5 max_stiffness.", None
    )
    damping_ratio: t.number(ge=0, le=1) = field(
        "Damping ratio of supports and shafts, at the mean eigenfrequency of the pair.", 0.03
    )
    pin_error: list_of(p.Error, 2) = field(
        "Radial and tangential displacement of the axis of the first satellite in one case, m. "
        "Default: one static deflection outwards.",
        None,
    )
    backlashes: list_of(p.Backlash, 3) = field(
        "Backlash of each branch in one case, m. Default: the backlash of gear_pair, but a quarter "
        "of it in the first branch.",
        None,
    )
    periods: t.Periods = 210
    record_periods: t.RecordPeriods = 42

    @model_validator(mode="after")
    def _check(self):
        """Raise ValueError if the two stages have different centre distances.

        They must be equal, because the two gears of a satellite have the same axis.
        """
        teeth, (first_module, second_module) = self.teeth, self.modules
        first_distance = first_module * (teeth[0] + teeth[1]) / 2.0
        second_distance = second_module * (teeth[2] + teeth[3]) / 2.0
        allowed = (
            f"such that both stages have one centre distance, but with modules = {self.modules!r} "
            f"it is {first_distance:.6g} m in the first, {second_distance:.6g} m in the second"
        )
        are_equal = math.isclose(first_distance, second_distance, rel_tol=1e-9)
        checks.require(are_equal, "teeth", teeth, allowed)
        return self


class Campbell(Section):
    """Campbell diagram of the reducer with identical branches."""

    orders: t.integer(1, 20) = field("Highest multiple of each mesh frequency.", 3)
