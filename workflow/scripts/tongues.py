"""Compute the tongues of all dampings, and what the data say about one tuning."""

from joblog import redirect_output
from gearlib.analysis.tongues import explanation
from gearlib.data import storage
from gearlib.data.files import replacing

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    run = snakemake.params.run
    dataset = explanation.compute(
        snakemake.params.pairs,
        snakemake.params.asked,
        *snakemake.params.tunings,
        {"periods": run["periods"], "initial_state": run["initial_state"]},
    )
    storage.write(dataset, snakemake.output.dataset)
    with replacing(snakemake.output.sentence) as temporary:
        temporary.write_text(dataset.attrs["explanation"] + "\n", encoding="utf-8")
