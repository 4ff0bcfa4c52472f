"""From the sections of drawn gears to `gearlib.geometry`; what it refuses is named by its key.

The geometry is loaded where a configuration has such sections.
"""

from gearlib import checks

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


def method(key, section):
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
