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
        figure_files("fig2_phase_shift"),
        figure_files("fig3_resonance"),
        figure_files("fig5_phase_planes"),
        [figure_files(name) for name in CONFIG.scenes],
        "results/claims.csv",
        "results/claims.md",


include: "workflow/rules/compute.smk"
include: "workflow/rules/gather.smk"
include: "workflow/rules/draw.smk"
include: "workflow/rules/phase_lag.smk"
include: "workflow/rules/scenes.smk"
include: "workflow/rules/claims.smk"
