"""Draw the comparisons of all scenes in all formats."""

from pathlib import Path

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import models, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    comparisons = {Path(path).stem: storage.read(path) for path in snakemake.input.comparisons}
    figure = models.draw(comparisons)
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
