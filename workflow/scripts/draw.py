"""Draw the figures of a rule in all formats, from its input datasets."""

from pathlib import Path
from pkgutil import resolve_name

from gearlib.figures import style
from inputs import datasets
from joblog import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    draw = resolve_name(f"gearlib.figures.{snakemake.params.draw}")
    figures = draw(**datasets(snakemake.input), **snakemake.params.settings)
    # The function of a rule with several figures returns a dict, name -> figure.
    has_several = isinstance(figures, dict)
    for figure in figures.values() if has_several else [figures]:
        style.name_gears(figure, snakemake.params.gears)
        style.note_absent(figure, snakemake.params.absent)
        figure.set_dpi(snakemake.params.dpi)
    for path in map(Path, snakemake.output):
        style.save(figures[path.stem] if has_several else figures, path)
