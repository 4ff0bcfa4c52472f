"""Write the comparisons of all scenes as one table."""

from pathlib import Path

from joblog import redirect_output
from gearlib.data import storage
from gearlib.pages.report import tables
from gearlib.studies import model_comparison

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    comparisons = {Path(path).stem: storage.read(path) for path in snakemake.input.comparisons}
    model_comparison.write_csv(comparisons, snakemake.output.csv)
    tables.write_table_page(snakemake.output.csv, snakemake.output.page)
