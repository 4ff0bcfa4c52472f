"""Prove what can be proven of the orbits of all dampings."""

from pathlib import Path

from gearlib.data import storage
from gearlib.data.files import write_table, write_table_page
from gearlib.studies import certificates
from joblog import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    given = snakemake.params
    rows = []
    if given.flint:
        branches = {Path(path).stem: storage.read(path) for path in snakemake.input.branches}
        rows = certificates.compute(given.pairs, branches, given.tunings, given.all_points)
    else:
        print("python-flint is not installed: nothing is proven")
    certificates.write_json(rows, snakemake.output.json)
    write_table(certificates.rows(rows), snakemake.output.csv)
    write_table_page(snakemake.output.csv, snakemake.output.page, given.gears)
