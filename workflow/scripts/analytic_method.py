"""Compute what the analytic method and harmonic balance do on one gear pair."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.studies import analytic_method
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = json.loads(snakemake.params.settings)
    dataset = analytic_method.compute(
        json.loads(snakemake.params.pair),
        grid(settings["start"], settings["stop"], settings["step"]),
        settings,
        json.loads(snakemake.params.run),
    )
    storage.write(dataset, snakemake.output.dataset)
