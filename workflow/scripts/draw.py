"""Draw the figures of a rule in all formats from its input datasets."""

from pathlib import Path
from pkgutil import resolve_name

from gearlib.data import motions
from gearlib.figures import style
from job import read_datasets, redirect_output


def draw_figures(files, paths, draw, settings, gears, absent, dpi):
    """Draw the figures of a rule and save each of them in all formats.

    `files` are the named inputs of the rule, and `paths` its outputs. `draw` is the name of a
    function in `gearlib.figures`, such as "orders_figure.draw", which is called with the datasets
    and the `settings`. The caption of a figure is `gears` ("": no caption) and names the methods
    whose packages are `absent`; `dpi` is the resolution. If there is an input "teeth" with sweeps
    of the load-sharing pair, the caption also states whether this pair loses contact.
    """
    data = read_datasets(files)
    for teeth in data.pop("teeth", []):
        gears = f"{gears}. {motions.describe_contact_loss(teeth)}"
    figures = resolve_name(f"gearlib.figures.{draw}")(**data, **settings)
    # A function that draws several figures returns a dict, name -> figure.
    has_several = isinstance(figures, dict)
    for figure in figures.values() if has_several else [figures]:
        style.add_gear_caption(figure, gears)
        style.add_missing_package_note(figure, absent)
        figure.set_dpi(dpi)
    for path in map(Path, paths):
        style.save(figures[path.stem] if has_several else figures, path)


if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    draw_figures(snakemake.input, snakemake.output, **dict(snakemake.params.items()))
