"""Check the paper's statements against the computed data."""

from pathlib import Path

from gearlib.data import storage
from gearlib.data.files import write_table, write_table_page
from gearlib.models.pair import GearPair
from gearlib.studies import claims
from joblog import redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    table = claims.evaluate(
        GearPair(**snakemake.params.pair),
        snakemake.params.dampings,
        storage.read(snakemake.input.resonance),
        storage.read(snakemake.input.phase_planes),
        storage.read(snakemake.input.phase_lag),
        storage.read(snakemake.input.jump),
        {Path(path).stem: storage.read(path) for path in snakemake.input.scenes},
    )
    write_table(claims.rows(table), snakemake.output.csv)
    claims.write_markdown(table, snakemake.output.markdown)
    write_table_page(snakemake.output.csv, snakemake.output.page, snakemake.params.gears)
