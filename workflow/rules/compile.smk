"""Compile: the kernels of gear pairs, of larger models and of gear trains, before they are used.

Without these rules the first jobs would each compile them. Jobs that need most kernels wait for the
stamps, ordinary inputs that change with the sources.
"""

for job in ("compile_kernels", "compile_larger_kernels", "compile_train_kernels"):

    rule:
        name:
            job
        input:
            sources=sources_of(job),
        output:
            stamp=f"results/{job.removeprefix('compile_')}.sha256",
        log:
            f"results/logs/{job}.log",
        benchmark:
            f"results/benchmarks/{job}.tsv"
        conda:
            "../envs/gearlib.yaml"
        script:
            f"../scripts/{job}.py"


KERNELS = rules.compile_kernels.output.stamp
LARGER_KERNELS = rules.compile_larger_kernels.output.stamp
TRAIN_KERNELS = rules.compile_train_kernels.output.stamp
