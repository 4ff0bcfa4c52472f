"""Gather the shards of the resonance characteristic into one dataset."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.data.gathering import gather_resonance

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = gather_resonance([storage.read(path) for path in snakemake.input.shards])
    storage.write(dataset, snakemake.output.dataset)
