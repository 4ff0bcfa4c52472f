"""Write the table of a rule from its datasets, as CSV and as a page of the report."""

from pkgutil import resolve_name

from joblog import redirect_output
from gearlib.pages.report import tables
from inputs import datasets

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    write = resolve_name(snakemake.params.function)
    given = snakemake.params.get("settings", {})
    write(**datasets(snakemake.input), **given, path=snakemake.output.csv)
    tables.write_table_page(snakemake.output.csv, snakemake.output.page)
