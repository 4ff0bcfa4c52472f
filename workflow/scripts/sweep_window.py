"""Compute one window of the resonance characteristic: one damping, one direction."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep
from gearlib.tunings import grid, values_of


def compute(pair, window, run, *, damping, direction, threads):
    """Return the orbit summaries of one window, labelled with damping and direction."""
    summaries = sweep(GearPair(**pair), grid(*window), direction=direction, threads=threads, **run)
    return describe(summaries.assign_coords(damping=damping, direction=direction))


if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = compute(
        snakemake.params.pair,
        [*values_of(snakemake.wildcards.window), snakemake.params.step],
        snakemake.params.run,
        damping=snakemake.wildcards.damping,
        direction=snakemake.wildcards.direction,
        threads=snakemake.threads,
    )
    storage.write(dataset, snakemake.output.window)
