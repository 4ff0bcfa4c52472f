"""What a command prints and writes, and how it ends."""

import functools
import tempfile
from pathlib import Path

import click


def options(command):
    """Give a command the options of its output; it is called with `save`, which takes a dataset."""

    @click.option(
        "-o",
        "--output",
        type=click.Path(dir_okay=False, path_type=Path),
        help="netCDF file to write; without it, only the summary is printed.",
    )
    @click.option("--force", is_flag=True, help="Replace the file if there is one.")
    @functools.wraps(command)
    def wrapped(output, force, **given):
        if output is not None:
            _check(output, force)
        return command(save=functools.partial(_save, output), **given)

    return wrapped


def _check(output, force):
    """Refuse, before anything is computed, to replace a file unasked or to write where none can."""
    try:
        there = output.exists()
        if output.parent.is_dir():
            tempfile.TemporaryFile(dir=output.parent, prefix=output.name).close()
    except OSError as error:
        raise click.UsageError(f"{output} cannot be written: {error.strerror}") from None
    if there and not force:
        raise click.UsageError(f"{output} is there already: choose another name, or give --force")
    if not output.parent.is_dir():
        raise click.UsageError(f"{output} cannot be written: there is no folder {output.parent}")


def _save(output, dataset):
    """Write a dataset where asked; among temporary files if it cannot be written there any more."""
    from gearlib.data import storage

    if output is not None:
        try:
            storage.write(dataset, output)
        except OSError as error:
            kept = Path(tempfile.mkdtemp(prefix="gearlib-"), output.name)
            try:
                storage.write(dataset, kept)
            except OSError:
                fail(str(error))
            fail(f"{error}; the result is kept as {kept}")
        click.echo(f"written to {output}")


def table(dataset, names):
    """Print variables with their values, units and long names."""
    for name in names:
        variable = dataset[name]
        unit = variable.attrs.get("units", "1")
        value = f"{variable.item():.10g}" + ("" if unit == "1" else f" {unit}")
        click.echo(f"{name:20} {value:24} {variable.attrs.get('long_name', '')}")


def machine(run, model):
    """Print what a run is in units of machines, of its recorded periods."""
    from gearlib.analysis.duty_point import in_units
    from gearlib.data.result import result

    found = result("Duty point of a gear mesh", model, in_units(run, model), method="run")
    for name in ("error_peak_to_peak", "error_rms"):
        found[name] = (1e6 * found[name]).assign_attrs(found[name].attrs | {"units": "um"})
    told = ["mesh_frequency_hertz", "resonance_speed", "dynamic_factor", "mesh_force_max"]
    table(found, [*told, "error_peak_to_peak", "error_rms", "lost_share"])


def columns(dataset, dim, names):
    """Print variables over one dimension side by side, a row for each of its entries."""
    heads = []
    for name in names:
        unit = dataset[name].attrs.get("units", "1")
        heads.append(name if unit == "1" else f"{name} {unit}")
    rows(
        [dim, *heads],
        [
            [str(entry), *(_cell(dataset[name].values[i]) for name in names)]
            for i, entry in enumerate(dataset[dim].values)
        ],
    )


def rows(heads, cells):
    """Print a table of texts, each column as wide as it needs."""
    widths = [max(map(len, column)) for column in zip(heads, *cells, strict=True)]
    for line in (heads, *cells):
        texts = (text.ljust(width) for text, width in zip(line, widths, strict=True))
        click.echo("  ".join(texts).rstrip())


def _cell(value):
    return value if isinstance(value, str) else f"{value:.6g}"


def fail(message):
    """End with exit code 1."""
    raise click.ClickException(message)
