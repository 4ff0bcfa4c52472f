"""Draw the bifurcation diagram in all formats."""

from gearlib import storage
from gearlib.figures import bifurcation, style
from joblog import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    figure = bifurcation.draw(
        storage.read(snakemake.input.diagram), storage.read(snakemake.input.shares)
    )
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
