"""Options of the commands, from keys of the configuration and from a table."""

import math
import re
import warnings
from pathlib import Path

import click
import yaml

from gearlib import units
from gearlib.checks import InputError
from gearlib.config import validation
from gearlib.config.gear_pair_section import DAMPINGS, Damping, GearPairSection
from gearlib.config.gears_section import Gears, WheelSection
from gearlib.data.variables import QUANTITIES

FILE = click.Path(dir_okay=False, path_type=Path)
#: Suffixes of files of data, configurations and pictures.
DATA, YAML, PICTURES = (".nc", ".csv"), (".yaml", ".yml"), (".png", ".svg", ".pdf")

#: Package that a command needs -> the extra that installs it.
_EXTRAS = {"bokeh": "explore", "panel": "explore", "snakemake": "workflow"}


def number_or_text(text):
    """Return the value of an option as int or float, or as a string if it is not a plain number.

    Strings such as "40 um" are converted later, when the required unit is known. NaN stays a
    string, so that it is refused later.
    """
    for number_type in (int, float):
        try:
            number = number_type(text)
        except ValueError:
            continue
        return text if math.isnan(number) else number
    # The next option was taken as a value, because the user gave one of two values.
    if text.startswith("--"):
        raise click.UsageError(f"{text} is not allowed as a value: some options take two values")
    return text


def in_unit(unit, example):
    """Return a click type: a function that converts the string of an option to a number in `unit`.

    The strings are plain numbers or, like `example`, have a unit.
    """

    def number(text):
        """Return the number, or raise the error that click reports with the name of the option."""
        value = number_or_text(text)
        try:
            return float(units.read(value, unit) if isinstance(value, str) else value)
        except ValueError:
            allowed = f"it must be a number in {unit}, or a text with its unit such as {example!r}"
            raise click.BadParameter(f"{text!r} is not allowed: {allowed}") from None

    return number


def mapping_of(text):
    """Return the content of the YAML string of an option, such as a dict.

    If the string is not YAML, raise the error that click reports with the name of the option.
    """
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        allowed = "it must be a mapping such as '{kind: fourier, harmonics: 5}'"
        raise click.BadParameter(f"{text!r} is not YAML: {allowed}") from None


class Command(click.Command):
    """A command whose option --teeth takes one or two values."""

    def parse_args(self, ctx, args):
        """Join two values of --teeth to one, since click options have a fixed number of values.

        `ctx` is the click context, `args` the list of command-line arguments.
        """
        # "--teeth=18" is divided into the option and its value.
        args = [part for arg in args for part in re.split("(?<=^--teeth)=", arg)]
        # The command `fit` has an argument, which may follow a single number of teeth.
        wheel_teeth = r"[-+]?[\d.]+" if ctx.command.name == "fit" else r"[^-].*|-[\d.].*"
        # The list becomes shorter at each pair of values, so it is searched from its end.
        for i in reversed(range(len(args) - 2)):
            is_pair = args[i] == "--teeth" and not args[i + 1].startswith("--")
            if is_pair and re.fullmatch(wheel_teeth, args[i + 2]):
                args = [*args[: i + 1], f"{args[i + 1]} {args[i + 2]}", *args[i + 3 :]]
        return super().parse_args(ctx, args)


class Group(click.Group):
    """Commands that print the library's warnings and report a ValueError as wrong usage."""

    command_class = Command

    def invoke(self, ctx):
        """Run the command in a click context; convert errors of the library to click errors.

        Click prints its errors as one line and exits with the code 2 (wrong input) or 1.
        """
        try:
            with warnings.catch_warnings():
                warnings.showwarning = lambda text, *_: click.echo(f"Warning: {text}", err=True)
                return super().invoke(ctx)
        except ValueError as error:
            is_input = isinstance(error, InputError)
            text = validation.sentence(error, "", {}) if is_input else str(error)
            # Without a configuration the damping of the options is called "options".
            raise click.UsageError(text.replace("dampings.options.", "")) from None
        except ModuleNotFoundError as error:
            extra = _EXTRAS.get(str(error.name).partition(".")[0])
            text = str(error)
            if extra:
                text = f"{error.name} is not installed: pip install 'gearlib[{extra}]'"
                text += f", the extra {extra}"
            raise click.ClickException(text) from None
        except BrokenPipeError:
            raise  # If the reader of the output ends, as `| head` does, click exits silently.
        except OSError as error:
            parts = (error.filename, error.strerror) if error.strerror else (error,)
            raise click.ClickException(": ".join(map(str, filter(None, parts)))) from None


def option(name, help_text, default_or_type=None, flags=(), **settings):
    """Return a `click.Option` for the option `name`, such as --max-seconds for "max_seconds".

    `help_text` is its help. `default_or_type` is the type of its values if it is callable, else its
    default value; False makes the option a flag without a value, None means neither type nor
    default. `flags` are additional names such as "-o", `settings` additional arguments of
    `click.Option`.
    """
    if default_or_type is False:
        settings["is_flag"] = True
    elif callable(default_or_type):
        settings["type"] = default_or_type
    elif default_or_type is not None:
        settings |= {"default": default_or_type, "show_default": True}
    # The name "initial_state" is shortened on the command line.
    flag = "--state" if name == "initial_state" else f"--{name.replace('_', '-')}"
    return click.Option([*flags, flag, name], help=help_text, **settings)


def key_options(key_groups):
    """Return the click options for keys of the configuration.

    `key_groups` is a list such as `GEOMETRY` of tuples (class of a section, names of its keys,
    places of such sections in the configuration). Options of both gears take two values.
    """
    click_options = []
    for section, names, section_keys in key_groups:
        settings = {"nargs": 2, "metavar": "PINION WHEEL"} if section_keys == _BOTH_GEARS else {}
        for name in names:
            # The key `internal` is true or false, so its option is a flag (False) without a value.
            value_type = False if name == "internal" else number_or_text
            help_text = section.model_fields[name].description
            click_options.append(option(name, help_text, value_type, **settings))
    return click_options


_BOTH_GEARS = ["gears.pinion", "gears.wheel"]
#: Config keys that are options: of gear geometry, of the mesh, of a gear pair. Each group has a
#: section class, names of its keys, and the places of such sections in the configuration.
GEOMETRY = [
    (WheelSection, ["shift", "tip_diameter", "bore", "thickness_allowance"], _BOTH_GEARS),
    (WheelSection, ["module", "width", "pressure_angle", "helix_angle", "rack"], _BOTH_GEARS[:1]),
    (WheelSection, ["internal", "outer_diameter"], _BOTH_GEARS[1:]),
    (Gears, ["centre_distance", "torque", "stiffness"], ["gears"]),
    (Damping, ["damping_ratio"], ["dampings"]),
]
MESH = [(Gears, ["backlash", "power", "speed"], ["gears"])]
_NAMES = [name for name in GearPairSection.model_fields if name != "teeth"]
PAIR_KEYS = [(GearPairSection, _NAMES, ["gear_pair"]), (Damping, DAMPINGS, ["dampings"])]
_CONFIGURATION = click.Path(exists=True, dir_okay=False, path_type=Path)
_MODELS = click.Choice(["teeth", "rectangle", "six_degrees", "train"])
_BEARING = "of each bearing of --model six_degrees, along and across the line of action"
_STATE = {"type": float, "nargs": 2, "metavar": "X V"}
_DIRECTIONS = {"type": click.Choice(["cold", "up", "down"])}
_MANY = {"multiple": True}
_QUANTITY = _MANY | {"type": click.Choice(list(QUANTITIES)), "metavar": "NAME"}

#: Name of an option, or of a command and its option -> help, default value or type, settings.
_TABLE = {
    "config": ("Configuration. Default: config.yaml of this folder.", _CONFIGURATION),
    "damping": ("Damping of the configuration, by name. Default: the first.", str),
    "teeth": ("Number of teeth, z.", number_or_text, {"metavar": "TEETH | PINION WHEEL"}),
    "model": (
        "Model of the gears. Default: pairs of teeth of gears given by geometry, else rectangle.",
        _MODELS,
    ),
    "profile": ("Profile of the mesh stiffness, as '{kind: fourier, harmonics: 5}'.", mapping_of),
    "bearing_stiffness": (f"Stiffness {_BEARING}, N/m.", number_or_text),
    "bearing_damping": (f"Damping {_BEARING}, N s/m.", number_or_text),
    "tuning": ("Mesh frequency over mean eigenfrequency, nu; or give --speed.", float),
    "speed": ("Speed of the pinion, rpm.", number_or_text),
    "initial_state": (
        "Initial displacement, static deflections, and dx/dtau. Default: 0 0, of pairs of teeth "
        "the static equilibrium.",
        *(None, _STATE),
    ),
    "run-up initial_state": (
        "Initial displacement, static deflections, and dx/dtau. Default: in static equilibrium.",
        *(None, _STATE),
    ),
    "guess": ("Displacement, static deflections, and dx/dtau near the orbit.", None, _STATE),
    "periods": ("Mesh periods of each run.", 200),
    "trust periods": (
        "Mesh periods in which the motion settles.",
        2000,
        {"type": click.IntRange(32)},
    ),
    "record_periods": ("Last mesh periods, which are recorded.", 1),
    "sweep record_periods": ("Last mesh periods, which are evaluated.", 10),
    "simulate samples": ("Samples per mesh period.", 256, {"type": click.IntRange(1)}),
    "max_seconds": ("Seconds after which the command ends with what is done.", float),
    "method": ("Method, a name of gearlib.methods().", str),
    "until_settled": ("Continue until the motion repeats.", False),
    "start": (
        "First tuning, or speed such as 1500rpm. Default: 0.5, of sweeps up and down 0.1.",
        number_or_text,
    ),
    "stop": ("Last tuning, or speed such as 5000rpm. Default: 1.4.", number_or_text),
    "points": ("Number of tunings.", 901, {"type": click.IntRange(2, 10_000_000)}),
    "direction": (
        "Start from rest, or from the run before, up or down. Default: up and down for pairs of "
        "teeth, else cold.",
        *(None, _DIRECTIONS),
    ),
    "run-up start": ("First speed, rpm.", number_or_text),
    "run-up stop": ("Last speed, rpm.", number_or_text),
    "duration": ("Time from the first to the last speed, s.", in_unit("s", "2 s")),
    "acceleration": (
        "Rate of the speed, rpm/s; replaces --duration.",
        in_unit("rpm/s", "50 rpm/s"),
    ),
    "back": ("Return to the first speed.", False),
    "driver": ("Driving body of a train. Default: that with the largest power.", str),
    "period": ("Mesh periods after which the orbit repeats.", 1),
    "phase": ("Mesh phase, rad.", 0.0, {"type": in_unit("rad", "90 deg")}),
    "count": ("Highest order.", 6),
    "campbell count": ("Highest order of a mesh.", 1),
    "tolerance": ("Tolerance, 'load std=5%'; may be repeated.", str, _MANY | {"flags": ["-t"]}),
    "quantity": (f"Quantity, of {', '.join(QUANTITIES)}; may be repeated.", None, _QUANTITY),
    "free": ("Parameter to fit, NAME[=LOW,HIGH]; may be repeated. Default: of DATA.", str, _MANY),
    "thickness_class": ("Class of the tooth thickness, DIN 3967: 26cd, or '26cd 25cd'.", str),
    "distance_class": ("Class of the centre distance, DIN 3964: js7.", str),
    "quality": ("Quality by ISO 1328-1, within which profiles scatter.", click.IntRange(1, 11)),
    "samples": ("Number of designs.", 1024, {"type": click.IntRange(1)}),
    "scatter points": (
        "Number of tunings of the runs of each design, or 0.",
        91,
        {"type": click.IntRange(0)},
    ),
    "seed": ("Seed of the Sobol' points.", 0),
    "format": ("Format of the table.", "text", {"type": click.Choice(["text", "json", "csv"])}),
    "save": ("Configuration to write, .yaml.", FILE),
    "port": ("Port on this machine. Default: any free one.", click.IntRange(0, 65535)),
    "fmu output": (
        "FMU to write, .fmu. Default: FILE with this ending.",
        FILE,
        {"flags": ["-o"]},
    ),
    "prescribed_speed": ("Make the speed an input, which is held.", False),
    "fmu speed": ("Speed of the reference pinion at the start, rpm.", number_or_text),
    "output": ("File to write: .nc (netCDF) or .csv (table).", FILE, {"flags": ["-o"]}),
    "plot": (f"Picture to draw: {', '.join(PICTURES)}.", FILE),
    "force": ("Replace existing files.", False),
}


def command_options(command_name, option_names):
    """Return the click options of a command, which are described in `_TABLE`.

    `option_names` is a string with the names of the options, separated by spaces.
    """
    click_options = []
    for name in option_names.split():
        # An entry such as "trust periods" for one command takes precedence over "periods".
        command_entry = _TABLE.get(f"{command_name} {name}")
        help_text, default_or_type, *settings = command_entry or _TABLE[name]
        # `settings` is empty or has one dict with further arguments of `option`.
        click_options.append(option(name, help_text, default_or_type, **dict(*settings)))
    return click_options


_GEARS = command_options("", "config damping teeth") + key_options(GEOMETRY)
#: Options of two gears given by geometry, of any gear pair, of any model.
STAGE, PAIR = _GEARS + key_options(MESH), _GEARS + key_options(PAIR_KEYS)
MODEL = PAIR + command_options("", "model profile bearing_stiffness bearing_damping")
