"""Write a sentence as a page of the report."""

from pathlib import Path

from joblog import redirect_output
from gearlib.pages.report import tables

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    text = Path(snakemake.input.sentence).read_text(encoding="utf-8").strip()
    tables.write_text_page(text, snakemake.output.page)
