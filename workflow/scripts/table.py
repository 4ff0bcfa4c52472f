"""Write the table of a rule from its datasets, as CSV and as a page of the report."""

from pkgutil import resolve_name

from gearlib.data.files import write_csv, write_html_table
from gearlib.models.from_values import build_models
from job import read_datasets, redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    function = resolve_name(snakemake.params.function)
    rows = function(**read_datasets(snakemake.input), **build_models(snakemake.params.settings))
    write_csv(rows, snakemake.output.csv)
    write_html_table(snakemake.output.csv, snakemake.output.page, snakemake.params.gears)
