"""Two gears by their drawing: options, and the table of what they come to."""

import csv
import functools
import io
import json
from itertools import groupby

import click

from gearlib.cli import model_options, output
from gearlib.config.gears_section import Gears, WheelSection
from gearlib.config.laying import laid_over

#: What both gears have in common, and what each has of its own; the options of these take two.
_COMMON = ("module", "width", "pressure_angle", "helix_angle", "rack")
_EACH = ("teeth", "shift", "tip_diameter", "bore", "thickness_allowance")
_OF_MESH = ("centre_distance", "backlash", "torque", "power", "speed", "stiffness")
#: Stands for the damping that nothing says.
_NONE = {"none": {"material_damping": 0.0, "backlash_damping": 0.0}}


def options(command):
    """Give a command options that draw gears; it is called with `drawing` and `damping`.

    `drawing` is the section `gears` of a configuration, `damping` the coefficients, N s/m.
    """

    @functools.wraps(command)
    def wrapped(config_path, case, damping, damping_ratio, internal, outer_diameter, **others):
        wheel = {"internal": internal or None, "outer_diameter": outer_diameter}
        section = {"pinion": {}, "wheel": {k: v for k, v in wheel.items() if v is not None}}
        for key in _COMMON:
            _put(section, ("pinion",), key, others.pop(key))
        for key in _EACH:
            for gear, value in zip(
                ("pinion", "wheel"), others.pop(key) or (None, None), strict=True
            ):
                _put(section, (gear,), key, value)
        for key in _OF_MESH:
            _put(section, (), key, others.pop(key))
        mapping, path = model_options.read(config_path, case, damping)
        name = f"What the options make of {path}" if path else "What the options say"
        # Coefficients suit the pair for which they were made.
        own = ("gears", "dampings") if "gears" in mapping or damping is not None else ()
        mapping = {key: mapping[key] for key in own if key in mapping}
        if path and "gears" not in mapping and not section["pinion"]:
            raise click.UsageError(f"{path} has no gears by their drawing: it must have `gears`")
        whole = laid_over({"dampings": _NONE} | mapping, {"gears": section})
        if damping_ratio is not None:
            ratios = {"damping_ratio": damping_ratio, "backlash_damping_ratio": 0.0}
            whole["dampings"] = {"ratio": ratios}
        settings = model_options.load(whole, name)
        damping = model_options.choose_damping(settings, damping)
        pair = settings.pair_parameters(damping)
        coefficients = {key: pair[key] for key in ("material_damping", "backlash_damping")}
        return command(drawing=settings.gears, damping=coefficients, **others)

    for decorate in reversed(list(_decorators())):
        wrapped = decorate(wrapped)
    return wrapped


def _put(section, path, key, value):
    for name in path:
        section = section[name]
    if value is not None:
        section[key] = value


def _decorators():
    yield from model_options.config_options()
    for key in _EACH:
        words = WheelSection.model_fields[key].description
        names = {"nargs": 2, "metavar": "PINION WHEEL"}
        yield click.option(_name(key), key, help=words, **names)
    for key in _COMMON:
        yield click.option(_name(key), key, help=WheelSection.model_fields[key].description)
    yield click.option("--internal", is_flag=True, help="The wheel is a ring gear.")
    yield click.option(
        "--outer-diameter", help=WheelSection.model_fields["outer_diameter"].description
    )
    for key in _OF_MESH:
        yield click.option(_name(key), key, help=Gears.model_fields[key].description)
    yield click.option("--damping-ratio", help="beta in contact, in place of the dampings.")


def _name(key):
    return f"--{key.replace('_', '-')}"


def show(rows, form):
    """Print the table: as text, or as JSON or CSV for other programs."""
    if form == "json":
        records = [row._asdict() for row in rows]
        click.echo(json.dumps(records, indent=2))
    elif form == "csv":
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["name", "of", "value", "unit", "meaning"])
        for row in rows:
            for of, value in row.values.items():
                writer.writerow([row.name, of, repr(value), row.unit, row.meaning])
        click.echo(file.getvalue(), nl=False)
    else:
        for i, (heads, block) in enumerate(groupby(rows, lambda row: tuple(row.values))):
            cells = [
                [
                    row.name,
                    *(f"{value:.6g}" for value in row.values.values()),
                    row.unit,
                    row.meaning,
                ]
                for row in block
            ]
            if i:
                click.echo()
            output.rows(["", *heads, "unit", ""], cells)
