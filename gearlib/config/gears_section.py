"""Sections of drawn gears: `gears`, which replaces `gear_pair`, and the pairs of studies."""

from collections.abc import Iterable
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from gearlib import parameters
from gearlib.config import types as t
from gearlib.config.gear_pair_section import rounded
from gearlib.config.types import Section, entry, like
from gearlib.models.geometry.drawings import gear as drawn_gear
from gearlib.models.geometry.drawings import parameters_renamed
from gearlib.models.geometry.gear import Material, Rack, SpurGear, TipRelief, Web
from gearlib.models.geometry.mesh import Mesh, six_degree_parameters, torque_of

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
#: Gears with 20 teeth each of the literature on backlash; backlash and torque are assumed.
TWENTY = {
    "pinion": {"teeth": 20, "module": 0.01, "width": 0.03, "material": {"young": 200e9}},
    "wheel": {"teeth": 20},
    "backlash": 50e-6,
    "torque": 500.0,
}
_OF_RING = ("internal", "outer_diameter")


def in_keys(section_key: str = "", options: Iterable[str] | None = None, **gear_keys: str):
    """Return a context in which errors of the geometry name the config keys of the arguments.

    `section_key` is the key of the section with the gears, `options` are the names of its stiffness
    options, and `gear_keys` the config keys of the gears by their names, such as pinion=".pinion".
    """
    ring_key = gear_keys.get("ring", gear_keys.get("wheel", section_key))
    gear_keys |= {"ring gear": ring_key}

    def config_key(argument: str, owner: str) -> str:
        """Return the config key of an argument of the gear or object that `owner` names."""
        argument, of_relief, _ = argument.partition(" of the tip relief")
        if of_relief or owner == "tip relief":
            argument = f"tip_relief.{argument}"
        elif owner == "rack":
            argument = argument.replace("tip_radius", "fillet_radius")
        elif owner in ("web", "material"):
            argument = f"{owner}.{argument}"
        if owner in gear_keys:
            return f"{gear_keys[owner]}.{argument}"
        if owner in ("sun mesh", "ring mesh", "shifts"):
            return f"{section_key and f'{section_key}: '}{argument} of the {owner}"
        if argument in (options or ()):
            argument = f"stiffness_options.{argument}"
        return f"{ring_key if argument == 'outer_diameter' else section_key}.{argument}"

    return parameters_renamed(config_key)


_ADDENDUM, _DEDENDUM, _RADIUS = (t.type_of(x.kind) for x in parameters.declared(Rack).values())
MaterialSection = like("MaterialSection", "Elastic material of a gear.", Material)
WebSection = like("WebSection", "Web between rim and hub.", Web)
TipReliefSection = like("TipReliefSection", "Tip relief of a gear.", TipRelief)
GearSection = like(
    "GearSection",
    "One gear by its drawing, see `gearlib.geometry.SpurGear`.",
    SpurGear,
    without=_OF_RING,
    optional=("module", "width", "pressure_angle", "helix_angle", "rack"),
    addendum=(_ADDENDUM, entry("Addendum h_aP of another rack, in modules.", None)),
    dedendum=(_DEDENDUM, entry("Dedendum h_fP of another rack, in modules.", None)),
    fillet_radius=(_RADIUS, entry("Fillet radius rho_fP of another rack, in modules.", None)),
    web=(WebSection, entry("Web between rim and hub.", None)),
    material=(MaterialSection, entry("Elastic material. Default: steel.", None)),
    tip_relief=(TipReliefSection, entry("Tip relief. Default: none.", None)),
)
_DESCRIPTION = "The driving gear by its drawing; its revolutions are counted."
PinionSection = like("PinionSection", _DESCRIPTION, SpurGear, "module", "width", base=GearSection)
_DESCRIPTION = (
    "The other gear; left out, its module, width, angles, rack and material are the pinion's."
)
WheelSection = like("WheelSection", _DESCRIPTION, SpurGear, *_OF_RING, base=GearSection)
_DESCRIPTION = "A gear of a train by its drawing, see `gearlib.geometry.SpurGear`."
BodyGear = like("BodyGear", _DESCRIPTION, SpurGear, *_OF_RING, base=PinionSection)
_Placed = like("_Placed", "Two drawn gears in their places.", Mesh)


def gear_of(section_key: str, gear: Any, pinion: Any = None, **arguments: Any) -> SpurGear:
    """Return the `SpurGear` that the section `gear` describes.

    `pinion` is the section that supplies values which `gear` leaves out. `arguments` are further
    ones of `SpurGear`. Errors name `section_key`.
    """
    with in_keys(section_key):
        return drawn_gear(gear.model_dump(), pinion and pinion.model_dump(), **arguments)


class MethodSection(Section):
    """Method of the stiffness of drawn gears."""

    stiffness: Literal["iso", "energy"] = entry(
        "Stiffness by ISO 6336-1, method B, or by the energy method. Default: iso.", None
    )
    stiffness_options: dict[t.Name, t.Option] = entry(
        "Options of that method: iso has application_factor; energy samples, coupling, hertz.", None
    )

    def stiffness_arguments(self, section_key: str = "") -> dict:
        """Return `stiffness` and `options` for `Mesh.pair_parameters`; errors name a section."""
        arguments = self.model_dump(include={"stiffness", "stiffness_options"})
        if "stiffness_options" in arguments:
            arguments["options"] = arguments.pop("stiffness_options")
            if "torque" in arguments["options"]:
                raise ValueError(
                    f"{section_key}.stiffness_options.torque is not allowed: it must be "
                    f"{section_key}.torque"
                )
        return arguments


class DrawnPair(_Placed):
    """A pair of gears by their drawing, and its load."""

    pinion: PinionSection
    wheel: WheelSection
    torque: t.Torque = entry("Torque of the pinion, N m.")

    def mesh(self, section_key: str = "") -> Mesh:
        """Return the `gearlib.geometry.Mesh` of the pair; errors name keys under `section_key`."""
        gear_keys = {name: f"{section_key}.{name}" for name in ("pinion", "wheel")}
        pinion = gear_of(gear_keys["pinion"], self.pinion)
        wheel = gear_of(gear_keys["wheel"], self.wheel, self.pinion)
        with in_keys(section_key, **gear_keys):
            return Mesh(pinion, wheel, self.centre_distance, self.backlash)

    def check(self, section_key: str, *methods: str) -> None:
        """Refuse impossible gears, and gears without a stiffness by the named stiffness methods.

        Errors name keys under `section_key`.
        """
        drawing = self.model_dump(include={"pinion", "wheel", "centre_distance"})
        # The default gears are known to be valid. Computing them would slow the workflow's start.
        if any(drawing.items() <= pair.items() for pair in (FZG_C, TWENTY)):
            return
        mesh = self.mesh(section_key)
        with in_keys(section_key, pinion=f"{section_key}.pinion", wheel=f"{section_key}.wheel"):
            for method in methods:
                mesh.pair_parameters(torque=self.torque, stiffness=method)

    def modification_key(self) -> str:
        """Return the first key that modifies the involute flanks, such as "pinion.tip_relief".

        Return "" if all flanks are pure involutes.
        """
        for name, gear in (("pinion", self.pinion), ("wheel", self.wheel)):
            for key in ("tip_relief", "pitch_errors"):
                if getattr(gear, key):
                    return f"{name}.{key}"
        return ""


class Gears(MethodSection, DrawnPair):
    """A pair of gears by their drawing, in place of gear_pair, which is derived from it."""

    torque: t.Torque = entry("Torque of the pinion, N m; or power and speed.", None)
    power: t.Power = entry("Power of the pinion, W.", None)
    speed: t.Speed = entry("Speed of the pinion, rpm; with a torque, of its duty point.", None)

    @model_validator(mode="after")
    def _check(self) -> "Gears":
        """Refuse gears from which no `gear_pair` can be derived."""
        self.pair()
        return self

    def load(self) -> dict[str, float]:
        """Return the given ones of torque (N m), power (W) and speed (rpm) of the pinion."""
        return self.model_dump(include={"torque", "power", "speed"})

    def driving_torque(self) -> float:
        """Return the torque of the pinion, N m, rounded to 12 digits."""
        return rounded(torque_of(self.torque, self.power, self.speed))

    def described(self) -> dict:
        """Return the drawing, stiffness method and torque as plain values for the library."""
        return self.model_dump(exclude={"power", "speed"}) | {"torque": self.driving_torque()}

    def pair(self) -> dict:
        """Return the values of the section `gear_pair` made of the drawing, to 12 digits."""
        mesh, arguments = self.mesh(), self.load() | self.stiffness_arguments()
        with in_keys("", self.stiffness_options, pinion=".pinion", wheel=".wheel"):
            values = mesh.pair_parameters(**arguments)
        return {name: rounded(value) for name, value in values.items() if "damping" not in name}

    def six_degrees(self) -> dict:
        """Return the values of the section `six_degrees` that follow from the drawing.

        Friction, run-out and bearing damping are 0; the bearing stiffness is left out.
        """
        zeros = {"friction": [0.0] * 2, "eccentricities": [0.0] * 2, "bearing_damping": [0.0] * 4}
        values = {key: rounded(value) for key, value in six_degree_parameters(self.mesh()).items()}
        del values["teeth"]
        return values | zeros


class PublishedPair(DrawnPair):
    """A pair of gears by their drawing, with published values of its stiffness."""

    published: dict[t.Name, t.Stiffness] = entry("Published mean stiffness by source, N/m.", {})

    @model_validator(mode="after")
    def _check(self) -> "PublishedPair":
        """Refuse gears without a stiffness by either method."""
        self.check("", "iso", "energy")
        return self


class MeshStiffness(Section):
    """The mesh stiffness of drawn pairs by all methods, with its uncertainty."""

    pairs: Annotated[dict[t.Name, PublishedPair], Field(min_length=1, max_length=6)] = entry(
        "Drawn pairs by name.",
        {"z20-20": TWENTY | {"published": {"ISO": 4.9e8, "thumb": 5.2e8}}, "FZG-C": FZG_C},
    )
    samples: t.whole(8, 4096) = entry("Number of phases in the mesh period.", 64)


class HarrisMap(Section):
    """The static transmission error of spur gears at several loads, with designed tip reliefs."""

    gears: DrawnPair = entry(
        "The pair at its design load, without tip relief; by default FZG type C.",
        FZG_C | {"backlash": 160e-6},
    )
    stiffness: Literal["energy", "iso"] = entry("Stiffness of a pair of teeth.", "energy")
    loads: t.Distinct[t.NonNegative] = entry(
        "Loads over the design load.", [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    )
    phases: t.whole(8, 10_000) = entry("Number of phases in the mesh period.", 256)

    @model_validator(mode="after")
    def _check(self) -> "HarrisMap":
        """Refuse gears for which no Harris map can be computed."""
        self.check_gears(".gears", self.gears)
        return self

    def check_gears(self, pair_key: str, pair: DrawnPair) -> None:
        """Refuse helical or modified gears, which have no Harris map; errors name `pair_key`."""
        for name in ("pinion", "wheel"):
            for key in ("helix_angle", "tip_relief", "pitch_errors"):
                if getattr(getattr(pair, name), key):
                    raise ValueError(
                        f"{pair_key}.{name}.{key} is not allowed: it must be left out, because the "
                        "Harris map is of spur gears without errors, and designs their reliefs"
                    )
        pair.check(pair_key, self.stiffness)


#: Name of a section -> its key with drawn gears.
_GEAR_KEYS = {"mesh_stiffness": "pairs", "harris_map": "gears"}


def takes_configured_gears(config: Any, section_name: str) -> bool:
    """Return whether the drawn gears of the configuration apply to a section without gears.

    The section is "mesh_stiffness" or "harris_map".
    """
    section = getattr(config, section_name)
    return config.gears is not None and _GEAR_KEYS[section_name] not in section.model_fields_set


def drawn_pairs(config: Any, section_name: str) -> dict[str, DrawnPair]:
    """Return the drawn pairs of the section "mesh_stiffness" or "harris_map", by their names.

    If the section has no gears, they are the drawn gears of the configuration.
    """
    if not takes_configured_gears(config, section_name):
        pairs = getattr(getattr(config, section_name), _GEAR_KEYS[section_name])
        return pairs if section_name == "mesh_stiffness" else {section_name: pairs}
    torque = config.gears.driving_torque()
    pair = PublishedPair.model_construct(**dict(config.gears) | {"torque": torque})
    if section_name == "harris_map":
        # The Harris map designs tip reliefs of its own.
        unrelieved = {
            name: getattr(pair, name).model_copy(update={"tip_relief": None})
            for name in ("pinion", "wheel")
        }
        pair = pair.model_copy(update=unrelieved)
    return {f"z{pair.pinion.teeth}-{pair.wheel.teeth}": pair}


def refusal(config: Any, section_name: str) -> str:
    """Return why "mesh_stiffness" or "harris_map" cannot take the configured gears, else ""."""
    if not takes_configured_gears(config, section_name):
        return ""
    try:
        for pair in drawn_pairs(config, section_name).values():
            if section_name == "harris_map":
                config.harris_map.check_gears("gears", pair)
            else:
                pair.check("gears", "iso", "energy")
    except ValueError as error:
        return str(error)
    return ""
