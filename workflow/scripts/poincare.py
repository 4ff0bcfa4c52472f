"""Compute the Poincare sections of all cases."""

import math

from joblog import redirect_output
from gearlib.analysis.global_dynamics import studies
from gearlib.data import storage

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    cases = snakemake.params.cases
    for case in cases:
        case["phase"] = math.radians(case["phase"])
    dataset = studies.sections(cases, snakemake.params.settings)
    storage.write(dataset, snakemake.output.dataset)
