"""Draw the matrix of failures in all formats."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import failures, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    figure = failures.draw(storage.read(snakemake.input.dataset))
    style.note_absent(figure, json.loads(snakemake.params.absent))
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
