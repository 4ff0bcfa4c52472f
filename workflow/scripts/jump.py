"""Compute the jump of the motion from rest and its variations."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import jump
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    dataset = jump.compute(
        snakemake.params.pair,
        grid(settings["start"], settings["stop"], settings["step"]),
        settings,
        snakemake.params.run,
    )
    storage.write(dataset, snakemake.output.dataset)
