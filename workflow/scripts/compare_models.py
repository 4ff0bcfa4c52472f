"""Compare the models of one scene."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import model_comparison

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = model_comparison.compute(
        json.loads(snakemake.params.cases),
        json.loads(snakemake.params.six_degrees),
        snakemake.params.harmonics,
        **json.loads(snakemake.params.question),
        run=json.loads(snakemake.params.run),
    )
    storage.write(dataset, snakemake.output.dataset)
