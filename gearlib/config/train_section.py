"""Sections of the gear train: a ready-made one, or of one's own parts; its sweep over speed."""

from typing import Literal

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from gearlib.config.drawn_trains import DampingByRatio, PlanetarySet, check_meshes
from gearlib.config.gears_section import BodyGear
from gearlib.config.types import (
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
    Started,
    Truth,
    entry,
    like,
    quantity,
    type_of,
)
from gearlib.models.trains import elements, planetary, ready_made
from gearlib.parameters import TORQUE

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
