"""Output of the commands: tables, files, exit codes."""

import functools
import tempfile
import textwrap
from itertools import zip_longest
from pathlib import Path

import click

#: Columns of a terminal, and the least of them for a column of words at the end of a table.
WIDTH, _LEAST = 80, 20

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


def beside(axes, train, run=None, curves=False):
    """Return axes, a train drawn beside, if it is one; `curves`: in the colours of its meshes."""
    from gearlib.figures import schematic

    if not train.mesh_names:
        return axes
    return schematic.beside(axes, train, run, None if curves else {})


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


def printed_unit(variable):
    """Return the unit of a variable as people write it: rpm, and nothing for "1"."""
    unit = variable.attrs.get("units", "1")
    return {"1": "", "min-1": "rpm"}.get(unit, unit)


def table(dataset, names):
    """Print variables with their values, units and long names."""
    cells = []
    for name in names:
        variable = dataset[name]
        value = f"{variable.item():.10g} {printed_unit(variable)}".rstrip()
        cells.append([f"{name:20}", f"{value:17}", variable.attrs.get("long_name", "")])
    rows([""] * 3, cells)


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
    heads = [f"{name} {printed_unit(dataset[name])}".rstrip() for name in names]
    rows(
        [dim, *heads],
        [
            [str(entry), *(_cell(dataset[name].values[i]) for name in names)]
            for i, entry in enumerate(dataset[dim].values)
        ],
    )


def rows(heads, cells):
    """Print a table of texts, each column as wide as it needs.

    What does not fit beside the first column goes below it, in a table of its own; words of the
    last one are wrapped.
    """
    table = [heads, *cells] if any(heads) else cells
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    left = WIDTH - sum(width + 2 for width in widths[:-1])
    widths[-1] = min(widths[-1], max(left, _LEAST))
    blocks: list[list[int]] = [[]]
    for i, width in enumerate(widths[1:], 1):
        if blocks[-1] and width + sum(widths[k] + 2 for k in [0, *blocks[-1]]) > WIDTH:
            blocks.append([])
        blocks[-1].append(i)
    for number, block in enumerate(blocks):
        if number:
            click.echo()
        shown = [0, *block]
        for row in table:
            parts = [textwrap.wrap(row[i], widths[i]) for i in shown]
            for line in zip_longest(*parts, fillvalue=""):
                texts = (text.ljust(widths[i]) for text, i in zip(line, shown, strict=True))
                click.echo("  ".join(texts).rstrip())


def words(text):
    """Print a sentence, or a name and what follows it, in lines that fit a terminal."""
    # What stands in a second column stays in it.
    head, gap, _ = text.partition("  ")
    indent = " " * (len(text) - len(text[len(head) :].lstrip())) if gap else ""
    click.echo(textwrap.fill(text, WIDTH, subsequent_indent=indent, break_long_words=False))


def _cell(value):
    return value if isinstance(value, str) else f"{value:.6g}"


def fail(message):
    """End with exit code 1."""
    raise click.ClickException(message)
