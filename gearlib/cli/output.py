"""What commands print, write and draw."""

import csv
import itertools
import json
import sys
import tempfile

import click

from gearlib.parameters import WRITTEN_UNITS

WIDTH = 80
#: Variables that are printed.
_SHOWN = (
    *("tuning", "speed", "revolution_speed", "revolution_time", "static_deflection", "period"),
    *("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_factor", "mean_force"),
    *("load_sharing", "fraction_normal", "bounces", "mesh_frequency_hertz", "resonance_speed"),
    *("mesh_force_max", "error_peak_to_peak", "error_rms", "lost_share"),
    *("natural_frequency", "mode_kind", "mesh_force", "contact", "grazing", "state", "pattern"),
    *("multiplier_real", "multiplier_imaginary"),
)
#: Dimensions of variables that are printed as tables.
_OVER = ("mesh", "mode", "coordinate", "contact_phase", "multiplier")


def check(option, path, force, endings):
    """Refuse a file that cannot be written or must not be replaced."""
    if path is None:
        return
    if path.suffix not in endings:
        raise click.UsageError(f"{option} {path}: it must end with one of {', '.join(endings)}")
    try:
        tempfile.TemporaryFile(dir=path.parent).close()
        exists = path.exists()
    except OSError as error:
        raise click.UsageError(f"{path} cannot be written: {error.strerror}") from None
    if exists and not force:
        raise click.UsageError(f"{path} exists: choose another name, or give --force")


def write(path, dataset, over):
    """Write a dataset, as netCDF or as a table over a dimension."""
    from gearlib.data import storage

    if path.suffix == ".csv":
        storage.write_rows(dataset, over, path)
    else:
        storage.write(dataset, path)
    click.echo(f"written to {path}")


def write_text(path, text):
    """Write a text, and say so on standard error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    click.echo(f"written to {path}", err=True)


def picture(path, name, draw, model=None, dataset=None):
    """Draw a picture, and beside it a train; `draw` takes `gearlib.plot` and returns axes."""
    import matplotlib

    matplotlib.use("agg")
    from gearlib import plot
    from gearlib.figures import schematic, style

    axes = draw(plot)
    if model is not None and model.mesh_names and {"mesh", "mode"} & {*dataset.dims}:
        schematic.beside(axes, model, dataset if "contact" in dataset else None)
    style.name_gears(axes.figure, name)
    style.save(axes.figure, path)
    click.echo(f"drawn in {path}")


def show(dataset):
    """Print what a dataset has of `_SHOWN`, scalars in lines, others as tables; refuse failures."""
    if "status" in dataset and dataset.status != 0:
        raise click.ClickException(dataset.status.attrs.get("message", "all runs have failed"))
    import pandas

    rows, tables = [], {}
    for name in filter(dataset.__contains__, _SHOWN):
        variable = dataset[name]
        unit = variable.attrs.get("units", "1")
        unit = WRITTEN_UNITS.get(unit, unit)
        if not variable.ndim:
            value = f"{variable.item():.10g} {unit}"
            rows.append((f"{name:21} {value:17}".rstrip(), variable.long_name))
        elif variable.dims[0] in _OVER:
            columns = tables.setdefault(variable.dims[0], {})
            columns[f"{name} {unit}".rstrip()] = variable.to_series()
    if rows:
        definitions(rows)
    for columns in tables.values():
        frame(pandas.DataFrame(columns))


def frame(table):
    """Print a table of pandas; columns that do not fit a terminal follow below."""
    table = table.rename_axis(index=None, columns=table.index.name)
    click.echo(table.to_string(line_width=WIDTH, float_format="{:.6g}".format))


def definitions(rows):
    """Print pairs of a term and its description, which is wrapped beside it."""
    formatter = click.HelpFormatter(width=WIDTH)
    formatter.write_dl(rows, col_max=60)
    click.echo(formatter.getvalue(), nl=False)


def gear_table(rows, form):
    """Print the table of drawn gears as text, JSON or CSV."""
    if form == "json":
        click.echo(json.dumps([row._asdict() for row in rows], indent=2))
    elif form == "csv":
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(["name", "of", "value", "unit", "meaning"])
        for row in rows:
            for of, value in row.values.items():
                writer.writerow([row.name, of, repr(value), row.unit, row.meaning])
    else:
        for heads, block in itertools.groupby(rows, lambda row: tuple(row.values)):
            click.echo(f"{'':25}{''.join(f'{head:13}' for head in heads)}")
            texts = ((x, "".join(f"{value:<13.6g}" for value in x.values.values())) for x in block)
            definitions([(f"{x.name:25}{text}{x.unit:6}", x.meaning) for x, text in texts])
