"""Follow the branches of periodic orbits of one damping over the tuning."""

import json

from joblog import redirect_output
from gearlib import branches, storage
from gearlib.pair import GearPair

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    pair = GearPair(**json.loads(snakemake.params.pair))
    dataset = branches.compute(pair, **json.loads(snakemake.params.settings))
    storage.write(dataset.assign_coords(damping=snakemake.params.name), snakemake.output.dataset)
