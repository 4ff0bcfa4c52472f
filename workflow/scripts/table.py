"""Write the table of a rule from its datasets, as CSV and as a page of the report."""

from pkgutil import resolve_name

from gearlib.data.files import write_table, write_table_page
from gearlib.models.from_values import with_models
from job import datasets, redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    function = resolve_name(snakemake.params.function)
    rows = function(**datasets(snakemake.input), **with_models(snakemake.params.settings))
    write_table(rows, snakemake.output.csv)
    write_table_page(snakemake.output.csv, snakemake.output.page, snakemake.params.gears)
