"""Compute the Poincare sections of all cases."""

import json
import math

from joblog import redirect_output
from gearlib import storage
from gearlib.global_dynamics import studies

if __name__ == "__main__":
    redirect_output(snakemake.log[0])
    cases = json.loads(snakemake.params.cases)
    for case in cases:
        case["phase"] = math.radians(case["phase"])
    dataset = studies.sections(cases, json.loads(snakemake.params.settings))
    storage.write(dataset, snakemake.output.dataset)
