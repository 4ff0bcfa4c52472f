"""Compute the basins of attraction of all cases."""

from joblog import redirect_output
from gearlib.analysis.global_dynamics import studies
from gearlib.data import storage

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = studies.basin_cases(
        snakemake.params.cases,
        snakemake.params.settings,
        threads=snakemake.threads,
    )
    storage.write(dataset, snakemake.output.dataset)
