"""Label the motion from rest of one damping over the tuning."""

from joblog import redirect_output
from gearlib.analysis import trust
from gearlib.data import storage
from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.tunings import grid

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    settings = snakemake.params.settings
    tunings = grid(*(settings.pop(key) for key in ("start", "stop", "step")))
    dataset = trust.scan(GearPair(**snakemake.params.pair), tunings, **settings)
    dataset = describe(dataset.assign_coords(damping=snakemake.wildcards.damping))
    storage.write(dataset, snakemake.output.dataset)
