"""Two gears by their drawing: options, and the table of what they come to."""

import csv
import functools
import io
import json
from itertools import groupby

import click

from gearlib.cli import drawing_options, model_options, output


def options(command):
    """Give a command options that draw gears; it is called with `drawing`, `damping`, `mapping`.

    `drawing` is the section `gears` of a configuration, `damping` the coefficients, N s/m,
    `mapping` the configuration.
    """

    @functools.wraps(command)
    def wrapped(config_path, case, damping, damping_ratio, **others):
        section = drawing_options.section(others)
        mapping, path = model_options.read(config_path, case, damping)
        name = f"What the options make of {path}" if path else "What the options say"
        if path and "gears" not in mapping and not section["pinion"]:
            raise click.UsageError(f"{path} has no gears by their drawing: it must have `gears`")
        whole = drawing_options.laid(mapping, section, damping, damping_ratio)
        settings = model_options.load(whole, name)
        damping = model_options.choose_damping(settings, damping)
        pair = settings.pair_parameters(damping)
        coefficients = {key: pair[key] for key in ("material_damping", "backlash_damping")}
        return command(drawing=settings.gears, damping=coefficients, mapping=whole, **others)

    decorators = [*model_options.config_options(), *drawing_options.decorators()]
    for decorate in reversed(decorators):
        wrapped = decorate(wrapped)
    return wrapped


def stiffness_figure(drawing):
    """Return what draws the mesh stiffness of these gears by every method, for `output.picture`."""

    def draw(plot):
        from gearlib.figures import mesh_stiffness_figure
        from gearlib.studies.drawn_gears import mesh_stiffness

        pair = drawing.model_dump() | {"torque": drawing.driving_torque(), "published": {}}
        found = mesh_stiffness({"mesh stiffness": pair}, samples=257)
        return mesh_stiffness_figure.draw(found)

    return draw


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
                    "" if row.unit == "1" else row.unit,
                    row.meaning,
                ]
                for row in block
            ]
            if i:
                click.echo()
            output.rows(["", *heads, "unit", ""], cells)
