"""Compute the ends of the motions from rest that the page of the report shows."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.pages.report import orbits
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = orbits.compute(
        snakemake.params.pairs,
        grid(*snakemake.params.tunings),
        snakemake.params.run,
        snakemake.params.periods_shown,
    )
    storage.write(dataset, snakemake.output.dataset)
