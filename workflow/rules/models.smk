"""Models: what larger ones would change in each scene; their choice, table and figure."""


rule compare_models:
    input:
        kernels=rules.compile_kernels.output.stamp,
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=script_sources("compare_models"),
    output:
        dataset="results/models/{scene}.nc",
    log:
        "results/logs/compare_models/{scene}.log",
    benchmark:
        "results/benchmarks/compare_models/{scene}.tsv"
    threads: 1
    params:
        cases=cases_of,
        question=question_of,
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        harmonics=CONFIG.models.harmonics,
        run=canonical(run_length()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compare_models.py"


rule model_table:
    input:
        comparisons=[f"results/models/{name}.nc" for name in CONFIG.scenes],
        sources=script_sources("model_table"),
    output:
        csv="results/models.csv",
        page=table_page("models", "Models: table", EXPLANATIONS),
    log:
        "results/logs/model_table.log",
    benchmark:
        "results/benchmarks/model_table.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/model_table.py"


rule draw_models:
    input:
        comparisons=[f"results/models/{name}.nc" for name in CONFIG.scenes],
        sources=script_sources("draw_models"),
    output:
        figure("models", "Models: what larger ones would change", EXPLANATIONS),
    log:
        "results/logs/draw_models.log",
    benchmark:
        "results/benchmarks/draw_models.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_models.py"
