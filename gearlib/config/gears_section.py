"""Gears by their drawing: the section `gears`, in place of `gear_pair`, and pairs of studies."""

from operator import attrgetter
from typing import Literal

from pydantic import model_validator

from gearlib import parameters
from gearlib.config import drawing
from gearlib.config.types import Given, Name, Option, entry, like, type_of
from gearlib.models.geometry.gear import Material, Rack, SpurGear, TipRelief, Web
from gearlib.models.geometry.mesh import Mesh

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
        mesh = drawing.mesh_of(place, self)
        for method in methods:
            drawing.derived(place, mesh.pair_parameters, torque=self.torque, stiffness=method)

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
        return drawing.mesh_of("gears", self)

    def load(self):
        """Return torque, or power and speed, as a dict."""
        return self.model_dump(include={"torque", "power", "speed"})

    def driving_torque(self):
        """Return the torque of the pinion, N m, to 12 digits."""
        from gearlib.models.geometry.mesh import torque_of

        return drawing.rounded(torque_of(self.torque, self.power, self.speed))

    def described(self):
        """Return the drawing, its stiffness and torque as the library takes them, as a dict."""
        keys = {"pinion", "wheel", "centre_distance", "backlash", "stiffness", "stiffness_options"}
        return self.model_dump(include=keys) | {"torque": self.driving_torque()}

    def pair(self):
        """Return the keys of `gear_pair` as a dict, to 12 digits; refuses as `mesh` does."""
        given = self.load() | drawing.method("gears", self)
        names = self.stiffness_options or ()
        found = drawing.derived("gears", self.mesh().pair_parameters, names, **given)
        for key in ("material_damping", "backlash_damping"):
            del found[key]
        return found
