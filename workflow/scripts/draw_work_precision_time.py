"""Draw the errors of all methods over their wall times, in all formats."""

from gearlib import storage
from gearlib.figures import style, work_precision
from joblog import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    errors = [storage.read(path) for path in snakemake.input.errors]
    times = [storage.read(path) for path in snakemake.input.times]
    figure = work_precision.draw_time(errors, times)
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
