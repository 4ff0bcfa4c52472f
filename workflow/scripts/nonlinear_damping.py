"""Compute one model of the study of nonlinear damping."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import nonlinear_damping
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    dataset = nonlinear_damping.compute(
        snakemake.params.pair,
        snakemake.wildcards.place,
        snakemake.wildcards.power,
        grid(settings["start"], settings["stop"], settings["step"]),
        settings,
        snakemake.params.run,
        snakemake.params.samples_per_period,
    )
    storage.write(dataset, snakemake.output.dataset)
