"""Write the page of the report on which tunings are chosen."""

from gearlib.data import storage
from gearlib.data.files import replacing
from gearlib.pages.report import page
from joblog import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    text = page.build(
        storage.read(snakemake.input.resonance),
        storage.read(snakemake.input.orbits),
        snakemake.params.colours,
        snakemake.params.gears,
    )
    with replacing(snakemake.output.page) as temporary:
        temporary.write_text(text, encoding="utf-8")
