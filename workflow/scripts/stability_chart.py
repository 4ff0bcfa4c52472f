"""Compute the chart of numerical stability."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies.trials import stability
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    dataset = stability.compute(
        snakemake.params.pair,
        grid(settings["start"], settings["stop"], settings["step"]),
        grid(settings["start"], settings["stop"], settings["fine_step"]),
        settings["steps"],
        settings["methods"],
    )
    storage.write(dataset, snakemake.output.dataset)
