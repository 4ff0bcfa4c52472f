"""Write the jumps of all methods as one table."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.pages.report import tables
from gearlib.studies.trials import jump_by_method

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    jumps = [storage.read(path) for path in snakemake.input.jumps]
    jump_by_method.write_csv(jumps, snakemake.output.csv)
    tables.write_table_page(snakemake.output.csv, snakemake.output.page)
