"""Compute the errors and evaluations of settled orbits."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies.trials import steady_orbits

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = steady_orbits.errors(
        snakemake.params.methods,
        snakemake.params.problems,
        snakemake.params.pair,
        snakemake.params.settings,
    )
    storage.write(dataset, snakemake.output.dataset)
