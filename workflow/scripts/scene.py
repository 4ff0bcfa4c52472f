"""Compute one scene with the model that its comparison chose."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import scenes

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = scenes.compute(
        json.loads(snakemake.params.cases),
        storage.read(snakemake.input.comparison).chosen.item(),
        json.loads(snakemake.params.six_degrees),
        json.loads(snakemake.params.run),
    )
    storage.write(dataset, snakemake.output.dataset)
