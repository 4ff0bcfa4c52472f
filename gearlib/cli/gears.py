"""From options and a configuration to a model of the gears."""

import functools
from pathlib import Path

import click
import yaml
from pydantic import Field, ValidationError

from gearlib import config
from gearlib.config.mesh import GearPairSection
from gearlib.config.types import DampingCoefficient
from gearlib.validation import sentences

MODELS = ("one_degree", "six_degrees")
_DEFAULT_CONFIG = "config.yaml"


class _Gears(GearPairSection):
    """A gear pair with its damping, SI."""

    material_damping: DampingCoefficient = Field(description="k_1 while the flanks touch, N s/m.")
    backlash_damping: DampingCoefficient = Field(description="k_1m in the backlash, N s/m.")


def options(command):
    """Give a command the options that describe the gears; it is called with the model as `pair`."""

    @functools.wraps(command)
    def wrapped(config_path, damping, model, **rest):
        given = {name: rest.pop(name) for name in _Gears.model_fields}
        changes = {name: _number(text) for name, text in given.items() if text is not None}
        return command(pair=_model(config_path, damping, model, changes), **rest)

    decorators = [
        click.option(
            "--config",
            "config_path",
            type=click.Path(exists=True, dir_okay=False, path_type=Path),
            help=f"Configuration of the workflow; {_DEFAULT_CONFIG} here, if there is one.",
        ),
        click.option("--damping", help="One of its dampings, by name; else the first."),
        click.option("--model", type=click.Choice(MODELS), default=MODELS[0], show_default=True),
        *(
            click.option(f"--{name.replace('_', '-')}", name, help=field.description)
            for name, field in _Gears.model_fields.items()
        ),
    ]
    for decorate in reversed(decorators):
        wrapped = decorate(wrapped)
    return wrapped


def _model(config_path, damping, model, changes):
    """Return the model that the options describe."""
    # Only here, so that --help does not pay for the numerical stack.
    from gearlib import GearPair, SixDegreePair

    if config_path is None and Path(_DEFAULT_CONFIG).exists():
        config_path = Path(_DEFAULT_CONFIG)
    settings = None if config_path is None else read_config(config_path)
    values = {}
    if settings is not None:
        values = settings.pair_parameters(choose_damping(settings, damping))
    elif damping is not None:
        raise click.UsageError(f"damping = {damping!r} needs a configuration: give --config")
    try:
        gears = _Gears.model_validate(values | changes)
    except ValidationError as error:
        found = sentences(error.errors(), _Gears.model_json_schema())
        raise click.UsageError("\n".join(found)) from None
    pair = GearPair(**gears.model_dump())
    if model == "one_degree":
        return pair
    if settings is None:
        raise click.UsageError("model = 'six_degrees' needs a configuration: give --config")
    try:
        return SixDegreePair(pair=pair, **settings.six_degrees.model_dump())
    except ValueError as error:
        raise click.UsageError(str(error)) from None


def choose_damping(settings, name):
    """Return the name of a damping of a configuration: the given one, or the first."""
    if name is None:
        return next(iter(settings.dampings))
    if name not in settings.dampings:
        raise click.UsageError(
            f"damping = {name!r} is not allowed: it must be one of {', '.join(settings.dampings)}"
        )
    return name


def read_config(path):
    """Return the checked configuration in a YAML file."""
    try:
        return config.load(yaml.safe_load(path.read_text(encoding="utf-8")))
    except yaml.YAMLError as error:
        raise click.UsageError(f"{path} is not YAML: {error}") from None
    except config.ConfigError as error:
        raise click.UsageError(f"{path} is refused.\n{error}") from None


def _number(text):
    """Return the number that a text is; other texts may have a unit."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
