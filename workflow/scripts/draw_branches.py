"""Draw the branches with their special points, and the loci of these, in all formats."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import branches, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    figure = branches.draw(
        storage.read(snakemake.input.branches), storage.read(snakemake.input.loci)
    )
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
