"""The paper's analytic method and harmonic balance: computed and drawn."""


rule analytic_method:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("analytic_method"),
    output:
        dataset="results/analytic_method.nc",
    log:
        "results/logs/analytic_method.log",
    benchmark:
        "results/benchmarks/analytic_method.tsv"
    threads: 1
    params:
        pair=canonical(CONFIG.pair_parameters(CONFIG.analytic_method.damping)),
        settings=canonical(CONFIG.analytic_method.model_dump()),
        run=canonical(run_length()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/analytic_method.py"
