"""Options of the commands: of the fields of the configuration, and of a table."""

import math
import warnings
from pathlib import Path

import click

from gearlib.config.gear_pair_section import DAMPINGS, Damping, GearPairSection
from gearlib.config.gears_section import Gears, WheelSection
from gearlib.config.validation import with_original_values
from gearlib.data.variables import QUANTITIES
from gearlib.removed import REMOVED, removal_message

FILE = click.Path(dir_okay=False, path_type=Path)
#: Endings of files of data, configurations and pictures.
DATA, YAML, PICTURES = (".nc", ".csv"), (".yaml", ".yml"), (".png", ".svg", ".pdf")


def value(text):
    """Return a number, or a text that may have a unit, which the configuration or library reads."""
    for kind in (int, float):
        try:
            return text if math.isnan(kind(text)) else kind(text)
        except ValueError:
            continue
    if text.startswith("--"):
        raise click.UsageError(f"{text} is not allowed as a value: some options take two values")
    return text


class Command(click.Command):
    """A command that takes the teeth of one or two gears, and answers removed options."""

    def parse_args(self, ctx, args):
        for option in (word.partition("=")[0] for word in args):
            if (name := f"{ctx.info_name} {option}") in REMOVED:
                raise click.UsageError(removal_message(name), ctx)
        for at in [i + 1 for i, word in enumerate(args) if word == "--teeth"][::-1]:
            if "".join(args[at + 1 : at + 2]).isdigit() and not args[at].startswith("-"):
                args = [*args[:at], f"{args[at]} {args[at + 1]}", *args[at + 2 :]]
        return super().parse_args(ctx, args)


class Group(click.Group):
    """Commands that print the library's warnings and refuse what raises a ValueError."""

    command_class = Command

    def invoke(self, ctx):
        try:
            with warnings.catch_warnings():
                warnings.showwarning = lambda text, *_: click.echo(f"Warning: {text}", err=True)
                return super().invoke(ctx)
        except ValueError as error:
            text = str(error).replace("dampings.options.", "")
            raise click.UsageError(with_original_values(text, {})) from None
        except (ModuleNotFoundError, OSError) as error:
            raise click.ClickException(str(error)) from None


def option(name, text, default=None, short=(), **settings):
    """Return an option by its help, and its default value or its type."""
    if default is False:
        settings["is_flag"] = True
    elif callable(default):
        settings["type"] = default
    elif default is not None:
        settings |= {"default": default, "show_default": True}
    flag = "--state" if name == "initial_state" else f"--{name.replace('_', '-')}"
    return click.Option([*short, flag, name], help=text, **settings)


def of_fields(fields):
    """Return options of fields of the configuration; a field of both gears takes two values."""
    found = []
    for section, names, places in fields:
        both = {"nargs": 2, "metavar": "PINION WHEEL"} if places == _BOTH else {}
        for name in names:
            kind = False if name == "internal" else value
            found.append(option(name, section.model_fields[name].description, kind, **both))
    return found


_BOTH = ["gears.pinion", "gears.wheel"]
#: Fields that are options: of a drawing, of its mesh, of a gear pair by its numbers. Each row has a
#: section, names of fields, and the places of these sections in the configuration.
DRAWING = [
    (WheelSection, ["shift", "tip_diameter", "bore", "thickness_allowance"], _BOTH),
    (WheelSection, ["module", "width", "pressure_angle", "helix_angle", "rack"], _BOTH[:1]),
    (WheelSection, ["internal", "outer_diameter"], _BOTH[1:]),
    (Gears, ["centre_distance", "torque", "stiffness"], ["gears"]),
    (Damping, ["damping_ratio"], ["dampings"]),
]
MESH = [(Gears, ["backlash", "power", "speed"], ["gears"])]
_NAMES = [name for name in GearPairSection.model_fields if name != "teeth"]
NUMBERS = [(GearPairSection, _NAMES, ["gear_pair"]), (Damping, DAMPINGS, ["dampings"])]
_CONFIGURATION = click.Path(exists=True, dir_okay=False, path_type=Path)
_MODELS = click.Choice(["one_degree", "six_degrees", "train"])
_BEARING = "of each bearing of --model six_degrees, along and across the line of action"
_STATE = {"type": float, "nargs": 2, "metavar": "X V"}
_DIRECTIONS = {"type": click.Choice(["cold", "up", "down"])}
_MANY = {"multiple": True}
_QUANTITY = _MANY | {"type": click.Choice(list(QUANTITIES)), "metavar": "NAME"}

#: Name of an option, or of a command and its option -> help, default value or type, settings.
_TABLE = {
    "config": ("Configuration. Default: config.yaml of this folder.", _CONFIGURATION),
    "case": ("Case of the configuration, by name.", str),
    "damping": ("Damping of the configuration, by name. Default: the first.", str),
    "teeth": ("Number of teeth, z.", value, {"metavar": "TEETH | PINION WHEEL"}),
    "model": ("Model of the gears. Default: one_degree.", _MODELS),
    "bearing_stiffness": (f"Stiffness {_BEARING}, N/m.", value),
    "bearing_damping": (f"Damping {_BEARING}, N s/m.", value),
    "tuning": ("Mesh frequency over mean eigenfrequency, nu; or give --speed.", float),
    "speed": ("Speed of the pinion, rpm.", value),
    "initial_state": ("Initial displacement, static deflections, and dx/dtau.", (0.0, 0.0), _STATE),
    "guess": ("Displacement, static deflections, and dx/dtau near the orbit.", None, _STATE),
    "periods": ("Mesh periods of each run.", 200),
    "trust periods": ("Mesh periods in which the motion settles, at least 32.", 2000),
    "record_periods": ("Last mesh periods, which are recorded.", 1),
    "sweep record_periods": ("Last mesh periods, which are evaluated.", 10),
    "simulate samples": ("Samples per mesh period.", 256),
    "method": ("Method, a name of gearlib.methods().", str),
    "until_settled": ("Continue until the motion repeats.", False),
    "start": ("First tuning, or speed such as 1500rpm. Default: 0.5.", value),
    "stop": ("Last tuning, or speed such as 5000rpm. Default: 1.4.", value),
    "points": ("Number of tunings.", 901, {"type": click.IntRange(2, 10_000_000)}),
    "direction": ("Start from rest, or from the run before, up or down.", "cold", _DIRECTIONS),
    "run-up start": ("First speed, rpm.", value),
    "run-up stop": ("Last speed, rpm.", value),
    "duration": ("Time from the first to the last speed, s.", float),
    "acceleration": ("Rate of the speed, rpm/s; replaces --duration.", float),
    "back": ("Return to the first speed.", False),
    "driver": ("Driving body of a train. Default: that with the largest power.", str),
    "period": ("Mesh periods after which the orbit repeats.", 1),
    "phase": ("Mesh phase, rad.", 0.0),
    "count": ("Highest order.", 6),
    "campbell count": ("Highest order of a mesh.", 1),
    "tolerance": ("Tolerance, 'load std=5%'; may be repeated.", str, _MANY | {"short": ["-t"]}),
    "quantity": (f"Quantity, of {', '.join(QUANTITIES)}; may be repeated.", None, _QUANTITY),
    "free": ("Parameter to fit, NAME[=LOW,HIGH]; may be repeated. Default: of DATA.", str, _MANY),
    "thickness_class": ("Tooth thickness of drawn gears by DIN 3967: 26cd, or '26cd 25cd'.", str),
    "distance_class": ("Centre distance of drawn gears by DIN 3964: js7.", str),
    "quality": ("Quality by ISO 1328-1, within which profiles scatter.", click.IntRange(1, 11)),
    "samples": ("Number of designs.", 1024),
    "scatter points": ("Number of tunings at which each design is run; 0 for none.", 91),
    "seed": ("Seed of the Sobol' points.", 0),
    "format": ("Format of the table.", "text", {"type": click.Choice(["text", "json", "csv"])}),
    "save": ("Configuration to write, .yaml.", FILE),
    "port": ("Port on this machine. Default: any free one.", click.IntRange(0, 65535)),
    "output": ("File to write: .nc (netCDF) or .csv (table).", FILE, {"short": ["-o"]}),
    "plot": (f"Picture to draw: {', '.join(PICTURES)}.", FILE),
    "force": ("Replace existing files.", False),
}


def named(command, names):
    """Return the options of a command by their names in the table."""
    entries = {name: _TABLE.get(f"{command} {name}") or _TABLE[name] for name in names.split()}
    return [option(name, *entry[:2], **dict(*entry[2:])) for name, entry in entries.items()]


_GEARS = named("", "config case damping teeth") + of_fields(DRAWING)
#: Options of two drawn gears, of a gear pair by its numbers or drawing, of a model that moves.
DRAWN_GEARS, PAIR = _GEARS + of_fields(MESH), _GEARS + of_fields(NUMBERS)
MODEL = PAIR + named("", "model bearing_stiffness bearing_damping")
