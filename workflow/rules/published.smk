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


rule draw_published:
    input:
        **rules.published.output,
        sources=script_sources("draw_published"),
    output:
        **{
            name: figure(f"published_{name}", label, PUBLISHED_PART)
            for name, label in PUBLISHED.items()
        },
    log:
        "results/logs/draw_published.log",
    benchmark:
        "results/benchmarks/draw_published.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_published.py"
