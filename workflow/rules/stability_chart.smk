"""Numerical stability of fixed-step methods: computed and drawn."""


rule stability_chart:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources(
            "stability_chart", *(m.method for m in CONFIG.stability_chart.methods.values())
        ),
    output:
        dataset="results/stability_chart.nc",
    log:
        "results/logs/stability_chart.log",
    benchmark:
        "results/benchmarks/stability_chart.tsv"
    threads: 1
    params:
        pair=canonical(CONFIG.pair_parameters(CONFIG.stability_chart.damping)),
        settings=canonical(CONFIG.stability_chart.model_dump()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/stability_chart.py"
