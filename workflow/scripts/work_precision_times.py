"""Compute the wall times of one method on the test problems."""

import one_thread  # noqa: F401
from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies.trials import work_precision

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = work_precision.times(
        snakemake.wildcards.method,
        storage.read(snakemake.input.references),
        snakemake.params.pair,
        snakemake.params.six_degrees,
        snakemake.params.settings,
        snakemake.params.repeats,
    )
    storage.write(dataset, snakemake.output.dataset)
