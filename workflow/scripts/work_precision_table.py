"""Write the fastest methods of every problem and accuracy as one table."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.pages.report import tables
from gearlib.studies.trials import fastest

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    errors = [storage.read(path) for path in snakemake.input.errors]
    times = [storage.read(path) for path in snakemake.input.times]
    fastest.write_csv(fastest.table(errors, times), snakemake.output.csv)
    tables.write_table_page(snakemake.output.csv, snakemake.output.page)
