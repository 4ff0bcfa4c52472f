"""`gearlib scatter`: how jumps, contact loss and peaks scatter with tolerances."""

import math

import click
from pydantic import ValidationError

from gearlib.cli import model_options, output, progress, refusals, speed_options
from gearlib.config.tolerances_section import Tolerances, ToleratedParameter
from gearlib.data.variables import QUANTITIES
from gearlib.models import tolerated

#: What is followed from design to design unless told, as far as it asks no duty point.
_FOLLOWED = Tolerances.model_fields["quantities"].default
_WAYS = {"up": "from below", "down": "from above", "seeded": "from seeded starts"}
_TOLD = ("nominal", "mean", "deviation")


class _Tolerance(click.ParamType):
    """A parameter with what is said of it, ``"backlash upper=10um lower=-10um"``."""

    name = "parameter key=value ..."

    def convert(self, value, param, ctx):
        name, *rest = str(value).split() or [""]
        pairs = [one.partition("=") for one in rest]
        if not rest or any(not sign or not text for _, sign, text in pairs):
            self.fail(f"{value!r} is no tolerance such as 'load std=5%'", param, ctx)
        given = {key: _number(text) for key, _, text in pairs}
        if len(given) < len(pairs):
            self.fail(f"{value!r} says the same twice: each key must be given once", param, ctx)
        shape = {key: given.pop(key) for key in list(given) if key not in _KEYS}
        try:
            one = ToleratedParameter.model_validate(
                {"parameter": name, **given, **({"shape": shape} if shape else {})}
            )
            return name, _law(one)
        except ValidationError as error:
            self.fail(f"{value!r}: {error.errors()[0]['msg']}", param, ctx)
        except ValueError as error:
            self.fail(str(error), param, ctx)


def _law(one):
    """Return what is said of a `ToleratedParameter` as `gearlib.scatter` takes it."""
    known = (tolerated.of_drawing() | tolerated.of_pair()).get(one.parameter)
    return one.law(f"tolerances.{one.parameter}", known.kind if known else None)


#: Options of classes -> argument of `by_class`.
_CLASSES = {
    "thickness_class": "thickness",
    "distance_class": "centre_distance",
    "quality": "form",
}
#: Of a tolerance; the others are parameters of a distribution.
_KEYS = {name for name in ToleratedParameter.model_fields if name not in ("parameter", "shape")}


def _number(text):
    try:
        found = float(text)
    except ValueError:
        return text
    # What is no number is refused as it was written.
    return found if math.isfinite(found) else text


@click.command(cls=refusals.Command)
@model_options.options_and_mapping
@click.option(
    "-t",
    "--tolerance",
    "tolerances",
    type=_Tolerance(),
    metavar="TEXT",
    multiple=True,
    help="What scatters, such as 'load std=5%', 'backlash upper=10um lower=-10um', 'contact_ratio "
    "min=1.5 max=1.6', 'load distribution=lognorm s=0.1 scale=3300', of drawn gears 'pinion.shift "
    "std=0.01', 'centre_distance upper=20um lower=-20um'; for each parameter once. By default what "
    "the section tolerances of the configuration says.",
)
@click.option(
    "--thickness-class",
    metavar="TEXT",
    help="Of drawn gears, DIN 3967: '26cd', or '26cd 25cd' of pinion and wheel; backlash is what "
    "it leaves.",
)
@click.option("--distance-class", metavar="TEXT", help="Of drawn gears, DIN 3964: 'js7'.")
@click.option(
    "--quality",
    type=click.IntRange(1, 11),
    help="Of drawn gears, ISO 1328-1: what it allows the form of the profile scatters.",
)
@click.option(
    "--quantity",
    "quantities",
    type=click.Choice(list(QUANTITIES)),
    metavar="NAME",
    multiple=True,
    help=f"Of each design, of {', '.join(QUANTITIES)}; by default the first four, of a pair.",
)
@click.option("--samples", "n", type=int, default=1024, show_default=True, help="Designs.")
@click.option("--speed", type=speed_options.SPEED, help="Of the duty point, rpm.")
@click.option("--start", type=speed_options.TUNING, default=0.5, show_default=True, help="First.")
@click.option("--stop", type=speed_options.TUNING, default=1.4, show_default=True, help="Last.")
@click.option(
    "--points",
    type=click.IntRange(0),
    default=91,
    show_default=True,
    help="Tunings or speeds at which every design is run; 0: none.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the Sobol' points.")
@output.options("sample")
def scatter(model, mapping, drawn, tolerances, quantities, points, save, **asked):
    """How jumps, contact loss and peaks scatter with the tolerances of the gears."""
    import numpy as np

    import gearlib
    from gearlib.figures import scatter_figure
    from gearlib.uncertainty.scatter import refused

    names = [name for name, _ in tolerances]
    for name in names:
        if names.count(name) > 1:
            raise click.UsageError(f"--tolerance {name} is there twice: it must be given once")
    classes = {name: value for name in _CLASSES if (value := asked.pop(name)) is not None}
    given = dict(tolerances) or ({} if classes else _of_section(mapping))
    source, given = _scattering(model, mapping if drawn else None, given, classes)
    start, stop = (speed_options.tuning_of(model, end, asked.pop(end)) for end in ("start", "stop"))
    if not 0.0 < start < stop:
        raise click.UsageError(
            f"start = {start!r}, stop = {stop!r} is not allowed: it must be 0 < start < stop"
        )
    single = model.size == 2
    asked |= {
        "quantities": quantities or (_FOLLOWED if single else ()),
        "tunings": np.linspace(start, stop, points) if points else None,
        "directions": ("up", "down", "seeded") if single else ("up", "down"),
    }
    n = asked["n"]
    with progress.counter("designs", n) as done:
        found = gearlib.scatter(source, given, progress=done, **asked)
    for text in refused(found):
        output.words(text)
    cells = []
    for name in asked["quantities"]:
        there = int((found[f"{name}_status"] == 0).sum())
        told = [f"{float(found.get(f'{name}_{end}', np.nan)):.6g}" for end in _TOLD]
        label = f"{name} {output.printed_unit(found[name])}".rstrip()
        cells.append([label, *told, f"{there} of {n}"])
    if cells:
        output.rows(["quantity", *(name.replace("_", " ") for name in _TOLD), "found"], cells)
    if points:
        for direction in found.direction.values:
            lost = found.contact_loss_probability.sel(direction=direction)
            some, half = (int((lost.values > share).sum()) for share in (0.01, 0.5))
            output.words(
                f"Speeds reached {_WAYS[str(direction)]}: at {some} of {points} more than 1 % of "
                f"the designs lose contact, at {half} more than half."
            )
    draw = scatter_figure.bands if points else scatter_figure.quantities
    save(found, lambda plot: draw(found).axes[0])


def _of_section(mapping):
    """Return what the section of a configuration says as `gearlib.scatter` takes it."""
    if "tolerances" not in mapping:
        raise click.UsageError("--tolerance is missing: give one, such as -t 'load std=5%'")
    section = model_options.load(mapping, "The configuration").tolerances
    found = {one.parameter: _law(one) for one in section.parameters}
    if section.correlations:
        found["correlations"] = [[*one.parameters, one.rho] for one in section.correlations]
    return found


def _scattering(model, mapping, given, classes):
    """Return what scatters, the model or its drawing, and tolerances with those of classes.

    mapping: the configuration that draws the gears, None where none does.
    """
    pair = tolerated.of_pair()
    own = [name for name in given if name in tolerated.of_drawing() and name not in pair]
    if not own and not classes:
        return model, given
    option = f"tolerance {own[0]}" if own else next(iter(classes)).replace("_", "-")
    if mapping is None:
        raise click.UsageError(
            f"--{option} is not allowed: it must be left out where no drawing describes the gears"
        )
    from gearlib.studies.tolerance_study import model_of
    from gearlib.uncertainty.quality_classes import by_class

    drawing = model_options.load(mapping, "The configuration").gears.described()
    if thickness := classes.get("thickness_class"):
        drawing["backlash"] = None
        both = thickness.split()
        classes["thickness_class"] = both if len(both) > 1 else thickness
    if quality := classes.get("quality"):
        classes["quality"] = True
        for part in ("pinion", "wheel"):
            drawing[part] = drawing[part] | {"quality": quality}
    source = model_of(model.mesh.as_dict(), drawing)
    limits = {_CLASSES[name]: value for name, value in classes.items()}
    return source, by_class(source.mesh, **limits) | given
