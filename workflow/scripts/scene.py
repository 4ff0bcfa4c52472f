"""Compute one scene with the model that its comparison chose."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import scenes

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = scenes.compute(
        snakemake.params.cases,
        storage.read(snakemake.input.comparison).chosen.item(),
        snakemake.params.six_degrees,
        snakemake.params.run,
        snakemake.params.starts,
    )
    storage.write(dataset, snakemake.output.dataset)
