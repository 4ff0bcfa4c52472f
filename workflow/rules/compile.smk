"""Compile the kernels of each engine before the jobs that need most of them.

Without these rules each of the first jobs would compile them. The stamp files are not marked as
"ancient" inputs, because Snakemake would then miss edits of sources that both rules have in common.
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


# "matrix": models with several coordinates, such as gear trains; "taylor": nonlinear damping and
# smooth stiffness.
rule compile_model_kernels:
    input:
        sources=sources_of("compile_model_kernels"),
    output:
        stamp="results/{engine}_kernels.sha256",
    log:
        "results/logs/compile_{engine}_kernels.log",
    benchmark:
        "results/benchmarks/compile_{engine}_kernels.tsv"
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compile_model_kernels.py"


KERNELS = rules.compile_kernels.output.stamp
MATRIX_KERNELS, TAYLOR_KERNELS = expand(
    rules.compile_model_kernels.output.stamp, engine=["matrix", "taylor"]
)
