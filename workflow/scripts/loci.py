"""Follow the special points of the branches over tuning and damping."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.models.pair import GearPair
from gearlib.studies import resonance_branches

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    pair = GearPair(**snakemake.params.pair)
    found = storage.read(snakemake.input.branches)
    dataset = resonance_branches.compute_loci(pair, found, **snakemake.params.settings)
    storage.write(dataset, snakemake.output.dataset)
