"""Draw the chart of parametric resonance in all formats."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.figures import parametric_resonance, style
from gearlib.pages.report import tables

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    chart, tongues = storage.read(snakemake.input.chart), storage.read(snakemake.input.tongues)
    figure = parametric_resonance.draw(chart, tongues)
    figure.set_dpi(snakemake.params.dpi)
    for path in snakemake.output.pictures:
        style.save(figure, path)
    tables.write_text_page(tongues.attrs["explanation"], snakemake.output.page)
