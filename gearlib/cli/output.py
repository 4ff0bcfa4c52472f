"""What a command prints and writes, and how it ends."""

import functools
import tempfile
from pathlib import Path

import click

FILE = click.Path(dir_okay=False, path_type=Path)

#: Where a command keeps the name of its gears.
GEARS = "gearlib.gears"
#: Ending of a file -> what is written there.
DATA = {".nc": "netCDF", ".csv": "a table over {over}"}
PICTURES = (".png", ".svg", ".pdf")
ENDINGS = ", ".join(PICTURES)


def options(over):
    """Return a decorator that gives a command the options of its output.

    The command is called with `save`, which takes a dataset and how `gearlib.plot` draws it; `over`
    is the dimension whose entries are the rows of tables.
    """
    kinds = ", ".join(f"{end} ({words.format(over=over)})" for end, words in DATA.items())

    def decorate(command):
        @click.option("-o", "--output", type=FILE, help=f"File to write: {kinds}.")
        @click.option("--plot", type=FILE, help=f"Picture to draw: {ENDINGS}.")
        @click.option("--force", is_flag=True, help="Replace files that are there.")
        @functools.wraps(command)
        def wrapped(output, plot, force, **given):
            check("--output", output, force, tuple(DATA))
            check("--plot", plot, force, PICTURES)
            return command(save=functools.partial(_save, over, output, plot), **given)

        return wrapped

    return decorate


def check(option, path, force, endings):
    """Refuse, before anything is computed, a file that cannot be written or must not be replaced.

    Its ending decides what is written.
    """
    if path is None:
        return
    if path.suffix not in endings:
        raise click.UsageError(
            f"{option} {path} is not allowed: it must end with one of {', '.join(endings)}"
        )
    try:
        there = path.exists()
        if path.parent.is_dir():
            tempfile.TemporaryFile(dir=path.parent, prefix=path.name).close()
    except OSError as error:
        raise click.UsageError(f"{path} cannot be written: {error.strerror}") from None
    if there and not force:
        raise click.UsageError(f"{path} is there already: choose another name, or give --force")
    if not path.parent.is_dir():
        raise click.UsageError(f"{path} cannot be written: there is no folder {path.parent}")


def _save(over, output, plot, dataset, draw):
    """Write and draw what was asked; among temporary files if it cannot be written any more."""
    from gearlib.data import storage

    if output is not None:
        if output.suffix == ".csv":
            write = functools.partial(storage.write_rows, dataset, over)
        else:
            write = functools.partial(storage.write, dataset)
        try:
            write(output)
        except OSError as error:
            kept = Path(tempfile.mkdtemp(prefix="gearlib-"), output.name)
            try:
                write(kept)
            except OSError:
                fail(str(error))
            fail(f"{error}; the result is kept as {kept}")
        click.echo(f"written to {output}")
    if plot is not None:
        picture(plot, draw)


def write(path, text):
    """Write a text, and say so where it is not taken for the result."""
    from gearlib.data.files import replacing

    try:
        with replacing(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        fail(f"{path} cannot be written: {error.strerror}")
    click.echo(f"written to {path}", err=True)


def picture(path, draw):
    """Draw a picture; `draw` takes `gearlib.plot` and returns axes."""
    import matplotlib

    matplotlib.use("agg")
    from gearlib import plot
    from gearlib.figures import style

    try:
        figure = draw(plot).figure
        style.name_gears(figure, click.get_current_context().meta.get(GEARS))
        style.save(figure, path)
    except OSError as error:
        fail(f"{path} cannot be written: {error.strerror}")
    click.echo(f"drawn in {path}")


def name_gears(name, shown=True):
    """Print whose gears these are; a picture of them says it as well."""
    if shown:
        click.echo(name)
    click.get_current_context().meta[GEARS] = name


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
