"""Sections of drawn gears in a train, and their check before any job runs."""

from pydantic import model_validator

from gearlib.config import drawing
from gearlib.config.gears_section import (
    GearSection,
    MethodSection,
    PinionSection,
    Power,
    Speed,
    Torque,
)
from gearlib.config.types import entry, like
from gearlib.models.geometry.gear import SpurGear
from gearlib.models.trains.planetary import planetary_set

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
        given |= drawing.method("train.planetary_set", self)
        given["torque"] = drawing.rounded(torque_of(self.torque, self.power, self.speed))
        return given


#: Keys of a mesh that suit drawn gears only, and the coefficient in place of ratios.
OF_DRAWN = {*DampingByRatio.model_fields, "torque", "centre_distance"}


def check_planets(key, section):
    """Refuse a planetary set that cannot be, before any job; the message names the key."""
    from gearlib.models.geometry.drawings import planets_of

    keys = {name: f"{key}.{name}" for name in ("sun", "planet", "ring")}
    wanted = f"z_s + 2 z_p = {section.sun.teeth + 2 * section.planet.teeth}"
    drawing.check_ring(keys["ring"], section.ring, section.planet, f"{wanted}, or near to it")
    sun = drawing.gear_of(keys["sun"], section.sun)
    planet = drawing.gear_of(keys["planet"], section.planet, like=section.sun)
    ring = drawing.gear_of(keys["ring"], section.ring, like=section.sun, internal=True)
    places = {"planets", "positions", "centre_distance", "backlashes"}
    with drawing.naming(key, section.stiffness_options, **keys):
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
            drawn[body.name] = place, drawing.gear_of(place, body.gear)
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
    own |= drawing.method(here, mesh)
    with drawing.naming(here, mesh.stiffness_options, pinion=pinion[0], wheel=wheel[0]):
        Mesh(pinion[1], wheel[1], mesh.centre_distance).train_parameters(**own)
