"""Gears by their drawing: the section `gears`, in place of `gear_pair`, and pairs of studies.

The geometry is loaded where a configuration has such sections; what it refuses is named by its key.
"""

from operator import attrgetter
from typing import Annotated, Literal

from pydantic import Field, model_validator

from gearlib import checks, parameters
from gearlib.config.types import (
    Given,
    Name,
    NonNegative,
    Option,
    Section,
    Stiffness,
    entry,
    like,
    listing,
    type_of,
    whole,
)
from gearlib.models.geometry.gear import Material, Rack, SpurGear, TipRelief, Web
from gearlib.models.geometry.mesh import Mesh

#: What is derived keeps so many digits: the same drawing in other units, whose rounding differs,
#: reruns nothing.
_DIGITS = 12


def gear_of(key, section, like=None, **more):
    """Return the `SpurGear` of a section, named by `key`; `like` has what it leaves out."""
    from gearlib.models.geometry.drawings import gear

    with naming(key):
        return gear(section.model_dump(), None if like is None else like.model_dump(), **more)


def mesh_of(key, section):
    """Return the `gearlib.geometry.Mesh` of a `gearlib.config.gears_section.DrawnPair`."""
    from gearlib.models.geometry.mesh import Mesh

    if section.wheel.internal:
        check_ring(f"{key}.wheel", section.wheel, section.pinion)
    pinion = gear_of(f"{key}.pinion", section.pinion)
    wheel = gear_of(f"{key}.wheel", section.wheel, like=section.pinion)
    with naming(key, pinion=f"{key}.pinion", wheel=f"{key}.wheel"):
        return Mesh(pinion, wheel, section.centre_distance, section.backlash)


def check_ring(place, ring, pinion, words=""):
    """Refuse a ring gear, named by `place`, with no more teeth than the gear inside."""
    words = words or f"an integer >= {pinion.teeth + 1}, more than the {pinion.teeth} of the pinion"
    checks.require(ring.teeth > pinion.teeth, f"{place}.teeth", ring.teeth, words)


def six_degrees(mesh):
    """Return what the section `six_degrees` has of a drawing, without friction and run-out."""
    from gearlib.models.geometry.mesh import bodies

    bodies_of_drawing = {
        key: rounded(value) for key, value in bodies(mesh).items() if key != "teeth"
    }
    zeros = {"friction": [0.0] * 2, "eccentricities": [0.0] * 2, "bearing_damping": [0.0] * 4}
    return bodies_of_drawing | zeros


def derived(key, derive, names=(), **options):
    """Return the values that `derive` finds for a pair, rounded; `names` of stiffness options."""
    with naming(key, names, pinion=f"{key}.pinion", wheel=f"{key}.wheel"):
        values = derive(**options)
    return {name: rounded(value) for name, value in values.items()}


def coefficient(name, value, stiffness, mass):
    """Return the damping, N s/m, rounded, of a ratio or decrement by its name; N/m and kg."""
    from gearlib.models.geometry.mesh import coefficient

    return rounded(coefficient(value, stiffness, mass, name == "logarithmic_decrement"))


def stiffness_method(key, section):
    """Return the arguments of a stiffness as the library has them."""
    arguments = section.model_dump(include={"stiffness", "stiffness_options"})
    if "stiffness_options" in arguments:
        arguments["options"] = arguments.pop("stiffness_options")
        if "torque" in arguments["options"]:
            raise ValueError(
                f"{key}.stiffness_options.torque is not allowed: it must be {key}.torque"
            )
    return arguments


def naming(key, options=None, **places):
    """Name keys in full where the geometry refuses.

    `key` is that of the section, `options` are names of stiffness options, `places` the full keys
    of gears by their names.
    """
    from gearlib.models.geometry.drawings import RACK_FIELDS, renaming

    ring = places.get("ring", places.get("wheel"))
    of_part = places | {"ring gear": ring, "tip relief": f"{key}.tip_relief"}
    of_part |= {part: f"{key}.{part}" for part in ("web", "material")}

    def rename(name, part):
        if name.endswith(" of the tip relief"):
            name = f"tip_relief.{name.split()[0]}"
        if part == "rack":
            return f"{key}.{next(own for own, field in RACK_FIELDS.items() if field == name)}"
        if part in of_part:
            return f"{of_part[part]}.{name}"
        if part in ("sun mesh", "ring mesh"):
            if name == "backlash":
                return f"{key}.backlashes[{int(part == 'ring mesh')}]"
            if name == "centre_distance":
                return f"{key}.{name}"
            return f"{key}: {name} of the {part}"
        if part == "shifts":
            return f"sum of {' and '.join(f'{place}.shift' for place in places.values())}"
        if name == "contact_ratio":
            return f"contact_ratio of {key}"
        if name in (options or ()):
            return f"{key}.stiffness_options.{name}"
        return f"{ring if ring and name == 'outer_diameter' else key}.{name}"

    return renaming(rename)


def rounded(value):
    """Return a number, or a list of them, with 12 digits, an integer or a name as it is."""
    if isinstance(value, list):
        return [rounded(entry) for entry in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


Torque, Power, Speed = map(type_of, (parameters.DRIVING_TORQUE, parameters.POWER, parameters.SPEED))
_ADDENDUM, _DEDENDUM, _RADIUS = (type_of(one.kind) for one in parameters.declared(Rack).values())
_OF_RING = ("internal", "outer_diameter")

#: FZG type C, ISO 14635-2, at load stage 9 on shafts of 30 mm; backlash and quality: choices.
FZG_C = {
    "pinion": {
        "teeth": 16,
        "module": 4.5e-3,
        "width": 0.014,
        "shift": 0.1817,
        "tip_diameter": 0.08246,
        "bore": 0.03,
        "quality": 5,
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


MaterialSection = like("MaterialSection", "Elastic material of a gear.", Material)
WebSection = like("WebSection", "Web between rim and hub.", Web)
TipReliefSection = like("TipReliefSection", "Tip relief of a gear.", TipRelief)
GearSection = like(
    "GearSection",
    "One gear by its drawing, see `gearlib.geometry.SpurGear`.",
    SpurGear,
    without=_OF_RING,
    optional=("module", "width", "pressure_angle", "helix_angle", "rack"),
    addendum=(_ADDENDUM, entry("Of another rack, h_aP in modules.", None)),
    dedendum=(_DEDENDUM, entry("Likewise, h_fP in modules.", None)),
    fillet_radius=(_RADIUS, entry("Likewise, rho_fP in modules.", None)),
    web=(WebSection, entry("Web between rim and hub.", None)),
    material=(MaterialSection, entry("Default: steel.", None)),
    tip_relief=(TipReliefSection, entry("Default: none.", None)),
)
_WORDS = "The driving gear by its drawing; its revolutions are counted."
PinionSection = like("PinionSection", _WORDS, SpurGear, "module", "width", base=GearSection)
_WORDS = "The other gear; left out, its module, width, angles, rack and material are the pinion's."
WheelSection = like("WheelSection", _WORDS, SpurGear, *_OF_RING, base=GearSection)
_WORDS = "A gear of a train by its drawing, see `gearlib.geometry.SpurGear`."
BodyGear = like("BodyGear", _WORDS, SpurGear, *_OF_RING, base=PinionSection)


_Placed = like("_Placed", "Two drawn gears in their places.", Mesh)


class MethodSection(Given):
    """How the stiffness of drawn gears is found."""

    stiffness: Literal["iso", "energy"] = entry(
        "ISO 6336-1, method B, or the energy method. Default: iso.", None
    )
    stiffness_options: dict[Name, Option] = entry(
        "Of that method: iso has application_factor; energy samples, coupling, hertz.", None
    )


class DrawnPair(_Placed):
    """A pair of gears by their drawing, and its load."""

    pinion: PinionSection
    wheel: WheelSection
    torque: Torque = entry("Of the pinion, N m.")

    def check(self, place, *methods):
        """Refuse gears, named by `place`, that cannot be or have no stiffness by these methods."""
        # These can be: no start of the workflow loads the geometry for them.
        of_drawing = attrgetter("pinion", "wheel", "centre_distance")
        known = [of_drawing(DrawnPair.unchecked(**pair)) for pair in (FZG_C, TWENTY)]
        if of_drawing(self) in known:
            return
        mesh = mesh_of(place, self)
        for method in methods:
            derived(place, mesh.pair_parameters, torque=self.torque, stiffness=method)

    def relief(self):
        """Return the first key by which flanks are no involutes, "" where they are."""
        for gear in ("pinion", "wheel"):
            for key in ("tip_relief", "pitch_errors"):
                if getattr(getattr(self, gear), key):
                    return f"{gear}.{key}"
        return ""


class Gears(MethodSection, DrawnPair):
    """A pair of gears by their drawing, in place of gear_pair, which is derived from it."""

    torque: Torque = entry("Of the pinion, N m; or power and speed.", None)
    power: Power = entry("Of the pinion, W.", None)
    speed: Speed = entry("Of the pinion, rpm; with a torque, of its duty point.", None)

    @model_validator(mode="after")
    def _check(self):
        self.pair()
        return self

    def mesh(self):
        """Return the `gearlib.geometry.Mesh`; gears that cannot be are refused by their keys."""
        return mesh_of("gears", self)

    def load(self):
        """Return torque, or power and speed, as a dict."""
        return self.model_dump(include={"torque", "power", "speed"})

    def driving_torque(self):
        """Return the torque of the pinion, N m, to 12 digits."""
        from gearlib.models.geometry.mesh import torque_of

        return rounded(torque_of(self.torque, self.power, self.speed))

    def described(self):
        """Return the drawing, its stiffness and torque as the library takes them, as a dict."""
        keys = {"pinion", "wheel", "centre_distance", "backlash", "stiffness", "stiffness_options"}
        return self.model_dump(include=keys) | {"torque": self.driving_torque()}

    def pair(self):
        """Return the keys of `gear_pair` as a dict, to 12 digits; refuses as `mesh` does."""
        given = self.load() | stiffness_method("gears", self)
        names = self.stiffness_options or ()
        found = derived("gears", self.mesh().pair_parameters, names, **given)
        for key in ("material_damping", "backlash_damping"):
            del found[key]
        return found


class PublishedPair(DrawnPair):
    """A pair of gears by their drawing, with what others find for it."""

    published: dict[Name, Stiffness] = entry(
        "Mean mesh stiffness in the literature by source, N/m.", {}
    )


class MeshStiffness(Section):
    """The mesh stiffness of drawn pairs by every method, with its uncertainty."""

    pairs: Annotated[dict[Name, PublishedPair], Field(min_length=1, max_length=6)] = Field(
        default={
            "z20-20": PublishedPair.unchecked(**TWENTY, published={"ISO": 4.9e8, "thumb": 5.2e8}),
            "FZG-C": PublishedPair.unchecked(**FZG_C),
        },
        description="Drawn pairs by name.",
    )
    samples: whole(8, 4096) = entry("Phases of a course over the mesh period.", 64)

    @model_validator(mode="after")
    def _check(self):
        for name, pair in self.pairs.items():
            self.check_gears(f"mesh_stiffness.pairs.{name}", pair)
        return self

    def check_gears(self, place, pair):
        """Refuse a `DrawnPair`, named by `place`, whose stiffness not all methods give."""
        pair.check(place, "iso", "energy")


class HarrisMap(Section):
    """The static transmission error of spur gears at several loads, with reliefs that are found."""

    gears: DrawnPair = entry(
        "The pair at its design load, without tip relief; by default FZG type C.",
        DrawnPair.unchecked(**FZG_C | {"backlash": 160e-6}),
    )
    stiffness: Literal["energy", "iso"] = entry(
        "How the stiffness of a pair of teeth is found.", "energy"
    )
    loads: listing(NonNegative, "Over the design load.") = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5]
    phases: whole(8, 10_000) = entry("Phases of a mesh period.", 256)

    @model_validator(mode="after")
    def _check(self):
        self.check_gears("harris_map.gears", self.gears)
        return self

    def check_gears(self, place, gears):
        """Refuse a `DrawnPair`, named by `place`, that has no Harris map."""
        for name in ("pinion", "wheel"):
            gear = getattr(gears, name)
            for key in ("helix_angle", "tip_relief", "pitch_errors"):
                if getattr(gear, key):
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
    """Return name -> `PublishedPair` of a section: its gears, else those of the configuration."""
    if not takes_configured_gears(c, section):
        pairs = getattr(getattr(c, section), _KEYS[section])
        return pairs if section == "mesh_stiffness" else {section: pairs}
    gears = {"pinion": c.gears.pinion, "wheel": c.gears.wheel}
    name = f"z{gears['pinion'].teeth}-{gears['wheel'].teeth}"
    if section == "harris_map":
        # The map is that of the reliefs it finds.
        gears = {key: gear.model_copy(update={"tip_relief": None}) for key, gear in gears.items()}
    more = {key: getattr(c.gears, key) for key in ("centre_distance", "backlash")}
    return {name: PublishedPair.unchecked(**gears, **more, torque=c.gears.driving_torque())}


def refusal(c, section):
    """Return why a section cannot take the gears of the configuration, or ""."""
    if takes_configured_gears(c, section):
        try:
            (pair,) = drawn_pairs(c, section).values()
            getattr(c, section).check_gears("gears", pair)
        except ValueError as error:
            return str(error)
    return ""
