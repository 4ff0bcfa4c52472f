"""Draw the jump of the motion from rest in all formats."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import jump, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    marked = json.loads(snakemake.params.marked)
    figure = jump.draw(storage.read(snakemake.input.dataset), marked)
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
