"""Gears by their drawing: the section `gears`, in place of `gear_pair`, and pairs of studies."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from gearlib.config import drawing
from gearlib.config.types import (
    Given,
    Length,
    Name,
    Option,
    RunOut,
    Section,
    Truth,
    integer_within,
    number_within,
    quantity,
)

Torque = quantity("N m", "302 N m", gt=0)
Power = quantity("W", "30 kW", gt=0)
Speed = quantity("rpm", "2000 rpm", gt=0)
ReferenceAngle = quantity("rad", "20 deg", gt=0, lt=0.785)
HelixAngle = quantity("rad", "15.8 deg", ge=0, lt=1.047)
InModules = number_within(gt=0, le=3)
Internal = Annotated[Truth, Field(description="Whether it is a ring gear. Default: false.")]
OuterDiameter = Annotated[
    Length, Field(description="Of the rim of a ring gear, m; its inertia needs it.")
]

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


class MaterialSection(Given):
    """Elastic material of a gear."""

    young: quantity("Pa", "206 GPa", gt=0) = Field(
        default=None, description="Modulus of elasticity, Pa. Default: 206 GPa."
    )
    poisson: number_within(ge=0, lt=0.5) = Field(
        default=None, description="Poisson's ratio. Default: 0.3."
    )
    density: quantity("kg/m^3", "7.85 g/cm^3", gt=0) = Field(
        default=None, description="kg/m^3. Default: 7850."
    )


class WebSection(Section):
    """Web between rim and hub."""

    thickness: Length = Field(description="b_s, m.")
    rim_diameter: Length = Field(description="Inside of the rim, m.")
    hub_diameter: Length = Field(description="Outside of the hub, m.")


class TipReliefSection(Given):
    """Tip relief of a gear."""

    amount: RunOut = Field(description="C_a, normal to the flank, m.")
    length: Length = Field(description="L_Ca, along the path of contact, m.")
    shape: Literal["linear", "parabolic"] = Field(
        default=None, description="Over that length. Default: linear."
    )


class GearSection(Given):
    """One gear by its drawing, see `gearlib.geometry.SpurGear`."""

    teeth: integer_within(ge=3, le=10_000) = Field(description="z.")
    module: Length = Field(default=None, description="Normal module m_n, m.")
    width: Length = Field(default=None, description="Face width b, m.")
    shift: number_within(ge=-3, le=3) = Field(
        default=None, description="Profile shift coefficient x. Default: 0."
    )
    pressure_angle: ReferenceAngle = Field(
        default=None, description="Of the basic rack, alpha_n, rad. Default: 20 degrees."
    )
    helix_angle: HelixAngle = Field(default=None, description="beta, rad. Default: 0.")
    tip_diameter: Length = Field(
        default=None,
        description="d_a, m. Default: d + 2 m_n (x + addendum), of a ring gear with -.",
    )
    rack: Literal["A", "B", "C", "D"] = Field(
        default=None, description="Basic rack by its letter in ISO 53. Default: A."
    )
    addendum: InModules = Field(
        default=None, description="Of another rack, h_aP in modules. Default: that of `rack`."
    )
    dedendum: InModules = Field(default=None, description="Likewise, h_fP in modules.")
    fillet_radius: number_within(ge=0, le=3) = Field(
        default=None, description="Likewise, rho_fP in modules."
    )
    thickness_allowance: quantity("m", "-50 um", le=0) = Field(
        default=None, description="Upper allowance of the tooth thickness E_sns, m. Default: 0."
    )
    bore: RunOut = Field(default=None, description="Diameter, m. Default: 0.")
    web: WebSection = Field(default=None, description="Web between rim and hub.")
    material: MaterialSection = Field(default=None, description="Default: steel.")
    quality: integer_within(ge=1, le=11) = Field(
        default=None, description="Flank tolerance class of ISO 1328-1:2013."
    )
    tip_relief: TipReliefSection = Field(default=None, description="Default: none.")
    pitch_errors: Annotated[list[quantity("m", "5 um")], Field(min_length=1)] = Field(
        default=None,
        description="By how much each flank lies back, tooth after tooth, m. Default: 0.",
    )


class PinionSection(GearSection):
    """The driving gear by its drawing; its revolutions are counted."""

    module: Length = Field(description="Normal module m_n, m.")
    width: Length = Field(description="Face width b, m.")


class WheelSection(GearSection):
    """The other gear; left out, its module, width, angles, rack and material are the pinion's."""

    internal: Internal = None
    outer_diameter: OuterDiameter = None


class BodyGear(PinionSection):
    """A gear of a train by its drawing, see `gearlib.geometry.SpurGear`."""

    internal: Internal = None
    outer_diameter: OuterDiameter = None


class MethodSection(Given):
    """How the stiffness of drawn gears is found."""

    stiffness: Literal["iso", "energy"] = Field(
        default=None, description="ISO 6336-1, method B, or the energy method. Default: iso."
    )
    stiffness_options: dict[Name, Option] = Field(
        default=None,
        description="Of that method: iso has application_factor; energy samples, coupling, hertz.",
    )


class DrawnPair(Given):
    """A pair of gears by their drawing, and its load."""

    pinion: PinionSection
    wheel: WheelSection
    centre_distance: Length = Field(
        default=None, description="a, m. Default: without backlash by the shifts."
    )
    backlash: RunOut = Field(
        default=None,
        description="Normal backlash j_bn, m. Default: what shifts, allowances and centre distance "
        "leave.",
    )
    torque: Torque = Field(description="Of the pinion, N m.")

    def check(self, place, *methods):
        """Refuse gears that cannot be, or whose stiffness these methods cannot find.

        Parameters
        ----------
        place : str
            Full key of the section, which the message names.
        *methods : {"iso", "energy"}
        """
        # These can be: no start of the workflow loads the geometry for them.
        keys = {"pinion", "wheel", "centre_distance"}
        known = [{key: pair[key] for key in keys & pair.keys()} for pair in (FZG_C, TWENTY)]
        if self.model_dump(include=keys) in known:
            return
        mesh = drawing.mesh_of(place, self)
        for method in methods:
            drawing.derived(place, mesh.pair_parameters, torque=self.torque, stiffness=method)


class Gears(MethodSection, DrawnPair):
    """A pair of gears by their drawing, in place of gear_pair, which is derived from it."""

    torque: Torque = Field(default=None, description="Of the pinion, N m; or power and speed.")
    power: Power = Field(default=None, description="Of the pinion, W.")
    speed: Speed = Field(default=None, description="Of the pinion, rpm.")

    @model_validator(mode="after")
    def _check(self):
        self.pair()
        return self

    def mesh(self):
        """Return the `gearlib.geometry.Mesh`.

        Raises
        ------
        ValueError
            If there cannot be such gears; the message names the key.
        """
        return drawing.mesh_of("gears", self)

    def load(self):
        """Return torque, or power and speed, as a dict."""
        return self.model_dump(include={"torque", "power", "speed"})

    def pair(self):
        """Return the keys of `gear_pair` as a dict, rounded to 12 digits.

        Raises
        ------
        ValueError
            If there cannot be such gears; the message names the key.
        """
        given = self.load() | drawing.method("gears", self)
        names = self.stiffness_options or ()
        found = drawing.derived("gears", self.mesh().pair_parameters, names, **given)
        for key in ("material_damping", "backlash_damping"):
            del found[key]
        return found
