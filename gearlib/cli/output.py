"""Printing, writing and drawing of the results of commands."""

import csv
import io
import itertools
import json
import tempfile

import click

from gearlib.units import WRITTEN_UNITS

WIDTH = 80
#: Variables of datasets that are printed, in this order.
_SHOWN = (
    *("tuning", "speed", "revolution_speed", "revolution_time", "static_deflection", "period"),
    *("displacement_max", "displacement_min", "dynamic_force_max", "dynamic_force_min"),
    *("dynamic_factor", "peak_force_ratio", "mean_force"),
    *("load_sharing", "fraction_drive", "contact_loss_fraction", "bounces"),
    *("mesh_frequency_hertz", "resonance_speed"),
    *("mesh_force_max", "mesh_force_min", "error_peak_to_peak", "error_rms"),
    *("natural_frequency", "mode_kind", "mesh_force", "contact", "grazing", "state", "pattern"),
    *("multiplier_real", "multiplier_imaginary", "complete"),
)
#: Dimensions of variables that are printed as tables.
_TABLE_DIMENSIONS = ("mesh", "mode", "coordinate", "contact_phase", "multiplier")


def check(option, path, force, suffixes):
    """Raise an error if an output file cannot be written, or if it exists and `force` is false.

    `option` is the name of the option for the message. `path` is None if the option is not given;
    its suffix must be one of `suffixes`, such as ".png".
    """
    if path is None:
        return
    if path.suffix not in suffixes:
        raise click.UsageError(f"{option} {path}: it must end with one of {', '.join(suffixes)}")
    try:
        # Creating a temporary file shows whether the folder exists and can be written to.
        tempfile.TemporaryFile(dir=path.parent).close()
        exists = path.exists()
    except OSError as error:
        raise click.UsageError(f"{path} cannot be written: {error.strerror}") from None
    if exists and not force:
        raise click.UsageError(f"{path} exists: choose another name, or give --force")


def write(path, dataset, dimension):
    """Write a dataset to `path` as netCDF or, if its suffix is .csv, as a table.

    The table has one row per entry of the dimension named `dimension`.
    """
    from gearlib.data import storage

    if path.suffix == ".csv":
        storage.write_rows(dataset, dimension, path)
    else:
        storage.write(dataset, path)
    click.echo(f"written to {path}")


def write_text(path, text):
    """Write a text file and create its folder; report the path on standard error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    click.echo(f"written to {path}", err=True)


def save_picture(path, name, draw, model=None, dataset=None):
    """Draw a picture of a result and save it to `path`, with the name of the gears below it.

    `name` is the name of the gears, and `draw` a function that is called with the module
    `gearlib.plot` and returns axes. Results on meshes or modes of a gear train are drawn beside a
    picture of the train: `model` is the train and `dataset` the result, both None otherwise.
    """
    import matplotlib

    matplotlib.use("agg")
    from gearlib import plot
    from gearlib.figures import schematic, style

    # Only trains have names of meshes. Contacts are marked in the picture if they are known.
    axes = draw(plot)
    if model is not None and model.mesh_names and {"mesh", "mode"} & {*dataset.dims}:
        schematic.draw_beside(axes, model, dataset if "contact" in dataset else None)
    style.name_gears(axes.figure, name)
    style.save(axes.figure, path)
    click.echo(f"drawn in {path}")


def show(dataset):
    """Print the main variables of a dataset, or raise an error if its computation has failed.

    Scalars are printed one per line, and variables over the same dimension, such as "mesh", as
    columns of one table. A `status` other than 0 means that the computation has failed.
    """
    if "status" in dataset and dataset.status != 0:
        raise click.ClickException(dataset.status.attrs.get("message", "all runs have failed"))
    import pandas

    rows, tables = [], {}
    for name in _SHOWN:
        if name not in dataset:
            continue
        variable = dataset[name]
        unit = variable.attrs.get("units", "1")
        unit = WRITTEN_UNITS.get(unit, unit)
        if not variable.ndim:
            value = f"{variable.item():.10g} {unit}"
            rows.append((f"{name:21} {value:17}".rstrip(), variable.long_name))
        elif variable.dims[0] in _TABLE_DIMENSIONS:
            columns = tables.setdefault(variable.dims[0], {})
            columns[f"{name} {unit}".rstrip()] = variable.to_series()
    if rows:
        definitions(rows)
    for columns in tables.values():
        frame(pandas.DataFrame(columns))


def frame(table):
    """Print a pandas table; columns that do not fit on a line follow below the others."""
    table = table.rename_axis(index=None, columns=table.index.name)
    click.echo(table.to_string(line_width=WIDTH, float_format="{:.6g}".format))


def definitions(rows):
    """Print pairs of a term and its description in two columns.

    `rows` is a list of (term, description), both strings; long descriptions are wrapped.
    """
    formatter = click.HelpFormatter(width=WIDTH)
    formatter.write_dl(rows, col_max=60)
    click.echo(formatter.getvalue(), nl=False)


def gear_table(rows, file_format):
    """Print the table of gears given by geometry in the format "text", "json" or "csv".

    `rows` are `Quantity` tuples (name, unit, values, meaning) of `gearlib.studies.gear_table`.
    Their `values` are a dict by pinion and wheel, by mesh, or by stiffness method.
    """
    if file_format == "json":
        click.echo(json.dumps([row._asdict() for row in rows], indent=2))
    elif file_format == "csv":
        from gearlib.studies.gear_table import cells

        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(cells(rows))
        click.echo(text.getvalue(), nl=False)
    else:
        # Amplitudes of mesh orders are printed as a table of their own.
        amplitudes = [row for row in rows if row.name.startswith("mesh_order")]
        others = [row for row in rows if row not in amplitudes]
        # Successive rows with the same keys of `values` are a block with common column headings.
        for columns, block in itertools.groupby(others, lambda row: tuple(row.values)):
            click.echo(f"{'':25}{''.join(f'{column:13}' for column in columns)}")
            terms = []
            for row in block:
                values = "".join(f"{value:<13.6g}" for value in row.values.values())
                terms.append((f"{row.name:25}{values}{row.unit:6}", row.meaning))
            definitions(terms)
        if amplitudes:
            import pandas

            columns = {f"{row.name}, {row.unit}": row.values for row in amplitudes}
            frame(pandas.DataFrame(columns).rename_axis("peak amplitudes"))
