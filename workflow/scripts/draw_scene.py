"""Draw one scene in all formats."""

import json

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import style, time_courses

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    figure = time_courses.draw(
        storage.read(snakemake.input.dataset), **json.loads(snakemake.params.look)
    )
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
