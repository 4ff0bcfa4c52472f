"""Draw the errors of settled orbits over evaluations, in all formats."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import steady_orbits, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    errors = storage.read(snakemake.input.errors)
    figure = steady_orbits.draw_orbits(errors)
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
