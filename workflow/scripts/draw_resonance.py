"""Draw the resonance characteristics (Fig. 3) in all formats."""

import json

import xarray as xr

from joblog import redirect_output
from gearlib import storage
from gearlib.figures import resonance, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    labels = [storage.read(path) for path in snakemake.input.labels]
    branches = [storage.read(path) for path in snakemake.input.branches]
    figure = resonance.draw(
        storage.read(snakemake.input.resonance),
        colours=json.loads(snakemake.params.colours),
        labels=xr.concat(labels, "damping", combine_attrs="drop_conflicts"),
        branches={str(branch.damping.values): branch for branch in branches},
        tongues=storage.read(snakemake.input.tongues),
    )
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
