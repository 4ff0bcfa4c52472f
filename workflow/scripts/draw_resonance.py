"""Draw the resonance characteristics (Fig. 3) in all formats."""

import json

import xarray as xr

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import resonance, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    labels, branches, tongues = (
        [storage.read(path) for path in snakemake.input.get(name, [])]
        for name in ("labels", "branches", "parametric_resonance")
    )
    figure = resonance.draw(
        storage.read(snakemake.input.resonance),
        colours=json.loads(snakemake.params.colours),
        labels=xr.concat(labels, "damping", combine_attrs="drop_conflicts") if labels else None,
        branches={str(branch.damping.values): branch for branch in branches} or None,
        tongues=tongues[0] if tongues else None,
    )
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
