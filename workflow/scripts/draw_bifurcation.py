"""Draw the bifurcation diagram in all formats."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import bifurcation, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    branches = storage.read(snakemake.input.branches)
    figure = bifurcation.draw(
        storage.read(snakemake.input.diagram),
        storage.read(snakemake.input.shares),
        [branch for _, branch in branches.groupby("branch")],
    )
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
