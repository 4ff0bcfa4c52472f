"""Print, write and plot the results of commands."""

import csv
import io
import itertools
import json
import tempfile

import click

from gearlib.units import WRITTEN_UNITS

WIDTH = 80
#: Variables of datasets to print, in this order.
_PRINTED_VARIABLES = (
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


def check_path(option, path, force, suffixes):
    """Raise `click.UsageError` if the output file `path` must not or cannot be written.

    Existing files are replaced only if `force` is true. `option` is the name of the option, used in
    messages. `path` is None if the option is not given. `suffixes` are the allowed suffixes.
    """
    if path is None:
        return
    if path.suffix not in suffixes:
        raise click.UsageError(f"{option} {path} must end with one of {', '.join(suffixes)}")
    try:
        # A temporary file tests whether the folder exists and is writable.
        tempfile.TemporaryFile(dir=path.parent).close()
        exists = path.exists()
    except OSError as error:
        raise click.UsageError(f"{path} cannot be written: {error.strerror}") from None
    if exists and not force:
        raise click.UsageError(f"{path} exists: choose another name or use --force")


def write_dataset(path, dataset, dimension):
    """Write a dataset as netCDF or, if the suffix of `path` is .csv, as a table.

    The table has one row per entry along `dimension`.
    """
    from gearlib.data import storage

    if path.suffix == ".csv":
        storage.write_rows(dataset, dimension, path)
    else:
        storage.write(dataset, path)
    click.echo(f"written to {path}")


def write_text(path, text):
    """Write a text file, creating its folder, and report its path on standard error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    click.echo(f"written to {path}", err=True)


def save_picture(path, name, draw, model=None, dataset=None):
    """Draw a figure of a result, label it with the name of the gears, and save it to `path`.

    `draw` is called with the module `gearlib.plot` and returns axes. If `model` is a gear train and
    `dataset` has a dimension "mesh" or "mode", the figure also shows the layout of the train.
    """
    import matplotlib

    matplotlib.use("agg")
    from gearlib import plot
    from gearlib.figures import schematic, style

    axes = draw(plot)
    # Only trains have mesh names.
    if model is not None and model.mesh_names and {"mesh", "mode"} & {*dataset.dims}:
        schematic.draw_beside(axes, model, dataset if "contact" in dataset else None)
    style.add_gear_caption(axes.figure, name)
    style.save(axes.figure, path)
    click.echo(f"plotted to {path}")


def print_dataset(dataset):
    """Print the main variables of a dataset; raise an error if its status is not 0 (failed).

    Scalars are printed one per line. Variables with the same dimension, such as "mesh", are the
    columns of one table.
    """
    if "status" in dataset and dataset.status != 0:
        raise click.ClickException(dataset.status.attrs.get("message", "all runs have failed"))
    import pandas

    rows, tables = [], {}
    for name in _PRINTED_VARIABLES:
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
        print_definitions(rows)
    for columns in tables.values():
        print_table(pandas.DataFrame(columns))


def print_table(table):
    """Print a pandas DataFrame; if it is too wide, print its columns in several blocks."""
    table = table.rename_axis(index=None, columns=table.index.name)
    click.echo(table.to_string(line_width=WIDTH, float_format="{:.6g}".format))


def print_definitions(rows):
    """Print a list of (term, description) in two columns; long descriptions are wrapped."""
    formatter = click.HelpFormatter(width=WIDTH)
    formatter.write_dl(rows, col_max=60)
    click.echo(formatter.getvalue(), nl=False)


def print_gear_table(rows, file_format):
    """Print a table of gear quantities in the format "text", "json" or "csv".

    `rows` is a list of `gearlib.studies.gear_table.Quantity`, whose `values` map column names, e.g.
    "pinion" and "wheel", to numbers.
    """
    if file_format == "json":
        click.echo(json.dumps([row._asdict() for row in rows], indent=2))
    elif file_format == "csv":
        from gearlib.studies.gear_table import quantity_rows

        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(quantity_rows(rows))
        click.echo(text.getvalue(), nl=False)
    else:
        # The amplitudes of the mesh orders are printed in a separate table.
        amplitudes = [row for row in rows if row.name.startswith("mesh_order")]
        others = [row for row in rows if row not in amplitudes]
        # Consecutive rows with the same columns form a block with one line of headings.
        for column_names, block in itertools.groupby(others, lambda row: tuple(row.values)):
            click.echo(f"{'':25}{''.join(f'{column:13}' for column in column_names)}")
            terms = []
            for row in block:
                values = "".join(f"{value:<13.6g}" for value in row.values.values())
                terms.append((f"{row.name:25}{values}{row.unit:6}", row.meaning))
            print_definitions(terms)
        if amplitudes:
            import pandas

            columns = {f"{row.name}, {row.unit}": row.values for row in amplitudes}
            print_table(pandas.DataFrame(columns).rename_axis("peak amplitudes"))
