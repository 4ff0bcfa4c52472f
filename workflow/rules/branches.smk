"""Branches of periodic orbits, one job for each damping, and loci of their special points."""


rule branches:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("branches"),
    output:
        dataset="results/branches/{damping}.nc",
    log:
        "results/logs/branches/{damping}.log",
    benchmark:
        "results/benchmarks/branches/{damping}.tsv"
    threads: 1
    params:
        name="{damping}",
        pair=pair_of,
        settings=canonical(CONFIG.branches.model_dump(exclude={"loci"})),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/branches.py"


rule loci:
    input:
        branches=f"results/branches/{CONFIG.branches.loci.damping}.nc",
        sources=script_sources("loci"),
    output:
        dataset="results/loci.nc",
    log:
        "results/logs/loci.log",
    benchmark:
        "results/benchmarks/loci.tsv"
    threads: 1
    params:
        pair=canonical(CONFIG.pair_parameters(CONFIG.branches.loci.damping)),
        settings=canonical(
            CONFIG.branches.model_dump(include={"start", "stop"})
            | CONFIG.branches.loci.model_dump(include={"lowest", "highest"})
        ),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/loci.py"
