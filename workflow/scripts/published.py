"""Compute the surveys of the published problems."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies.trials import published

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    for name in published.PROBLEMS:
        storage.write(published.survey(name, **settings), snakemake.output[name])
