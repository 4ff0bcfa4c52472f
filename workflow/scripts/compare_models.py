"""Compare the models of one scene."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import model_comparison

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = model_comparison.compute(
        snakemake.params.cases,
        snakemake.params.six_degrees,
        snakemake.params.harmonics,
        **snakemake.params.question,
        run=snakemake.params.run,
        starts=snakemake.params.starts,
    )
    storage.write(dataset, snakemake.output.dataset)
