"""Try one method on all difficult problems."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies.trials import failures

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    trial = snakemake.params.trial
    dataset = failures.compute(snakemake.wildcards.trial, **trial)
    storage.write(dataset, snakemake.output.dataset)
