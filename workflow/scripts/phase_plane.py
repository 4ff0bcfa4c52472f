"""Compute one phase plane: one damping, one tuning."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate


def compute(pair, tuning, run, *, damping):
    """Return the recorded run, labelled with its damping."""
    return simulate(GearPair(**pair), tuning, **run).assign_coords(damping=damping)


if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = compute(
        json.loads(snakemake.params.pair),
        float(snakemake.wildcards.tuning),
        json.loads(snakemake.params.run),
        damping=snakemake.wildcards.damping,
    )
    storage.write(dataset, snakemake.output.plane)
