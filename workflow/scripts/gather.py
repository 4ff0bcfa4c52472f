"""Gather the shards of an experiment into one dataset."""

from joblog import redirect_output
from gearlib.data import gathering, storage

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    gather = getattr(gathering, snakemake.params.gather)
    dataset = gather([storage.read(path) for path in snakemake.input.shards])
    storage.write(dataset, snakemake.output.dataset)
