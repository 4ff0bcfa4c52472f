"""Draw the figures of a rule from its datasets, in all formats."""

from pathlib import Path
from pkgutil import resolve_name

from gearlib.figures import style
from inputs import datasets
from joblog import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    draw = resolve_name(f"gearlib.figures.{snakemake.params.draw}")
    figures = draw(**datasets(snakemake.input), **snakemake.params.settings)
    # A rule with several figures has a function that returns name -> figure.
    several = isinstance(figures, dict)
    for figure in figures.values() if several else [figures]:
        style.name_gears(figure, snakemake.params.gears)
        style.note_absent(figure, snakemake.params.absent)
        figure.set_dpi(snakemake.params.dpi)
    for path in map(Path, snakemake.output):
        style.save(figures[path.stem] if several else figures, path)
