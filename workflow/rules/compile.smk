"""Compilation of the kernels of each engine before the jobs that need most of them.

Without these rules each of the first jobs would compile them. The stamps are ordinary inputs: with
"ancient" ones Snakemake would miss edits of sources that both rules have in common.
"""


rule compile_kernels:
    input:
        sources=sources_of("compile_kernels"),
    output:
        stamp="results/kernels.sha256",
    log:
        "results/logs/compile_kernels.log",
    benchmark:
        "results/benchmarks/compile_kernels.tsv"
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compile_kernels.py"


# Models with several coordinates, such as gear trains.
rule compile_matrix_kernels:
    pathvars:
        engine="matrix",
    input:
        sources=sources_of("compile_model_kernels"),
    output:
        stamp="results/<engine>_kernels.sha256",
    log:
        "results/logs/compile_<engine>_kernels.log",
    benchmark:
        "results/benchmarks/compile_<engine>_kernels.tsv"
    params:
        engine="matrix",
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compile_model_kernels.py"


# Nonlinear damping and smooth stiffness.
use rule compile_matrix_kernels as compile_taylor_kernels with:
    pathvars:
        engine="taylor",
    params:
        engine="taylor",


KERNELS = rules.compile_kernels.output.stamp
MATRIX_KERNELS = rules.compile_matrix_kernels.output.stamp
TAYLOR_KERNELS = rules.compile_taylor_kernels.output.stamp
