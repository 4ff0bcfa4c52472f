"""Compute what the analytic method and harmonic balance do on one gear pair."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import analytic_method
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    dataset = analytic_method.compute(
        snakemake.params.pair,
        grid(settings["start"], settings["stop"], settings["step"]),
        settings,
        snakemake.params.run,
    )
    storage.write(dataset, snakemake.output.dataset)
