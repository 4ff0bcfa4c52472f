"""Draw the phase planes (Fig. 5) in all formats."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import phase_planes, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    figure = phase_planes.draw(
        storage.read(snakemake.input.phase_planes), colours=json.loads(snakemake.params.colours)
    )
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
