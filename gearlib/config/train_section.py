"""Sections of gear trains: ready-made, drawn or of one's own parts; sweep, reducer, Campbell."""

from typing import Literal

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from gearlib.config import gears_section
from gearlib.config.gears_section import (
    BodyGear,
    GearSection,
    MethodSection,
    PinionSection,
    Power,
    Speed,
    Torque,
)
from gearlib.config.types import (
    Backlash,
    DampingName,
    Diameter,
    Error,
    Finite,
    Given,
    Label,
    OwnStart,
    OwnStep,
    OwnStop,
    Periods,
    Recorded,
    RecordPeriods,
    Section,
    Share,
    Started,
    Stiffness,
    Truth,
    entry,
    like,
    numbers,
    quantity,
    type_of,
    whole,
)
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.trains import elements, planetary, ready_made
from gearlib.models.trains.planetary import planetary_set
from gearlib.parameters import MODULE, TORQUE

_OF_RING = ("outer_diameter",)
_DAMPINGS = ("damping_ratio", "logarithmic_decrement", "material_damping", "backlash_damping_ratio")


_WORDS = "The ring gear of a planetary set; what it shares with the sun is the sun's by default."
RingSection = like("RingSection", _WORDS, SpurGear, *_OF_RING, base=GearSection, required=_OF_RING)
_WORDS = "Stiffness and damping of drawn meshes."
DampingByRatio = like("DampingByRatio", _WORDS, planetary_set, *_DAMPINGS, base=MethodSection)
_Set = like("_Set", "", planetary_set, base=DampingByRatio, without=("torque", *_DAMPINGS))


class PlanetarySet(_Set):
    """Sun, planets and ring by their drawing. Arguments of `gearlib.geometry.planetary_set`."""

    sun: PinionSection
    planet: GearSection
    ring: RingSection
    torque: Torque = entry("Of the sun, N m; or power and speed.", None)
    power: Power = entry("Of the sun, W.", None)
    speed: Speed = entry("Of the sun, rpm.", None)

    @model_validator(mode="after")
    def _check(self):
        check_planets("train.planetary_set", self)
        return self

    def arguments(self):
        """Return the arguments of `planetary_set` as plain values, gears as dicts."""
        from gearlib.models.geometry.mesh import torque_of

        given = self.model_dump(exclude={"torque", "power", "speed", "stiffness_options"})
        given |= gears_section.stiffness_method("train.planetary_set", self)
        given["torque"] = gears_section.rounded(torque_of(self.torque, self.power, self.speed))
        return given


#: Keys of a mesh that suit drawn gears only, and the coefficient in place of ratios.
OF_DRAWN = {*DampingByRatio.model_fields, "torque", "centre_distance"}


def check_planets(key, section):
    """Refuse a planetary set that cannot be, before any job; the message names the key."""
    from gearlib.models.geometry.drawings import planets_of

    keys = {name: f"{key}.{name}" for name in ("sun", "planet", "ring")}
    wanted = f"z_s + 2 z_p = {section.sun.teeth + 2 * section.planet.teeth}"
    gears_section.check_ring(keys["ring"], section.ring, section.planet, f"{wanted}, or near to it")
    sun = gears_section.gear_of(keys["sun"], section.sun)
    planet = gears_section.gear_of(keys["planet"], section.planet, like=section.sun)
    ring = gears_section.gear_of(keys["ring"], section.ring, like=section.sun, internal=True)
    places = {"planets", "positions", "centre_distance", "backlashes"}
    with gears_section.naming(key, section.stiffness_options, **keys):
        drawn = planets_of(sun, planet, ring, **section.model_dump(include=places))
        given = section.arguments()
        stated = "torque", given["torque"], "N m"
        names = (*DampingByRatio.model_fields, "options")
        given = {name: given[name] for name in names if name in given}
        share = stated[1] / len(drawn.positions)
        for mesh in (drawn.sun_mesh, drawn.ring_mesh):
            # The sun carries its share, a planet the same force at its radius.
            torque = share * mesh.pinion.teeth / sun.teeth
            mesh.train_parameters(torque=torque, stated=stated, **given)


def check_meshes(key, section):
    """Refuse drawn gears of a train of one's own that do not mesh; the message names the key."""
    drawn = {}
    for i, body in enumerate(section.bodies):
        if body.gear is not None:
            place = f"{key}.bodies[{i}].gear"
            drawn[body.name] = place, gears_section.gear_of(place, body.gear)
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
    own |= gears_section.stiffness_method(here, mesh)
    with gears_section.naming(here, mesh.stiffness_options, pinion=pinion[0], wheel=wheel[0]):
        Mesh(pinion[1], wheel[1], mesh.centre_distance).train_parameters(**own)


Planetary = like(
    "Planetary",
    "Sun, ring, carrier and planets, of Lin and Parker where left out.\n\n"
    "All keys are arguments of `gearlib.planetary`; gear_pair has no part in it.",
    planetary.planetary,
)
Idler = like(
    "Idler",
    "Pinion, idler and wheel; both meshes are gear_pair. Arguments of `gearlib.idler`.",
    ready_made.idler,
)
TwoStage = like(
    "TwoStage",
    "Two stages with a shaft; both meshes are gear_pair. Arguments of `gearlib.two_stage`.",
    ready_made.two_stage,
)
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

    gear: BodyGear = entry("Its drawing, which gives inertia, base radius, teeth and mass.", None)

    @model_validator(mode="after")
    def _check(self):
        for key in ("inertia", "base_radius"):
            if self.gear is None and getattr(self, key) is None:
                raise PydanticCustomError("missing_one", "", {"key": key})
        return self


class Deviation(Section):
    """Deviation of the flanks over the mesh phase."""

    cosines: list[Error] = entry("Amplitudes of orders 1, 2, ..., m.", [])
    sines: list[Error] = entry("Amplitudes of orders 1, 2, ..., m.", [])


_DRAWN = "Of drawn gears, m. Default: without backlash by the shifts."
_LOADED = "Of the pinion, N m; the stiffness of drawn gears may need it."
MeshPart = like(
    "MeshPart",
    "Two gears in mesh, see `gearlib.Mesh`; stiffness, ratios, phases follow where both are drawn.",
    elements.Mesh,
    base=DampingByRatio,
    without=("material_damping",),
    optional=("max_stiffness", "stiffness_ratio", "contact_ratio"),
    centre_distance=(Diameter, entry(_DRAWN, None)),
    torque=(type_of(TORQUE), entry(_LOADED, None)),
    deviation=(Deviation, entry("Of the drive-side flanks.", None)),
    inverse_deviation=(Deviation, entry("Of the coast-side flanks.", None)),
)


class Own(Given):
    """Bodies, shafts and meshes, arguments of `gearlib.GearTrain`."""

    bodies: list[BodyPart] = entry("The bodies.", [])
    shafts: list[ShaftPart] = entry("The shafts.", [])
    meshes: list[MeshPart] = entry("The meshes.", [])
    carrier_ratio: Finite = entry(
        "Speed of the frame over that of the reference pinion in it.", None
    )
    gyroscopic: Truth = entry("Whether the forces of the turning frame are felt.", None)


#: Kinds whose meshes are all a gear_pair with a damping.
OF_PAIRS = ("split_power_reducer", "idler", "two_stage")


class Train(Given):
    """A gear train; `kind` says which of the sections below it is.

    Their keys are arguments of the functions of the library, which have the defaults. Ready-made
    trains but the planetary one make every mesh of gear_pair and a damping.
    """

    kind: Literal[
        "split_power_reducer", "planetary", "idler", "two_stage", "own", "planetary_set"
    ] = entry("The section that describes the train.", "split_power_reducer")
    reference: Label = entry("Mesh that sets scales and tuning; the first if left out.", None)
    reference_frequency: quantity("Hz", "2 kHz", gt=0) = entry(
        "Hz, unit of the tuning; that of the mode that deforms the reference mesh most if left "
        "out.",
        None,
    )
    split_power_reducer: SplitPowerReducer = SplitPowerReducer.unchecked()
    planetary: Planetary = Planetary.unchecked()
    idler: Idler = Idler.unchecked()
    two_stage: TwoStage = TwoStage.unchecked()
    own: Own = Own.unchecked()
    planetary_set: PlanetarySet = entry("Sun, planets and ring by their drawing.", None)

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


class TrainSweep(Started, Recorded):
    """Every mesh of the train of the section `train` over speed; the target of this name."""

    start: OwnStart = 0.5
    stop: OwnStop = 1.4
    step: OwnStep = 0.01
    damping: DampingName
    periods: Periods = 120
    record_periods: RecordPeriods = 12


Teeth = whole(3, 1000)
#: A pin may lie off its place in both directions.
Offset = quantity("m", "10 um")
#: Pitch radii that differ by more are no rounding.
_ONE_CENTRE = 1e-9


class Reducer(Started, Recorded):
    """Fig. 1 a: three double satellites between central gears, the gear pair as every mesh."""

    start: OwnStart = 0.74
    stop: OwnStop = 1.84
    step: OwnStep = 0.02
    damping: DampingName
    teeth: numbers(Teeth, 4, "Of input, satellites a, satellites b, output.") = [24, 36, 24, 36]
    modules: numbers(
        type_of(MODULE), 2, "Of both stages, m; the centre distances must be equal."
    ) = [
        0.004,
        0.004,
    ]
    shaft_stiffness: quantity("N m/rad", "1e6 N m/rad", gt=0) = entry(
        "Of a satellite's shaft against torsion, N m/rad.", 1e6
    )
    support_stiffness: Stiffness = entry("Of all axes, N/m. Default: 2.5 max_stiffness.")
    damping_ratio: Share = entry(
        "Of supports and shafts, at the mean eigenfrequency of the pair.", 0.03
    )
    pin_error: numbers(
        Offset,
        2,
        "Displacement of the first satellite's axis in one case, radial and tangential, m. "
        "Default: a static deflection outwards.",
    )
    backlashes: numbers(
        Backlash,
        3,
        "Of the branches in one case, m. Default: a quarter of backlash in the first.",
    )
    periods: Periods = 210
    record_periods: RecordPeriods = 42

    @model_validator(mode="after")
    def _check(self):
        first, second = (
            module * (self.teeth[2 * i] + self.teeth[2 * i + 1]) / 2.0
            for i, module in enumerate(self.modules)
        )
        if abs(first - second) > _ONE_CENTRE * first:
            raise ValueError(
                f"reducer.teeth = {self.teeth!r} is not allowed: with reducer.modules = "
                f"{self.modules!r} both stages must have one centre distance, and it is "
                f"{first:.6g} m in the first, {second:.6g} m in the second"
            )
        return self


class Campbell(Section):
    """Campbell diagram of the reducer whose branches are alike."""

    orders: whole(1, 20) = entry("Highest order of each mesh frequency.", 3)
