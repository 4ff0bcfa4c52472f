"""Draw the figures of a rule from its datasets, in all formats."""

from pathlib import Path
from pkgutil import resolve_name

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import style


def read(paths):
    """Return the dataset of a path, or the list of those of several."""
    return storage.read(paths) if isinstance(paths, str) else [storage.read(path) for path in paths]


if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    data = {name: read(paths) for name, paths in snakemake.input.items() if name != "sources"}
    draw = resolve_name(f"gearlib.figures.{snakemake.params.draw}")
    drawn = draw(**data, **snakemake.params.settings)
    # A rule with several figures has a function that returns them by their names.
    for path in map(Path, snakemake.output):
        figure = drawn[path.stem] if isinstance(drawn, dict) else drawn
        style.note_absent(figure, snakemake.params.absent)
        figure.set_dpi(snakemake.params.dpi)
        style.save(figure, path)
