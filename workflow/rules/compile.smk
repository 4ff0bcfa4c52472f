"""Compilation of the kernels of gear pairs, larger models and gear trains before their use.

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


rule compile_train_kernels:
    input:
        sources=sources_of("compile_train_kernels"),
    output:
        stamp="results/train_kernels.sha256",
    log:
        "results/logs/compile_train_kernels.log",
    benchmark:
        "results/benchmarks/compile_train_kernels.tsv"
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compile_train_kernels.py"


# Jobs that need most of these kernels wait for them.
rule compile_larger_kernels:
    input:
        # Models with six degrees of freedom have the kernels of trains. Changes do not count.
        after=ancient("results/train_kernels.sha256"),
        sources=sources_of("compile_larger_kernels"),
    output:
        stamp="results/larger_kernels.sha256",
    log:
        "results/logs/compile_larger_kernels.log",
    benchmark:
        "results/benchmarks/compile_larger_kernels.tsv"
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compile_larger_kernels.py"


KERNELS = rules.compile_kernels.output.stamp
LARGER_KERNELS = rules.compile_larger_kernels.output.stamp
TRAIN_KERNELS = rules.compile_train_kernels.output.stamp
