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
#: Suffixes of data files, configuration files and pictures.
DATA, YAML, PICTURES = (".nc", ".csv"), (".yaml", ".yml"), (".png", ".svg", ".pdf")

#: Package that a command needs -> the optional dependency group that installs it.
_EXTRAS = {"bokeh": "explore", "panel": "explore", "snakemake": "workflow"}


def number_or_text(text):
    """Convert the text of an option to int or float; return other text unchanged.

    Text such as "40 um" is converted later, when the required unit is known. "nan" is returned as
    text, so that the check of the configuration rejects it.
    """
    for number_type in (int, float):
        try:
            number = number_type(text)
        except ValueError:
            continue
        return text if math.isnan(number) else number
    # Click took the next option as a value, because the user gave only one of two values.
    if text.startswith("--"):
        raise click.UsageError(f"{text} is not allowed as a value: some options take two values")
    return text


def number_in_unit(unit, example):
    """Return a function, used as a click type, that converts text to a number in `unit`.

    The text is a plain number or a quantity with a unit, such as `example`.
    """

    def number(text):
        """Convert `text` to a float in `unit`; raise `click.BadParameter` if it is invalid."""
        value = number_or_text(text)
        try:
            return float(units.parse_quantity(value, unit) if isinstance(value, str) else value)
        except ValueError:
            allowed = f"it must be a number in {unit} or have a unit, as in {example!r}"
            raise click.BadParameter(f"{text!r} is not allowed: {allowed}") from None

    return number


def mapping_of(text):
    """Parse the YAML text of an option; raise `click.BadParameter` if it is not valid YAML."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        allowed = "it must be a mapping, e.g. '{kind: fourier, harmonics: 5}'"
        raise click.BadParameter(f"{text!r} is not YAML: {allowed}") from None


class Command(click.Command):
    """A command whose option --teeth takes one or two values."""

    def parse_args(self, ctx, args):
        """Join two values of --teeth into one argument, then parse all arguments.

        Click options take a fixed number of values, but --teeth takes one or two. `ctx` is the
        click context and `args` the list of command-line arguments.
        """
        # Split "--teeth=18" into the option and its value.
        args = [part for arg in args for part in re.split("(?<=^--teeth)=", arg)]
        # The command `fit` has an argument, which may follow a single number of teeth.
        wheel_teeth = r"[-+]?[\d.]+" if ctx.command.name == "fit" else r"[^-].*|-[\d.].*"
        # Joining two values shortens the list, so it is searched from its end.
        for i in reversed(range(len(args) - 2)):
            is_pair = args[i] == "--teeth" and not args[i + 1].startswith("--")
            if is_pair and re.fullmatch(wheel_teeth, args[i + 2]):
                args = [*args[: i + 1], f"{args[i + 1]} {args[i + 2]}", *args[i + 3 :]]
        return super().parse_args(ctx, args)


class Group(click.Group):
    """A group of commands that report warnings and errors of the library as click messages."""

    command_class = Command

    def invoke(self, ctx):
        """Run the command in the click context `ctx`; convert library errors to click errors.

        A ValueError becomes a usage error (exit code 2), other errors have the exit code 1.
        """
        try:
            with warnings.catch_warnings():
                warnings.showwarning = lambda text, *_: click.echo(f"Warning: {text}", err=True)
                return super().invoke(ctx)
        except ValueError as error:
            is_input = isinstance(error, InputError)
            text = validation.input_error_message(error, "", {}) if is_input else str(error)
            # Damping given by options is called "options"; users do not know this name.
            raise click.UsageError(text.replace("dampings.options.", "")) from None
        except ModuleNotFoundError as error:
            extra = _EXTRAS.get(str(error.name).partition(".")[0])
            text = str(error)
            if extra:
                text = f"{error.name} is not installed: pip install 'gearlib[{extra}]'"
            raise click.ClickException(text) from None
        except BrokenPipeError:
            raise  # If the reader of the output ends, as `| head` does, click exits silently.
        except OSError as error:
            parts = (error.filename, error.strerror) if error.strerror else (error,)
            raise click.ClickException(": ".join(map(str, filter(None, parts)))) from None


def option(name, help_text, default_or_type=None, flags=(), **click_arguments):
    """Return a `click.Option` for `name`, e.g. --max-seconds for "max_seconds".

    `default_or_type` is the type of the option if it is callable, else its default value. False
    makes the option a flag; None sets neither a type nor a default. `flags` are additional flags
    such as "-o". `click_arguments` are passed to `click.Option`.
    """
    if default_or_type is False:
        click_arguments["is_flag"] = True
    elif callable(default_or_type):
        click_arguments["type"] = default_or_type
    elif default_or_type is not None:
        click_arguments |= {"default": default_or_type, "show_default": True}
    # The parameter "initial_state" has a shorter flag on the command line.
    flag = "--state" if name == "initial_state" else f"--{name.replace('_', '-')}"
    return click.Option([*flags, flag, name], help=help_text, **click_arguments)


def config_key_options(key_groups):
    """Return click options that set keys of the configuration.

    `key_groups` is a list of (section class, key names, section paths), such as `GEOMETRY`. Options
    of keys that both gears have take two values.
    """
    click_options = []
    for section, names, section_keys in key_groups:
        click_arguments = (
            {"nargs": 2, "metavar": "PINION WHEEL"} if section_keys == _BOTH_GEARS else {}
        )
        for name in names:
            # The key `internal` is a boolean, so its option is a flag.
            value_type = False if name == "internal" else number_or_text
            help_text = section.model_fields[name].description
            click_options.append(option(name, help_text, value_type, **click_arguments))
    return click_options


_BOTH_GEARS = ["gears.pinion", "gears.wheel"]
#: Configuration keys that have options: keys of the gear geometry, the mesh and a gear pair. Each
#: group is (section class, key names, paths of the sections in the configuration).
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
_CONFIGURATION_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
_MODEL_CHOICE = click.Choice(["teeth", "rectangle", "six_degrees", "train"])
_BEARING_HELP = "of each bearing of --model six_degrees, along and across the line of action"
_STATE_OPTION = {"type": float, "nargs": 2, "metavar": "X V"}
_DIRECTION_OPTION = {"type": click.Choice(["cold", "up", "down"])}
_REPEATABLE = {"multiple": True}
_QUANTITY_OPTION = _REPEATABLE | {"type": click.Choice(list(QUANTITIES)), "metavar": "NAME"}

#: "option", or "command option" for a single command -> help, default or type, click arguments.
_OPTION_TABLE = {
    "config": ("Configuration. Default: config.yaml of this folder.", _CONFIGURATION_FILE),
    "damping": ("Name of a damping in the configuration. Default: the first one.", str),
    "teeth": ("Number of teeth, z.", number_or_text, {"metavar": "TEETH | PINION WHEEL"}),
    "model": (
        "Model of the gears. Default: teeth if the geometry of the gears is given, else rectangle.",
        _MODEL_CHOICE,
    ),
    "profile": ("Profile of the mesh stiffness, e.g. '{kind: fourier, harmonics: 5}'.", mapping_of),
    "bearing_stiffness": (f"Stiffness {_BEARING_HELP}, N/m.", number_or_text),
    "bearing_damping": (f"Damping {_BEARING_HELP}, N s/m.", number_or_text),
    "tuning": ("Mesh frequency over mean eigenfrequency, nu; or give --speed.", float),
    "speed": ("Speed of the pinion, rpm.", number_or_text),
    "initial_state": (
        "Initial displacement, in static deflections, and dx/dtau. Default: static equilibrium for "
        "--model teeth, else 0 0.",
        *(None, _STATE_OPTION),
    ),
    "run-up initial_state": (
        "Initial displacement, in static deflections, and dx/dtau. Default: static equilibrium.",
        *(None, _STATE_OPTION),
    ),
    "guess": (
        "Displacement, in static deflections, and dx/dtau near the orbit.",
        None,
        _STATE_OPTION,
    ),
    "periods": ("Mesh periods of each run.", 200),
    "trust periods": (
        "Mesh periods in which the motion settles.",
        2000,
        {"type": click.IntRange(32)},
    ),
    "record_periods": ("Number of mesh periods recorded at the end.", 1),
    "sweep record_periods": ("Number of mesh periods evaluated at the end.", 10),
    "simulate samples": ("Samples per mesh period.", 256, {"type": click.IntRange(1)}),
    "max_seconds": ("Time limit, s; the results computed so far are kept.", float),
    "method": ("Integration method: one of gearlib.methods().", str),
    "until_settled": ("Continue until the motion repeats.", False),
    "start": (
        "First tuning, or speed such as 1500rpm. Default: 0.5, or 0.1 for sweeps up and down.",
        number_or_text,
    ),
    "stop": ("Last tuning, or speed such as 5000rpm. Default: 1.4.", number_or_text),
    "points": ("Number of tunings.", 901, {"type": click.IntRange(2, 10_000_000)}),
    "direction": (
        "Start each run from rest (cold) or from the end of the previous run (up, down). Default: "
        "up and down for --model teeth, else cold.",
        *(None, _DIRECTION_OPTION),
    ),
    "run-up start": ("First speed, rpm.", number_or_text),
    "run-up stop": ("Last speed, rpm.", number_or_text),
    "duration": ("Time from the first to the last speed, s.", number_in_unit("s", "2 s")),
    "acceleration": (
        "Acceleration, rpm/s; replaces --duration.",
        number_in_unit("rpm/s", "50 rpm/s"),
    ),
    "back": ("Return to the first speed.", False),
    "driver": ("Driving body of a train. Default: the body with the largest power.", str),
    "period": ("Mesh periods after which the orbit repeats.", 1),
    "phase": ("Mesh phase, rad.", 0.0, {"type": number_in_unit("rad", "90 deg")}),
    "count": ("Highest order.", 6),
    "campbell count": ("Highest order of a mesh.", 1),
    "tolerance": (
        "Tolerance, e.g. 'load std=5%'; may be repeated.",
        str,
        _REPEATABLE | {"flags": ["-t"]},
    ),
    "quantity": (
        f"Quantity: one of {', '.join(QUANTITIES)}; may be repeated.",
        None,
        _QUANTITY_OPTION,
    ),
    "free": (
        "Parameter to fit, NAME[=LOW,HIGH]; may be repeated. Default: those of DATA.",
        str,
        _REPEATABLE,
    ),
    "thickness_class": (
        "DIN 3967 class of the tooth thickness, e.g. 26cd, or '26cd 25cd' for both gears.",
        str,
    ),
    "distance_class": ("DIN 3964 class of the centre distance, e.g. js7.", str),
    "quality": (
        "ISO 1328-1 quality class within which the tooth profiles vary.",
        click.IntRange(1, 11),
    ),
    "samples": ("Number of designs.", 1024, {"type": click.IntRange(1)}),
    "scatter points": (
        "Number of tunings in the sweeps of each design, or 0 for no sweeps.",
        91,
        {"type": click.IntRange(0)},
    ),
    "seed": ("Seed of the Sobol' points.", 0),
    "format": ("Format of the table.", "text", {"type": click.Choice(["text", "json", "csv"])}),
    "save": ("Configuration file to write, .yaml.", FILE),
    "port": ("Port on this machine. Default: any free port.", click.IntRange(0, 65535)),
    "fmu output": (
        "FMU to write, .fmu. Default: FILE with the suffix .fmu.",
        FILE,
        {"flags": ["-o"]},
    ),
    "prescribed_speed": ("Make the speed an input of the FMU instead of a result.", False),
    "fmu speed": ("Speed of the reference pinion at the start, rpm.", number_or_text),
    "output": ("File to write: .nc (netCDF) or .csv (table).", FILE, {"flags": ["-o"]}),
    "plot": (f"Picture to draw: {', '.join(PICTURES)}.", FILE),
    "force": ("Replace existing files.", False),
}


def command_options(command_name, option_names):
    """Return the click options of a command from `_OPTION_TABLE`.

    `option_names` is a string of option names separated by spaces.
    """
    click_options = []
    for name in option_names.split():
        # An entry such as "trust periods" for one command takes precedence over "periods".
        command_entry = _OPTION_TABLE.get(f"{command_name} {name}")
        help_text, default_or_type, *click_arguments = command_entry or _OPTION_TABLE[name]
        # `click_arguments` is an empty list or holds one dict.
        click_options.append(option(name, help_text, default_or_type, **dict(*click_arguments)))
    return click_options


_GEAR_OPTIONS = command_options("", "config damping teeth") + config_key_options(GEOMETRY)
#: Options that describe two gears by their geometry, any gear pair, and any model.
STAGE_OPTIONS = _GEAR_OPTIONS + config_key_options(MESH)
PAIR_OPTIONS = _GEAR_OPTIONS + config_key_options(PAIR_KEYS)
MODEL_OPTIONS = PAIR_OPTIONS + command_options(
    "", "model profile bearing_stiffness bearing_damping"
)
