"""The workflow: everything that the configuration asks for, from one command, `snakemake -j2`.

compile -> compute -> gather -> draw, claims: one file of rules for each stage.
"""

from snakemake.utils import min_version

min_version("9.0")


configfile: "config.yaml"


include: "workflow/rules/common.smk"


report: "workflow/report/workflow.rst"


rule all:
    input:
        target_files(),


include: "workflow/rules/compute.smk"
include: "workflow/rules/gather.smk"
include: "workflow/rules/labels.smk"
include: "workflow/rules/branches.smk"
include: "workflow/rules/draw.smk"
include: "workflow/rules/phase_lag.smk"
include: "workflow/rules/models.smk"
include: "workflow/rules/scenes.smk"
include: "workflow/rules/jump.smk"
include: "workflow/rules/nonlinear_damping.smk"
include: "workflow/rules/stability_chart.smk"
include: "workflow/rules/failures.smk"
include: "workflow/rules/work_precision.smk"
include: "workflow/rules/jump_by_method.smk"
include: "workflow/rules/claims.smk"
