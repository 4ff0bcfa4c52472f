"""Draw the Poincare sections in all formats."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import poincare, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    figure = poincare.draw(storage.read(snakemake.input.dataset))
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output:
        style.save(figure, path)
