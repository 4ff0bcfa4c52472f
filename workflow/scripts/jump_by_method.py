"""Compute the jump of the motion from rest by one method."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies.trials import jump_by_method
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    scans = [
        grid(part["start"], part["stop"], part["step"]) for part in (settings, settings["slow"])
    ]
    dataset = jump_by_method.compute(
        snakemake.wildcards.method,
        snakemake.params.pair,
        *scans,
        settings,
        snakemake.params.run,
    )
    storage.write(dataset, snakemake.output.dataset)
