"""Compute one window of the resonance characteristic: one damping, one direction."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep
from gearlib.tunings import grid


def compute(pair, window, run, *, damping, direction, threads):
    """Return the orbit summaries of one window, labelled with damping and direction."""
    summaries = sweep(GearPair(**pair), grid(*window), direction=direction, threads=threads, **run)
    return summaries.assign_coords(damping=damping, direction=direction)


if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = compute(
        json.loads(snakemake.params.pair),
        json.loads(snakemake.params.window),
        json.loads(snakemake.params.run),
        damping=snakemake.wildcards.damping,
        direction=snakemake.wildcards.direction,
        threads=snakemake.threads,
    )
    storage.write(dataset, snakemake.output.window)
