"""Compute certificates of the orbits for all dampings."""

from pathlib import Path

from gearlib.data import storage
from gearlib.data.files import write_csv, write_html_table
from gearlib.models.from_values import build_models
from gearlib.studies import certificates
from job import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    params = snakemake.params
    proofs = []
    if params.flint:
        branches = {Path(path).stem: storage.read(path) for path in snakemake.input.branches}
        proofs = certificates.certify_branches(
            build_models(params.pairs), branches, params.tunings, params.all_points
        )
    else:
        print("python-flint is not installed: nothing is proven")
    certificates.write_json(proofs, snakemake.output.json)
    write_csv(certificates.certificate_rows(proofs), snakemake.output.csv)
    write_html_table(snakemake.output.csv, snakemake.output.page, params.gears)
