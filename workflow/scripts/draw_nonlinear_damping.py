"""Draw the study of nonlinear damping in all formats."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import nonlinear_damping, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    figure = nonlinear_damping.draw([storage.read(path) for path in snakemake.input.studies])
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
