"""Gather: the shards of an experiment into one dataset."""


rule gather_resonance:
    input:
        shards=resonance_shards(),
        sources=script_sources("gather_resonance"),
    output:
        dataset="results/resonance.nc",
    log:
        "results/logs/gather_resonance.log",
    benchmark:
        "results/benchmarks/gather_resonance.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/gather_resonance.py"


rule gather_phase_planes:
    input:
        shards=phase_plane_shards(),
        sources=script_sources("gather_phase_planes"),
    output:
        dataset="results/phase_planes.nc",
    log:
        "results/logs/gather_phase_planes.log",
    benchmark:
        "results/benchmarks/gather_phase_planes.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/gather_phase_planes.py"
