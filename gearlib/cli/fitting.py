"""`gearlib fit`: a measured set, which says of the rig what no option does."""

import functools
import json
from pathlib import Path

import click

from gearlib.cli import model_options, output, progress, refusals
from gearlib.config import measured_description
from gearlib.models.pair_parameters import PairParameters
from gearlib.parameters import declared

_FREE = "NAME[=LOW,HIGH]"


def _options(command):
    """Give a command a measured set and the options of its gears.

    It is called with the dataset as `data`, the `model` and the ranges `free`. Of the gears an
    option comes first, then what the file knows of the rig, then the configuration; a free
    parameter of which nothing is said begins in the middle of its range.
    """
    with_model = model_options.options(command)

    @click.argument("path", metavar="DATA", type=output.FILE)
    @click.option(
        "--free",
        "asked",
        metavar=_FREE,
        multiple=True,
        help="Parameter to look for, between two values, which may have units; several times, or "
        "else those of the file. Without values the range is that of the file.",
    )
    @functools.wraps(with_model)
    def wrapped(path, asked, model, **others):
        from gearlib import read_measured

        data = read_measured(path)
        said = measured_description.read(path).fit or measured_description.FitSection()
        free = _ranges(path, asked, said.free)
        known = {name: sum(ends) / 2.0 for name, ends in free.items()} if _alone(others) else {}
        known |= json.loads(data.attrs["known"])
        for name in declared(PairParameters):
            if others[name] is None and type(known.get(name)) in (int, float):
                others[name] = str(known[name])
        if said.model and _is_default("model"):
            model = said.model
        return with_model(data=data, free=free, model=model, **others)

    return wrapped


@click.command(cls=refusals.Command)
@_options
@output.options("parameter")
def fit(model, data, free, save):
    """Fit parameters of the gears to the measured set that the YAML file DATA describes."""
    import gearlib

    output.words(f"{data.title}{', synthetic' * data.synthetic}: {data.source}")
    if data.attrs["repairs"]:
        output.words(f"repairs: {data.attrs['repairs']}")
    with progress.clock("fitting"):
        found = gearlib.fit(model, data, free)
    click.echo(str(found))
    save(found.dataset(), lambda plot: plot.fit(found))


def _ranges(path, asked, said):
    found = {}
    for text in asked:
        name, equals, ends = text.partition("=")
        if name in found:
            raise click.UsageError(f"--free {name} is there twice: it must be given once")
        if not equals and name not in said:
            raise click.UsageError(
                f"--free {text} is not allowed: it must be {_FREE}, for {path} has no range of it"
            )
        found[name] = measured_description.range_of(name, ends.split(",") if equals else said[name])
    if not found:
        found = {name: measured_description.range_of(name, ends) for name, ends in said.items()}
    if not found:
        raise click.UsageError(f"--free is missing: give {_FREE}, or fit.free in {path}")
    return found


def _alone(given):
    """Return whether there is no configuration that may say what the gears are."""
    return given["config_path"] is None and not Path(model_options.DEFAULT_CONFIG).exists()


def _is_default(name):
    source = click.get_current_context().get_parameter_source(name)
    return source == click.core.ParameterSource.DEFAULT
