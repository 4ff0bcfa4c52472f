"""Check the statements of the paper against the computed data."""

from pathlib import Path

from gearlib.data.files import write_csv, write_html_table
from gearlib.models.from_values import build_model
from gearlib.studies import claims
from job import read_datasets, redirect_output

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    data = read_datasets(snakemake.input)
    names = [Path(path).stem for path in snakemake.input.scenes]
    data["scenes"] = dict(zip(names, data["scenes"], strict=True))
    pair = build_model(snakemake.params.pair)
    table = claims.evaluate_claims(pair, snakemake.params.dampings, **data)
    write_csv(claims.table_rows(table), snakemake.output.csv)
    claims.write_markdown(table, snakemake.output.markdown)
    write_html_table(snakemake.output.csv, snakemake.output.page, snakemake.params.gears)
