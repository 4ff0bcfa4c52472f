"""Labels: what the motion from rest is over the tuning, one job for each damping."""


rule label:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("label"),
    output:
        dataset="results/labels/{damping}.nc",
    log:
        "results/logs/labels/{damping}.log",
    benchmark:
        "results/benchmarks/labels/{damping}.tsv"
    threads: 1
    params:
        pair=pair_of,
        settings=canonical(CONFIG.labels.model_dump()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/label.py"
