"""Follow the branches of periodic orbits of one damping over the tuning."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.studies import resonance_branches

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    pair = GearPair(**snakemake.params.pair)
    dataset = resonance_branches.compute(pair, **snakemake.params.settings)
    dataset = describe(dataset.assign_coords(damping=snakemake.params.name))
    storage.write(dataset, snakemake.output.dataset)
