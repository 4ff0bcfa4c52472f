"""Compute all targets of the configuration with a single command, `snakemake -j2`.

Each file of rules covers one subject, in the order compile -> compute -> gather -> draw, table.
"""

import os
from pathlib import Path

from snakemake.utils import min_version
from gearlib.data.files import remove_temporary_files
from workflow.provenance import write as write_provenance

min_version("9.25")


include: "workflow/rules/helpers.smk"


report: "workflow/report/workflow.rst" if IS_PAPER else "workflow/report/own_gears.rst"


include: "workflow/rules/templates.smk"
include: "workflow/rules/compile.smk"
include: "workflow/rules/paper.smk"
include: "workflow/rules/motions.smk"
include: "workflow/rules/methods.smk"
include: "workflow/rules/trains.smk"
include: "workflow/rules/geometry.smk"
include: "workflow/rules/uncertainty.smk"
include: "workflow/rules/gearbox.smk"
include: "workflow/rules/targets.smk"


rule all:
    default_target: True
    input:
        [getattr(rules, target).input for target in WANTED],
        [] if IS_PAPER or WANTED == ["gearbox"] else rules.gears_table.output,


rule paper:
    input:
        [
            getattr(rules, x).input
            for x in targets.PAPER_TARGETS
            if not targets.refusal_reason(x, CONFIG)
        ],


onstart:
    if not os.access("results" if Path("results").exists() else ".", os.W_OK):
        exit_with_error("Nothing can be written to results.")
    # Since Snakemake has locked the folder, temporary files can only stem from a killed run.
    remove_temporary_files(Path("results"))


onsuccess:
    write_provenance(Path("results"), workflow.basedir)
