"""Write the table of the study of nonlinear damping."""

from joblog import redirect_output
from gearlib.data import storage
from gearlib.pages.report import tables
from gearlib.studies import nonlinear_damping

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    studies = [storage.read(path) for path in snakemake.input.studies]
    nonlinear_damping.write_csv(studies, snakemake.output.csv)
    tables.write_table_page(snakemake.output.csv, snakemake.output.page)
