"""Compile: the kernels of gear pairs, of larger models and of gear trains, before they are used.

Without these rules the first jobs would each compile them. The stamps are ordinary inputs: behind
an "ancient" one Snakemake would overlook edits of sources that both rules share.
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


# Jobs that need most of them wait.
rule compile_larger_kernels:
    input:
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


KERNELS = rules.compile_kernels.output.stamp
LARGER_KERNELS = rules.compile_larger_kernels.output.stamp
TRAIN_KERNELS = rules.compile_train_kernels.output.stamp
