"""Sections of gear trains: ready-made, drawn or of one's own parts; sweep, reducer, Campbell."""

import math
from typing import Any, Literal

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from gearlib import checks
from gearlib.config import types as t
from gearlib.config.gear_pair_section import rounded
from gearlib.config.gears_section import (
    BodyGear,
    GearSection,
    MethodSection,
    PinionSection,
    gear_of,
    in_keys,
)
from gearlib.config.types import OwnGrid, Recorded, Section, Started, entry, grid, like, several
from gearlib.models.geometry.drawings import planetary_meshes
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.geometry.mesh import Mesh, torque_of
from gearlib.models.trains import elements, planetary, ready_made
from gearlib.models.trains.planetary import planetary_set
from gearlib.parameters import DIAMETER, MODULE, TORQUE

_OF_RING = ("outer_diameter",)
_DAMPINGS = ("damping_ratio", "logarithmic_decrement", "material_damping", "backlash_damping_ratio")
_WORDS = "The ring gear of a planetary set; what it shares with the sun is the sun's by default."
RingSection = like("RingSection", _WORDS, SpurGear, *_OF_RING, base=GearSection, required=_OF_RING)
_WORDS = "Stiffness and damping of drawn meshes."
DrawnMesh = like("DrawnMesh", _WORDS, planetary_set, *_DAMPINGS, base=MethodSection)
_Set = like("_Set", "", planetary_set, base=DrawnMesh, without=("torque", *_DAMPINGS))
#: Keys of a mesh that suit drawn gears only, and the coefficient in place of ratios.
OF_DRAWN = {*DrawnMesh.model_fields, "torque", "centre_distance"}


class PlanetarySet(_Set):
    """Sun, planets and ring by their drawing. Arguments of `gearlib.geometry.planetary_set`."""

    sun: PinionSection
    planet: GearSection
    ring: RingSection
    torque: t.Torque = entry("Torque of the sun, N m; or power and speed.", None)
    power: t.Power = entry("Power of the sun, W.", None)
    speed: t.Speed = entry("Speed of the sun, rpm.", None)

    @model_validator(mode="after")
    def _check(self):
        sun, planet = gear_of(".sun", self.sun), gear_of(".planet", self.planet, self.sun)
        ring = gear_of(".ring", self.ring, self.sun, internal=True)
        keys = {name: f".{name}" for name in ("sun", "planet", "ring")}
        with in_keys("", self.stiffness_options, **keys):
            places = {"planets", "positions", "centre_distance", "backlashes"}
            planets = planetary_meshes(sun, planet, ring, **self.model_dump(include=places))
            arguments = self.arguments()
            names = {*DrawnMesh.model_fields, "options"} & arguments.keys()
            share = arguments["torque"] / len(planets.positions)
            for mesh in (planets.sun_mesh, planets.ring_mesh):
                # The sun carries its share, a planet the same force at its radius.
                mesh.train_parameters(
                    torque=share * mesh.pinion.teeth / sun.teeth,
                    load_argument=("torque", arguments["torque"], "N m"),
                    **{name: arguments[name] for name in names},
                )
        return self

    def arguments(self):
        """Return the arguments of `planetary_set` as plain values, gears as dicts."""
        torque = rounded(torque_of(self.torque, self.power, self.speed))
        arguments = self.model_dump(exclude={"power", "speed", "stiffness_options"})
        return arguments | self.stiffness_arguments() | {"torque": torque}


Planetary = like(
    "Planetary",
    "Sun, ring, carrier and planets, of Lin and Parker where left out.\n\n"
    "All keys are arguments of `gearlib.planetary`; gear_pair has no part in it.",
    planetary.planetary,
)
_WORDS = "Pinion, idler and wheel; both meshes are gear_pair. Arguments of `gearlib.idler`."
Idler = like("Idler", _WORDS, ready_made.idler)
_WORDS = "Two stages with a shaft; both meshes are gear_pair. Arguments of `gearlib.two_stage`."
TwoStage = like("TwoStage", _WORDS, ready_made.two_stage)
SplitPowerReducer = like(
    "SplitPowerReducer",
    "The paper's Fig. 1 a, every mesh a gear_pair. Arguments of `gearlib.split_power_reducer`.",
    ready_made.split_power_reducer,
)
_WORDS = "An elastic shaft between two bodies, see `gearlib.Shaft`."
ShaftPart = like("ShaftPart", _WORDS, elements.Shaft)
_Body = like("_Body", "", elements.Body, optional=("inertia", "base_radius"))


class BodyPart(_Body):
    """A gear or a carrier, see `gearlib.Body`."""

    gear: BodyGear = entry("Drawing, which gives its inertia and base radius.", None)

    @model_validator(mode="after")
    def _check(self):
        for key in ("inertia", "base_radius"):
            if self.gear is None and getattr(self, key) is None:
                raise PydanticCustomError("missing_key", "", {"key": key})
        return self


class Deviation(Section):
    """Deviation of the flanks over the mesh phase."""

    cosines: list[t.Error] = entry("Amplitudes of the cosines of orders 1, 2, ..., m.", [])
    sines: list[t.Error] = entry("Amplitudes of the sines of orders 1, 2, ..., m.", [])


_WORDS = "Centre distance of drawn gears, m. Default: without backlash by the shifts."
_LOADED = "Torque of the pinion, N m; the stiffness of drawn gears may need it."
MeshPart = like(
    "MeshPart",
    "Two gears in mesh, see `gearlib.Mesh`; stiffness, ratios, phases follow where both are drawn.",
    elements.Mesh,
    base=DrawnMesh,
    without=("material_damping",),
    optional=("max_stiffness", "stiffness_ratio", "contact_ratio"),
    centre_distance=(t.type_of(DIAMETER), entry(_WORDS, None)),
    torque=(t.type_of(TORQUE), entry(_LOADED, None)),
    deviation=(Deviation, entry("Deviation of the drive-side flanks.", None)),
    inverse_deviation=(Deviation, entry("Deviation of the coast-side flanks.", None)),
)


class Own(Section):
    """Bodies, shafts and meshes, arguments of `gearlib.GearTrain`."""

    bodies: list[BodyPart] = entry("The bodies.", [])
    shafts: list[ShaftPart] = entry("The shafts.", [])
    meshes: list[MeshPart] = entry("The meshes.", [])
    carrier_ratio: t.Finite = entry("Speed of the frame over that of the first pinion in it.", None)
    gyroscopic: t.Truth = entry("Whether the forces of the turning frame are felt.", None)

    @model_validator(mode="after")
    def _check(self):
        places = {x.name: f".bodies[{i}].gear" for i, x in enumerate(self.bodies) if x.gear}
        gears = {x.name: gear_of(places[x.name], x.gear) for x in self.bodies if x.gear}
        meshes: list[Any] = self.meshes
        for i, mesh in enumerate(meshes):
            key, pinion, wheel = f".meshes[{i}]", mesh.pinion, mesh.wheel
            if mesh.max_stiffness is not None or not {pinion, wheel} <= gears.keys():
                _check_numbers(key, mesh)
                continue
            arguments = mesh.model_dump(include=OF_DRAWN - MethodSection.model_fields.keys())
            distance = arguments.pop("centre_distance", None)
            arguments |= mesh.stiffness_arguments(key)
            with in_keys(key, mesh.stiffness_options, pinion=places[pinion], wheel=places[wheel]):
                Mesh(gears[pinion], gears[wheel], distance).train_parameters(**arguments)
        return self


def _check_numbers(key, mesh):
    """Refuse a mesh without stiffness, or with keys of drawn gears beside it."""
    for name in ("max_stiffness", "stiffness_ratio", "contact_ratio"):
        if getattr(mesh, name) is None:
            raise ValueError(
                f"{key}.{name} is missing: it must be given unless both gears are drawn"
            )
    allowed = "left out where the stiffness is given or a gear is not drawn"
    for name, value in mesh.model_dump(include=OF_DRAWN - {"material_damping"}).items():
        raise checks.refusal(f"{key}.{name}", value, allowed)


#: Kinds whose meshes are all a gear_pair with a damping.
PAIR_TRAINS = ("split_power_reducer", "idler", "two_stage")
Kind = Literal["split_power_reducer", "planetary", "idler", "two_stage", "own", "planetary_set"]


class Train(Section):
    """A gear train; `kind` says which of the sections below it is.

    Their keys are arguments of the functions of the library, which have the defaults. Ready-made
    trains but the planetary one make every mesh of gear_pair and a damping.
    """

    kind: Kind = entry("The section that describes the train.", "split_power_reducer")
    reference: t.Label = entry("Mesh that sets scales and tuning; the first if left out.", None)
    reference_frequency: t.quantity("Hz", "2 kHz", gt=0) = entry(
        "Frequency of the tuning 1, Hz; that of the mode that deforms the reference mesh most if "
        "left out.",
        None,
    )
    split_power_reducer: SplitPowerReducer = t.SECTION
    planetary: Planetary = t.SECTION
    idler: Idler = t.SECTION
    two_stage: TwoStage = t.SECTION
    own: Own = t.SECTION
    planetary_set: PlanetarySet = entry("Sun, planets and ring by their drawing.", None)

    @model_validator(mode="after")
    def _check(self):
        if self.kind == "planetary_set" and self.planetary_set is None:
            raise PydanticCustomError("missing_key", "", {"key": "planetary_set"})
        allowed = "a list of at least one entry where train.kind is own"
        for key in ("bodies", "meshes") if self.kind == "own" else ():
            checks.require(getattr(self.own, key), f".own.{key}", [], allowed)
        return self

    def arguments(self):
        """Return the arguments of the function or class of this kind as plain values."""
        keys = self.model_dump(include={self.kind, "reference", "reference_frequency"})
        if self.kind == "planetary_set":
            keys[self.kind] = self.planetary_set.arguments()
        return keys.pop(self.kind) | keys


class TrainSweep(Started, grid(0.5, 1.4, 0.01, OwnGrid), Recorded):
    """Every mesh of the train of the section `train` over speed; the target of this name."""

    damping: t.DampingName = None
    periods: t.Periods = 120
    record_periods: t.RecordPeriods = 12


class Reducer(Started, grid(0.74, 1.84, 0.02, OwnGrid), Recorded):
    """Fig. 1 a: three double satellites between central gears, the gear pair as every mesh."""

    damping: t.DampingName = None
    teeth: several(t.whole(3, 1000), 4) = entry("Teeth from input to output.", [24, 36, 24, 36])
    modules: several(t.type_of(MODULE), 2) = entry(
        "Modules of both stages, m; the centre distances must be equal.", [0.004, 0.004]
    )
    shaft_stiffness: t.quantity("N m/rad", "1e6 N m/rad", gt=0) = entry(
        "Torsional stiffness of a satellite's shaft, N m/rad.", 1e6
    )
    support_stiffness: t.Stiffness = entry(
        "Stiffness of the supports of all axes, N/m. Default: 2.5 max_stiffness.", None
    )
    damping_ratio: t.number(ge=0, le=1) = entry(
        "Damping ratio of supports and shafts, at the mean eigenfrequency of the pair.", 0.03
    )
    pin_error: several(t.Error, 2) = entry(
        "Displacement of the first satellite's axis in one case, radial and tangential, m. "
        "Default: a static deflection outwards.",
        None,
    )
    backlashes: several(t.Backlash, 3) = entry(
        "Backlash of each branch in one case, m. Default: a quarter in the first.", None
    )
    periods: t.Periods = 210
    record_periods: t.RecordPeriods = 42

    @model_validator(mode="after")
    def _check(self):
        sums = self.teeth[0] + self.teeth[1], self.teeth[2] + self.teeth[3]
        first, second = (m * z / 2.0 for m, z in zip(self.modules, sums, strict=True))
        allowed = (
            f"of stages with one centre distance, and with .modules = {self.modules!r} it is "
            f"{first:.6g} m in the first, {second:.6g} m in the second"
        )
        fits = math.isclose(first, second, rel_tol=1e-9)
        checks.require(fits, ".teeth", self.teeth, allowed)
        return self


class Campbell(Section):
    """Campbell diagram of the reducer whose branches are alike."""

    orders: t.whole(1, 20) = entry("Highest order of each mesh frequency.", 3)
