"""Failures: difficult problems against methods, a job for each method, one matrix, one figure."""


rule trial:
    input:
        kernels=rules.compile_kernels.output.stamp,
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=lambda wildcards: script_sources("trial", trial_named(wildcards.trial).method),
    output:
        dataset="results/failures/{trial}.nc",
    log:
        "results/logs/failures/{trial}.log",
    benchmark:
        "results/benchmarks/failures/{trial}.tsv"
    threads: 1
    priority: LONG
    params:
        trial=trial_of,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/trial.py"


rule gather_failures:
    input:
        columns=[f"results/failures/{name}.nc" for name in trial_names()],
        sources=script_sources("gather_failures"),
    output:
        dataset="results/failures.nc",
    log:
        "results/logs/gather_failures.log",
    benchmark:
        "results/benchmarks/gather_failures.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/gather_failures.py"


rule draw_failures:
    input:
        dataset=rules.gather_failures.output.dataset,
        sources=script_sources("draw_failures"),
    output:
        figure("failures", "Failures: difficult problems against methods", METHODS),
    log:
        "results/logs/draw_failures.log",
    benchmark:
        "results/benchmarks/draw_failures.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
        absent=absent([trial.method for trial in CONFIG.failures.trials]),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_failures.py"
