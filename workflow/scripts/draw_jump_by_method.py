"""Draw the switch points of all methods in all formats."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import jump_by_method, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    jumps = [storage.read(path) for path in snakemake.input.jumps]
    figure = jump_by_method.draw(jumps, json.loads(snakemake.params.marked))
    style.note_absent(figure, json.loads(snakemake.params.absent))
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
