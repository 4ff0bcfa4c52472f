"""Draw the errors of all methods over their wall times, in all formats."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import style, work_precision

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    errors = [storage.read(path) for path in snakemake.input.errors]
    times = [storage.read(path) for path in snakemake.input.times]
    figure = work_precision.draw_time(errors, times)
    style.note_absent(figure, json.loads(snakemake.params.absent))
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
