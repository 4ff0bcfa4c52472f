"""Compute the wall times of settled orbits."""

import one_thread  # noqa: F401
from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies.trials import steady_orbits

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = steady_orbits.times(
        snakemake.params.methods,
        snakemake.params.problems,
        snakemake.params.pair,
        snakemake.params.settings,
        snakemake.params.repeats,
    )
    storage.write(dataset, snakemake.output.dataset)
