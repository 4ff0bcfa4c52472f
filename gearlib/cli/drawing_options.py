"""Options that draw two gears, and the section of a configuration that they make."""

import click

from gearlib.config import laid_over
from gearlib.config.gears_section import Gears, WheelSection

#: What both gears have in common, and what each has of its own; the options of these take two.
_COMMON = ("module", "width", "pressure_angle", "helix_angle", "rack")
_EACH = ("teeth", "shift", "tip_diameter", "bore", "thickness_allowance")
_OF_MESH = ("centre_distance", "backlash", "torque", "power", "speed", "stiffness")
#: Stands for the damping that nothing says.
_NONE = {"none": {"material_damping": 0.0, "backlash_damping": 0.0}}


def decorators(without=()):
    """Return the options, but for those `without` which the command goes."""
    return [option for key, option in _options() if key not in without]


def _options():
    for key in _EACH:
        words = WheelSection.model_fields[key].description
        names = {"nargs": 2, "metavar": "PINION WHEEL"}
        yield key, click.option(_name(key), key, help=words, **names)
    for key in _COMMON:
        yield key, click.option(_name(key), key, help=WheelSection.model_fields[key].description)
    yield "internal", click.option("--internal", is_flag=True, help="The wheel is a ring gear.")
    words = WheelSection.model_fields["outer_diameter"].description
    yield "outer_diameter", click.option("--outer-diameter", help=words)
    for key in _OF_MESH:
        yield key, click.option(_name(key), key, help=Gears.model_fields[key].description)
    words = "beta in contact, in place of the dampings."
    yield "damping_ratio", click.option("--damping-ratio", help=words)


def _name(key):
    return f"--{key.replace('_', '-')}"


def section(given, without=()):
    """Take the values of the options out of `given`; return the section `gears` that they make."""
    given = {key: given.pop(key) for key, _ in _options() if key in given and key not in without}
    found: dict = {"pinion": {}, "wheel": {}}
    wheel = {"internal": given.pop("internal") or None}
    wheel["outer_diameter"] = given.pop("outer_diameter")
    pinion = {key: given.pop(key) for key in _COMMON}
    for key in _EACH:
        pinion[key], wheel[key] = given.pop(key, None) or (None, None)
    of_mesh = {key: given.pop(key, None) for key in _OF_MESH}
    for own, values in ((found["pinion"], pinion), (found["wheel"], wheel), (found, of_mesh)):
        own |= {
            key: value if value is True else number(value)
            for key, value in values.items()
            if value is not None
        }
    return found


def number(text):
    """Return the number that a text is; other texts may have a unit."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def laid(mapping, drawn, damping, damping_ratio=None):
    """Return a configuration of these gears: sections `gears` and `dampings` laid over `mapping`.

    damping, damping_ratio: as the options have them, or None.
    """
    # Coefficients suit the pair for which they were made.
    own = ("gears", "dampings") if "gears" in mapping or damping is not None else ()
    kept = {key: mapping[key] for key in own if key in mapping}
    whole = laid_over({"dampings": _NONE} | kept, {"gears": drawn})
    if "power" in drawn and not whole["gears"].keys() & {"speed", "torque"}:
        raise click.UsageError("--speed is missing: it must be given in rpm, where --power is")
    if damping_ratio is not None:
        whole["dampings"] = ratios(damping_ratio)
    return whole


def damped(mapping):
    """Return whether a configuration says anything of damping."""
    return mapping.get("dampings") != _NONE


def check_damped(mapping):
    """Refuse gears of whose damping nothing is said, where they shall move or be kept."""
    if not damped(mapping):
        raise click.UsageError(
            "damping_ratio is missing: it must be a finite number >= 0 and < 1, given as "
            "--damping-ratio, or the configuration must have dampings"
        )


def ratios(damping_ratio):
    """Return the section `dampings` of the option of this name."""
    return {"ratio": {"damping_ratio": number(damping_ratio), "backlash_damping_ratio": 0.0}}
