"""Follow the branches of periodic orbits of one damping over the tuning."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.models.pair import GearPair
from gearlib.studies import resonance_branches

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    pair = GearPair(**json.loads(snakemake.params.pair))
    dataset = resonance_branches.compute(pair, **json.loads(snakemake.params.settings))
    storage.write(dataset.assign_coords(damping=snakemake.params.name), snakemake.output.dataset)
