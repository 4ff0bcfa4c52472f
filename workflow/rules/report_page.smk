"""The report's own page: orbits over a grid of tunings, and the page on which to choose them."""


rule report_orbits:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("report_orbits"),
    output:
        dataset="results/report_orbits.nc",
    log:
        "results/logs/report_orbits.log",
    benchmark:
        "results/benchmarks/report_orbits.tsv"
    threads: 1
    params:
        pairs=canonical({name: CONFIG.pair_parameters(name) for name in CONFIG.dampings}),
        tunings=canonical(
            [CONFIG.report_page.start, CONFIG.report_page.stop, CONFIG.report_page.step]
        ),
        run=canonical(
            run_length() | {"samples_per_period": CONFIG.report_page.samples_per_period}
        ),
        periods_shown=CONFIG.report_page.periods_shown,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/report_orbits.py"


rule draw_report_page:
    input:
        resonance=rules.gather_resonance.output.dataset,
        orbits=rules.report_orbits.output.dataset,
        sources=script_sources("draw_report_page"),
    output:
        page="results/report/index.html",
    log:
        "results/logs/draw_report_page.log",
    benchmark:
        "results/benchmarks/draw_report_page.tsv"
    threads: 1
    params:
        colours=canonical(CONFIG.figures.colours),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_report_page.py"
