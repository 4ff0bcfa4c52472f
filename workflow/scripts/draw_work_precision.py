"""Draw the errors of all methods over their evaluations, in all formats."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import style, work_precision

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    errors = [storage.read(path) for path in snakemake.input.errors]
    for figure, paths in (
        (work_precision.draw_evaluations(errors), snakemake.output.evaluations),
        (work_precision.draw_measures(errors), snakemake.output.measures),
    ):
        style.note_absent(figure, json.loads(snakemake.params.absent))
        figure.set_dpi(snakemake.params.dpi)
        # One format is a path, several are a list.
        for path in [paths] if isinstance(paths, str) else paths:
            style.save(figure, path)
