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


rule draw_analytic_method:
    input:
        dataset=rules.analytic_method.output.dataset,
        sources=script_sources("draw_analytic_method"),
    output:
        convergence=figure("analytic_method", "The paper's analytic method", METHODS),
        harmonics=figure("harmonic_balance", "Harmonic balance", METHODS),
    log:
        "results/logs/draw_analytic_method.log",
    benchmark:
        "results/benchmarks/draw_analytic_method.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_analytic_method.py"
