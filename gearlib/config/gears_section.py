"""Sections for gear geometry: `gears`, which replaces `gear_pair`, and gears of studies."""

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from gearlib import checks
from gearlib import parameters as p
from gearlib.config import types as t
from gearlib.config.gear_pair_section import round_floats
from gearlib.config.types import Section, create_section, field
from gearlib.models.geometry.from_values import build_gear
from gearlib.models.geometry.gear import Rack, SpurGear
from gearlib.models.geometry.gear_stage import GearStage, resolve_torque, six_degree_parameters

#: FZG type C, ISO 14635-2, at load stage 9 on shafts of 30 mm; backlash and quality are assumed.
FZG_C = {
    "pinion": {
        **{"teeth": 16, "module": 4.5e-3, "width": 0.014, "shift": 0.1817},
        **{"tip_diameter": 0.08246, "bore": 0.03, "quality": 5},
    },
    "wheel": {"teeth": 24, "shift": 0.1715, "tip_diameter": 0.11836, "bore": 0.03, "quality": 5},
    "centre_distance": 0.0915,
    "backlash": 50e-6,
    "torque": 302.0,
}
#: Pair of two gears with 20 teeth from the literature; backlash and torque are assumed.
Z20_PAIR = {
    "pinion": {"teeth": 20, "module": 0.01, "width": 0.03, "material": {"young": 200e9}},
    "wheel": {"teeth": 20},
    "backlash": 50e-6,
    "torque": 500.0,
}
#: Section of a study of gear geometry -> the key of its gears.
GEARS_KEYS = {"mesh_stiffness": "pairs", "harris_map": "gears", "dynamic_factor": "gears"}
_RING_KEYS = ("internal", "outer_diameter")


_RACK = {key: x.annotation for key, x in p.declared_parameters(Rack).items()}
GearSection = create_section(
    "GearSection",
    "A gear given by geometry, see `gearlib.geometry.SpurGear`.",
    SpurGear,
    exclude=_RING_KEYS,
    optional=("module", "width", "pressure_angle", "helix_angle", "rack"),
    addendum=(_RACK["addendum"], field("Addendum h_aP of a custom rack, in modules.", None)),
    dedendum=(_RACK["dedendum"], field("Dedendum h_fP of a custom rack, in modules.", None)),
    fillet_radius=(
        _RACK["tip_radius"],
        field("Fillet radius rho_fP of a custom rack, in modules.", None),
    ),
)
_DOC = "The driving gear, given by geometry; revolutions are those of this gear."
PinionSection = create_section("PinionSection", _DOC, SpurGear, "module", "width", base=GearSection)
_DOC = "The driven gear; module, width, angles, rack and material default to those of the pinion."
WheelSection = create_section("WheelSection", _DOC, SpurGear, *_RING_KEYS, base=GearSection)
_DOC = "A gear of a train, given by geometry, see `gearlib.geometry.SpurGear`."
BodyGear = create_section("BodyGear", _DOC, SpurGear, *_RING_KEYS, base=PinionSection)
_Placed = create_section(
    "_Placed", "Two gears at their centre distance.", GearStage, exclude=("pinion", "wheel")
)


def create_spur_gear(section_key: str, gear: Any, pinion: Any = None, **defaults: Any) -> SpurGear:
    """Return the `SpurGear` described by the section `gear`.

    Omitted values, such as the module, are taken from `pinion`, the section of the mating gear, if
    given, or from `defaults` (fields of `SpurGear`). Error messages contain `section_key`, the key
    of the section.
    """
    pinion_values = None if pinion is None else pinion.model_dump()
    with checks.prefix_error_paths(section_key):
        return build_gear(gear.model_dump(), pinion_values, **defaults)


class MethodSection(Section):
    """Method with which the mesh stiffness of gears given by geometry is computed."""

    stiffness: Literal["iso", "energy"] = field(
        "Stiffness by ISO 6336-1, method B, or by the energy method. Default: iso for the "
        "rectangle, otherwise energy, or iso if a bore is too large for the energy method.",
        None,
    )
    stiffness_options: dict[t.Name, t.Option] = field(
        "Options of the method: application_factor for iso; samples, coupling, twist and hertz for "
        "energy.",
        None,
    )

    def stiffness_arguments(self) -> dict:
        """Return the arguments `stiffness` and `options` of `GearStage.pair_parameters`.

        They are the method with which the mesh stiffness is computed, and a dict of its options.
        Arguments that are not given in the configuration are omitted. Raise an error if the options
        contain the torque, which is a key of the section itself.
        """
        arguments = self.model_dump(include={"stiffness", "stiffness_options"})
        if "stiffness_options" in arguments:
            arguments["options"] = arguments.pop("stiffness_options")
            if "torque" in arguments["options"]:
                problem = "is not allowed: give the torque as the key torque of the section"
                raise checks.InputError("stiffness_options.torque", problem=problem)
        return arguments

    def option_keys(self, section: str = "") -> dict[str, str]:
        """Return a dict: name of each stiffness option -> its configuration key.

        The keys are used in error messages. `section` is a prefix of all keys, e.g. "meshes[0].".
        """
        return {name: f"{section}stiffness_options.{name}" for name in self.stiffness_options or ()}


class StageSection(_Placed):
    """A pair of gears given by geometry, and its load."""

    pinion: PinionSection
    wheel: WheelSection
    torque: p.DrivingTorque = field("Torque of the pinion, N m.")

    def gear_stage(self) -> GearStage:
        """Return the two gears as a `gearlib.geometry.GearStage`.

        Values omitted in the section of the wheel are taken from the pinion.
        """
        pinion = create_spur_gear("pinion", self.pinion)
        wheel = create_spur_gear("wheel", self.wheel, self.pinion)
        return GearStage(pinion, wheel, self.centre_distance, self.backlash)

    def check(self, stiffness_methods: Iterable[str]) -> None:
        """Raise an error if the gears are impossible or their stiffness cannot be computed.

        `stiffness_methods` are the methods to check: "iso" (ISO 6336-1), "energy" (deformation
        energy of the teeth), both or none.
        """
        values = self.model_dump(include={"pinion", "wheel", "centre_distance"})
        # The default gears are known to be valid; checking them would slow down the workflow.
        if any(values.items() <= pair.items() for pair in (FZG_C, Z20_PAIR)):
            return
        stage = self.gear_stage()
        for method in stiffness_methods:
            stage.pair_parameters(torque=self.torque, stiffness=method)

    def modification_key(self, *keys: str) -> str:
        """Return the first of `keys` that is given for a gear, e.g. "pinion.tip_relief", or "".

        The default keys are "tip_relief" and "pitch_errors", i.e. deviations from an involute.
        """
        for gear_name in ("pinion", "wheel"):
            for key in keys or ("tip_relief", "pitch_errors"):
                if getattr(getattr(self, gear_name), key):
                    return f"{gear_name}.{key}"
        return ""


class Gears(MethodSection, StageSection):
    """A pair of gears given by geometry, from which gear_pair is derived."""

    torque: p.DrivingTorque = field("Torque of the pinion, N m; or power and speed.", None)
    power: p.Power = field("Power of the pinion, W.", None)
    speed: p.Speed = field("Operating speed of the pinion, rpm.", None)

    @model_validator(mode="after")
    def _check(self) -> "Gears":
        """Raise ValueError if no gear pair can be derived from the geometry."""
        self.pair_values()
        return self

    def load_arguments(self) -> dict[str, float]:
        """Return those of torque (N m), power (W) and speed (rpm) of the pinion that are given."""
        return self.model_dump(include={"torque", "power", "speed"})

    def driving_torque(self) -> float:
        """Return the torque of the pinion, N m, rounded to 12 digits."""
        return round_floats(resolve_torque(self.torque, self.power, self.speed))

    def geometry_dict(self) -> dict:
        """Return geometry, stiffness method and torque of the pinion (N m) as a dict."""
        return self.model_dump(exclude={"power", "speed"}) | {"torque": self.driving_torque()}

    def pair_values(self) -> dict:
        """Return the values of the section `gear_pair`, computed from the geometry, as a dict.

        They are rounded to 12 digits. The damping has its own section.
        """
        stage, arguments = self.gear_stage(), self.load_arguments() | self.stiffness_arguments()
        with checks.prefix_error_paths(
            "", outer_diameter="wheel.outer_diameter", **self.option_keys()
        ):
            values = stage.pair_parameters(**arguments)
        return {
            name: round_floats(value) for name, value in values.items() if "damping" not in name
        }

    def six_degree_values(self) -> dict:
        """Return the values of the section `six_degrees`, computed from the geometry, as a dict.

        They are the radii, inertias and masses of both gears and the mesh phase at the pitch point.
        Friction, run-out and bearing damping are zero. The bearing stiffness is omitted, because it
        cannot be computed from the gears.
        """
        zeros = {"friction": [0.0] * 2, "eccentricities": [0.0] * 2, "bearing_damping": [0.0] * 4}
        parameters = six_degree_parameters(self.gear_stage())
        del parameters["teeth"]
        return {key: round_floats(value) for key, value in parameters.items()} | zeros


class PublishedPair(StageSection):
    """A pair of gears given by geometry, with published values of its mesh stiffness."""

    published: dict[t.Name, p.Stiffness] = field("Published mean stiffness by source, N/m.", {})

    @model_validator(mode="after")
    def _check(self) -> "PublishedPair":
        """Raise ValueError if one of the two stiffness methods fails for these gears."""
        self.check(stiffness_methods=("iso", "energy"))
        return self


class MeshStiffness(Section):
    """The mesh stiffness of gears by all methods, with its uncertainty."""

    pairs: Annotated[dict[t.Name, PublishedPair], Field(min_length=1, max_length=6)] = field(
        "Pairs of gears by name.",
        {"z20-20": Z20_PAIR | {"published": {"ISO": 4.9e8, "thumb": 5.2e8}}, "FZG-C": FZG_C},
    )
    samples: t.integer(8, 4096) = field("Number of phases per mesh period.", 64)


class HarrisMap(Section):
    """The static transmission error at several loads, with the given and the optimal tip relief."""

    gears: StageSection = field(
        "The pair at its design load, without pitch errors. Default: FZG type C.",
        FZG_C | {"backlash": 160e-6},
    )
    stiffness: Literal["energy", "iso"] = field("Stiffness of a tooth pair.", "energy")
    loads: t.Distinct[p.NonNegative] = field(
        "Loads relative to the design load.", [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    )
    phases: t.integer(8, 10_000) = field("Number of phases per mesh period.", 256)

    @model_validator(mode="after")
    def _check(self) -> "HarrisMap":
        """Raise ValueError if the gears are impossible or their stiffness cannot be computed."""
        with checks.prefix_error_paths("gears"):
            self.gears.check(stiffness_methods=[self.stiffness])
        return self


class DynamicFactor(Section):
    """Dynamic factor and transmission error over speed, for increasing and decreasing speed."""

    gears: StageSection = field(
        "The pair and its load, without pitch errors. Default: FZG type C.",
        FZG_C | {"backlash": 160e-6},
    )
    damping_ratio: t.number(gt=0, lt=1) = field(
        "Damping ratio of these gears; the section gears uses the section dampings.", 0.05
    )
    start: p.Speed = field(
        "First speed of the pinion, rpm. Default: a tenth of the resonance speed.", None
    )
    stop: p.Speed = field("Last speed, rpm. Default: 1.4 times the resonance speed.", None)
    points: t.integer(2, 10_000) = field("Number of speeds.", 301)

    @model_validator(mode="after")
    def _check(self) -> "DynamicFactor":
        """Raise ValueError if the gears are impossible or `stop` does not exceed `start`.

        A speed of None is replaced later by a multiple of the resonance speed.
        """
        with checks.prefix_error_paths("gears"):
            self.gears.check(stiffness_methods=())
        allowed = f"greater than start = {self.start!r}"
        is_range = self.start is None or self.stop is None or self.start < self.stop
        checks.require(is_range, "stop", self.stop, allowed)
        return self


def uses_configured_gears(config: Any, section_name: str) -> bool:
    """Return whether a study uses the gears of the section `gears`, because it defines none itself.

    `section_name` is the section of the study, a key of `GEARS_KEYS` such as "harris_map".
    """
    section = getattr(config, section_name)
    return config.gears is not None and GEARS_KEYS[section_name] not in section.model_fields_set


def stage_sections(config: Any, section_name: str) -> dict[str, StageSection]:
    """Return the gears of a study of gear geometry as a dict: name -> `StageSection`.

    `section_name` is the section of the study, a key of `GEARS_KEYS` such as "harris_map". If it
    defines no gears itself, those of the section `gears` are returned.
    """
    if not uses_configured_gears(config, section_name):
        pairs = getattr(getattr(config, section_name), GEARS_KEYS[section_name])
        return pairs if isinstance(pairs, dict) else {section_name: pairs}
    torque = config.gears.driving_torque()
    # The section mesh_stiffness requires a `PublishedPair`; this one has no published values.
    pair = PublishedPair.model_construct(**dict(config.gears) | {"torque": torque})
    return {f"z{pair.pinion.teeth}-{pair.wheel.teeth}": pair}


def configured_gears_error(config: Any, section_name: str) -> str:
    """Return an error message if a study cannot use the gears of the section `gears`, else "".

    `section_name` is the section of the study, a key of `GEARS_KEYS`. If it defines gears itself,
    there is no error.
    """
    if not uses_configured_gears(config, section_name):
        return ""
    # The stiffness methods that each study uses.
    methods = {"mesh_stiffness": ["iso", "energy"], "harris_map": [config.harris_map.stiffness]}
    try:
        for pair in stage_sections(config, section_name).values():
            with checks.prefix_error_paths("gears"):
                pair.check(stiffness_methods=methods.get(section_name, ()))
    except ValueError as error:
        return str(error)
    return ""
