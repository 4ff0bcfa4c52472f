"""Compute: one job for each window of a sweep, one for each phase plane."""


# Without this rule the first jobs would each compile the kernels of a gear pair. Its stamp is an
# ordinary input: behind an "ancient" one Snakemake would overlook edits of sources that both rules
# share.
rule compile_kernels:
    input:
        sources=script_sources("compile_kernels"),
    output:
        stamp="results/kernels.sha256",
    log:
        "results/logs/compile_kernels.log",
    benchmark:
        "results/benchmarks/compile_kernels.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compile_kernels.py"


# Those of larger models, beside the others. Jobs that need most of them wait.
rule compile_larger_kernels:
    input:
        sources=script_sources("compile_larger_kernels"),
    output:
        stamp="results/larger_kernels.sha256",
    log:
        "results/logs/compile_larger_kernels.log",
    benchmark:
        "results/benchmarks/compile_larger_kernels.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compile_larger_kernels.py"


rule sweep_window:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("sweep_window"),
    output:
        window="results/resonance/{damping}/{direction}/{window}.nc",
    log:
        "results/logs/resonance/{damping}/{direction}/{window}.log",
    benchmark:
        "results/benchmarks/resonance/{damping}/{direction}/{window}.tsv"
    threads: 1
    params:
        pair=pair_of,
        window=window_of,
        run=canonical(run_length()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/sweep_window.py"


rule phase_plane:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("phase_plane"),
    output:
        plane="results/phase_planes/{damping}/{tuning}.nc",
    log:
        "results/logs/phase_planes/{damping}/{tuning}.log",
    benchmark:
        "results/benchmarks/phase_planes/{damping}/{tuning}.tsv"
    threads: 1
    params:
        pair=pair_of,
        run=canonical(run_length() | {"samples_per_period": CONFIG.run.samples_per_period}),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/phase_plane.py"
