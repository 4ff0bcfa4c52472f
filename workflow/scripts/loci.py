"""Follow the special points of the branches over tuning and damping."""

import json

from joblog import redirect_output
from gearlib import branches, storage
from gearlib.pair import GearPair

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    pair = GearPair(**json.loads(snakemake.params.pair))
    found = storage.read(snakemake.input.branches)
    dataset = branches.compute_loci(pair, found, **json.loads(snakemake.params.settings))
    storage.write(dataset, snakemake.output.dataset)
