"""Published problems of dead-zone oscillators: computed and drawn."""


rule published:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("published"),
    output:
        **{name: f"results/published/{name}.nc" for name in PUBLISHED},
    log:
        "results/logs/published.log",
    benchmark:
        "results/benchmarks/published.tsv"
    threads: 1
    priority: LONG
    params:
        settings=canonical(CONFIG.published.model_dump()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/published.py"
