"""Compile: the kernels of gear pairs, of larger models and of gear trains, before they are used."""


# Without this rule the first jobs would each compile the kernels of a gear pair. Its stamp is an
# ordinary input: behind an "ancient" one Snakemake would overlook edits of sources that both rules
# share.
use rule job as compile_kernels with:
    pathvars:
        job="compile_kernels",
    input:
        sources=script_sources("compile_kernels"),
    output:
        stamp="results/kernels.sha256",
    params:
        script="compile_kernels",


# Those of larger models, beside the others. Jobs that need most of them wait.
use rule job as compile_larger_kernels with:
    pathvars:
        job="compile_larger_kernels",
    input:
        sources=script_sources("compile_larger_kernels"),
    output:
        stamp="results/larger_kernels.sha256",
    params:
        script="compile_larger_kernels",


use rule job as compile_train_kernels with:
    pathvars:
        job="compile_train_kernels",
    input:
        sources=script_sources("compile_train_kernels"),
    output:
        stamp="results/train_kernels.sha256",
    params:
        script="compile_train_kernels",
