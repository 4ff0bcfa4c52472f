"""Gears by their drawing: the section `gears`, in place of `gear_pair`, and pairs of studies."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gearlib import parameters
from gearlib.config import types as t
from gearlib.config.gear_pair_section import rounded
from gearlib.config.types import Section, entry, like
from gearlib.models.geometry.drawings import gear, renaming
from gearlib.models.geometry.gear import Material, Rack, SpurGear, TipRelief, Web
from gearlib.models.geometry.mesh import Mesh, bodies, torque_of

#: FZG type C, ISO 14635-2, at load stage 9 on shafts of 30 mm; backlash and quality: choices.
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
#: z 20/20 of the literature on backlash; backlash and torque: choices.
TWENTY = {
    "pinion": {"teeth": 20, "module": 0.01, "width": 0.03, "material": {"young": 200e9}},
    "wheel": {"teeth": 20},
    "backlash": 50e-6,
    "torque": 500.0,
}
_OF_RING = ("internal", "outer_diameter")


def in_keys(key="", options=None, **places):
    """Return a context that names keys in full where the geometry refuses.

    `key` is that of the section, `options` are names of stiffness options, `places` the keys of
    gears by their names.
    """
    ring = places.get("ring", places.get("wheel", key))
    places |= {"ring gear": ring}

    def rename(name, part):
        name, relief, _ = name.partition(" of the tip relief")
        if relief or part == "tip relief":
            name = f"tip_relief.{name}"
        elif part == "rack":
            name = name.replace("tip_radius", "fillet_radius")
        elif part in ("web", "material"):
            name = f"{part}.{name}"
        if part in places:
            return f"{places[part]}.{name}"
        if part in ("sun mesh", "ring mesh", "shifts"):
            return f"{key and f'{key}: '}{name} of the {part}"
        if name in (options or ()):
            name = f"stiffness_options.{name}"
        return f"{ring if name == 'outer_diameter' else key}.{name}"

    return renaming(rename)


def gear_of(key, section, pinion=None, **more):
    """Return the `SpurGear` of a section; `pinion` is the section with what it leaves out."""
    with in_keys(key):
        return gear(section.model_dump(), pinion and pinion.model_dump(), **more)


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
_WORDS = "The driving gear by its drawing; its revolutions are counted."
PinionSection = like("PinionSection", _WORDS, SpurGear, "module", "width", base=GearSection)
_WORDS = "The other gear; left out, its module, width, angles, rack and material are the pinion's."
WheelSection = like("WheelSection", _WORDS, SpurGear, *_OF_RING, base=GearSection)
_WORDS = "A gear of a train by its drawing, see `gearlib.geometry.SpurGear`."
BodyGear = like("BodyGear", _WORDS, SpurGear, *_OF_RING, base=PinionSection)
_Placed = like("_Placed", "Two drawn gears in their places.", Mesh)


class MethodSection(Section):
    """Method of the stiffness of drawn gears."""

    stiffness: Literal["iso", "energy"] = entry(
        "Stiffness by ISO 6336-1, method B, or by the energy method. Default: iso.", None
    )
    stiffness_options: dict[t.Name, t.Option] = entry(
        "Options of that method: iso has application_factor; energy samples, coupling, hertz.", None
    )

    def stiffness_arguments(self, key=""):
        """Return the arguments of the stiffness as the library has them; `key` for refusals."""
        arguments = self.model_dump(include={"stiffness", "stiffness_options"})
        if "stiffness_options" in arguments:
            arguments["options"] = arguments.pop("stiffness_options")
            if "torque" in arguments["options"]:
                raise ValueError(
                    f"{key}.stiffness_options.torque is not allowed: it must be {key}.torque"
                )
        return arguments


class DrawnPair(_Placed):
    """A pair of gears by their drawing, and its load."""

    pinion: PinionSection
    wheel: WheelSection
    torque: t.Torque = entry("Torque of the pinion, N m.")

    def mesh(self, key=""):
        """Return the `gearlib.geometry.Mesh`; gears that cannot be are refused by their keys."""
        places = {name: f"{key}.{name}" for name in ("pinion", "wheel")}
        pinion = gear_of(places["pinion"], self.pinion)
        wheel = gear_of(places["wheel"], self.wheel, self.pinion)
        with in_keys(key, **places):
            return Mesh(pinion, wheel, self.centre_distance, self.backlash)

    def check(self, key, *methods):
        """Refuse gears that cannot be or have no stiffness by some methods, by their keys."""
        drawing = self.model_dump(include={"pinion", "wheel", "centre_distance"})
        # No start of the workflow loads the energy method for these.
        if any(drawing.items() <= pair.items() for pair in (FZG_C, TWENTY)):
            return
        mesh = self.mesh(key)
        with in_keys(key, pinion=f"{key}.pinion", wheel=f"{key}.wheel"):
            for method in methods:
                mesh.pair_parameters(torque=self.torque, stiffness=method)

    def relief(self):
        """Return the first key by which flanks are no involutes, "" where they are."""
        keys = ("tip_relief", "pitch_errors")
        gears = {"pinion": self.pinion, "wheel": self.wheel}
        named = (f"{name}.{key}" for name, x in gears.items() for key in keys if getattr(x, key))
        return next(named, "")


class Gears(MethodSection, DrawnPair):
    """A pair of gears by their drawing, in place of gear_pair, which is derived from it."""

    torque: t.Torque = entry("Torque of the pinion, N m; or power and speed.", None)
    power: t.Power = entry("Power of the pinion, W.", None)
    speed: t.Speed = entry("Speed of the pinion, rpm; with a torque, of its duty point.", None)

    @model_validator(mode="after")
    def _check(self):
        self.pair()
        return self

    def load(self):
        """Return torque, or power and speed, as a dict."""
        return self.model_dump(include={"torque", "power", "speed"})

    def driving_torque(self):
        """Return the torque of the pinion, N m, to 12 digits."""
        return rounded(torque_of(self.torque, self.power, self.speed))

    def described(self):
        """Return the drawing, its stiffness and torque as the library takes them, as a dict."""
        return self.model_dump(exclude={"power", "speed"}) | {"torque": self.driving_torque()}

    def pair(self):
        """Return the keys of `gear_pair` as a dict, to 12 digits; refuses as `mesh` does."""
        mesh, arguments = self.mesh(), self.load() | self.stiffness_arguments()
        with in_keys("", self.stiffness_options, pinion=".pinion", wheel=".wheel"):
            values = mesh.pair_parameters(**arguments)
        return {name: rounded(x) for name, x in values.items() if "damping" not in name}

    def six_degrees(self):
        """Return the keys of `six_degrees` that a drawing gives; no friction, no run-out."""
        zeros = {"friction": [0.0] * 2, "eccentricities": [0.0] * 2, "bearing_damping": [0.0] * 4}
        values = {key: rounded(value) for key, value in bodies(self.mesh()).items()}
        del values["teeth"]
        return values | zeros


class PublishedPair(DrawnPair):
    """A pair of gears by their drawing, with what others find for it."""

    published: dict[t.Name, t.Stiffness] = entry("Mean stiffness by its source, N/m.", {})

    @model_validator(mode="after")
    def _check(self):
        self.check("", "iso", "energy")
        return self


class MeshStiffness(Section):
    """The mesh stiffness of drawn pairs by every method, with its uncertainty."""

    pairs: Annotated[dict[t.Name, PublishedPair], Field(min_length=1, max_length=6)] = entry(
        "Drawn pairs by name.",
        {"z20-20": TWENTY | {"published": {"ISO": 4.9e8, "thumb": 5.2e8}}, "FZG-C": FZG_C},
    )
    samples: t.whole(8, 4096) = entry("Phases of a course over the mesh period.", 64)


class HarrisMap(Section):
    """The static transmission error of spur gears at several loads, with reliefs that are found."""

    gears: DrawnPair = entry(
        "The pair at its design load, without tip relief; by default FZG type C.",
        FZG_C | {"backlash": 160e-6},
    )
    stiffness: Literal["energy", "iso"] = entry("Stiffness of a pair of teeth.", "energy")
    loads: t.Distinct[t.NonNegative] = entry(
        "Loads over the design load.", [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    )
    phases: t.whole(8, 10_000) = entry("Phases of a mesh period.", 256)

    @model_validator(mode="after")
    def _check(self):
        self.check_gears(".gears", self.gears)
        return self

    def check_gears(self, place, gears):
        """Refuse a `DrawnPair`, named by `place`, that has no Harris map."""
        for name in ("pinion", "wheel"):
            for key in ("helix_angle", "tip_relief", "pitch_errors"):
                if getattr(getattr(gears, name), key):
                    raise ValueError(
                        f"{place}.{name}.{key} is not allowed: it must be left out, the "
                        "map is that of spur gears without errors, which get their reliefs by it"
                    )
        gears.check(place, self.stiffness)


#: Section -> its key of drawn gears.
_KEYS = {"mesh_stiffness": "pairs", "harris_map": "gears"}


def takes_configured_gears(c, section):
    """Return whether a section names no gears, so that it is about those of the configuration."""
    return c.gears is not None and _KEYS[section] not in getattr(c, section).model_fields_set


def drawn_pairs(c, section):
    """Return name -> drawn pair of a section: its gears, else those of the configuration."""
    if not takes_configured_gears(c, section):
        pairs = getattr(getattr(c, section), _KEYS[section])
        return pairs if section == "mesh_stiffness" else {section: pairs}
    pair = PublishedPair.model_construct(**dict(c.gears) | {"torque": c.gears.driving_torque()})
    if section == "harris_map":
        # The map is that of the reliefs it finds.
        gears = {"pinion": pair.pinion, "wheel": pair.wheel}
        bare = {key: gear.model_copy(update={"tip_relief": None}) for key, gear in gears.items()}
        pair = pair.model_copy(update=bare)
    return {f"z{pair.pinion.teeth}-{pair.wheel.teeth}": pair}


def refusal(c, section):
    """Return why a section cannot take the gears of the configuration, or ""."""
    try:
        for pair in drawn_pairs(c, section).values() if takes_configured_gears(c, section) else ():
            if section == "harris_map":
                c.harris_map.check_gears("gears", pair)
            else:
                pair.check("gears", "iso", "energy")
    except ValueError as error:
        return str(error)
    return ""
