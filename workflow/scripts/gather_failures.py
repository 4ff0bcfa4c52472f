"""Gather the columns of all methods into the matrix of failures."""

from joblog import redirect_output
from gearlib.data import gathering, storage

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    columns = [storage.read(path) for path in snakemake.input.columns]
    storage.write(gathering.gather_failures(columns), snakemake.output.dataset)
