"""Compute the references of the test problems."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies.trials import references

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = references.compute(
        snakemake.params.problems,
        snakemake.params.pair,
        snakemake.params.six_degrees,
        snakemake.params.settings,
    )
    storage.write(dataset, snakemake.output.dataset)
