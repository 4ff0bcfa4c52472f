"""Compute one phase plane: one damping, one tuning."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.simulation import simulate
from gearlib.tunings import values_of


def compute(pair, tuning, run, *, damping):
    """Return the recorded run, labelled with its damping."""
    return describe(simulate(GearPair(**pair), tuning, **run).assign_coords(damping=damping))


if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    dataset = compute(
        snakemake.params.pair,
        *values_of(snakemake.wildcards.tuning),
        snakemake.params.run,
        damping=snakemake.wildcards.damping,
    )
    storage.write(dataset, snakemake.output.plane)
