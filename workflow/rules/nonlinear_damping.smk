"""Nonlinear damping: one job for each place and power, one figure."""


rule nonlinear_damping:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("nonlinear_damping"),
    output:
        dataset="results/nonlinear_damping/{place}_{power}.nc",
    log:
        "results/logs/nonlinear_damping/{place}_{power}.log",
    benchmark:
        "results/benchmarks/nonlinear_damping/{place}_{power}.tsv"
    threads: 1
    params:
        pair=canonical(CONFIG.gear_pair.model_dump()),
        settings=canonical(CONFIG.nonlinear_damping.model_dump()),
        run=canonical(run_length()),
        samples_per_period=CONFIG.run.samples_per_period,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/nonlinear_damping.py"


rule nonlinear_damping_table:
    input:
        studies=nonlinear_damping_files(),
        sources=script_sources("nonlinear_damping_table"),
    output:
        csv="results/nonlinear_damping.csv",
        page=table_page("nonlinear_damping", "Nonlinear damping: table", EXPLANATIONS),
    log:
        "results/logs/nonlinear_damping_table.log",
    benchmark:
        "results/benchmarks/nonlinear_damping_table.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/nonlinear_damping_table.py"
