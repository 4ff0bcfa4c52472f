"""Draw the surveys of the published problems in all formats."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import published, style

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    for name in published.SYMBOLS:
        figure = published.draw(storage.read(snakemake.input[name]), name)
        figure.set_dpi(snakemake.params.dpi)
        for path in snakemake.output[name]:
            style.save(figure, path)
