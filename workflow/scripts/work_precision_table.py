"""Write the fastest method of every problem and accuracy as one table."""

from joblog import redirect_output
from gearlib import storage
from gearlib.reporting import tables
from gearlib.trials import work_precision

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    errors = [storage.read(path) for path in snakemake.input.errors]
    times = [storage.read(path) for path in snakemake.input.times]
    work_precision.write_csv(work_precision.table(errors, times), snakemake.output.csv)
    tables.write_table_page(snakemake.output.csv, snakemake.output.page)
