"""The jump of the motion from rest, method by method: computed, tabled, drawn."""


rule jump_by_method:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=sources_with_method("jump_by_method"),
    output:
        dataset="results/jump_by_method/{method}.nc",
    log:
        "results/logs/jump_by_method/{method}.log",
    benchmark:
        "results/benchmarks/jump_by_method/{method}.tsv"
    threads: 1
    priority: LONG
    params:
        pair=canonical(CONFIG.pair_parameters(CONFIG.jump_by_method.damping)),
        settings=canonical(CONFIG.jump_by_method.model_dump(exclude={"methods", "damping"})),
        run=canonical(run_length()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/jump_by_method.py"


rule jump_by_method_table:
    input:
        jumps=jump_by_method_files(),
        sources=script_sources("jump_by_method_table"),
    output:
        csv="results/jump_by_method.csv",
        page=table_page("jump_by_method", "Jump from rest by method: table", METHODS),
    log:
        "results/logs/jump_by_method_table.log",
    benchmark:
        "results/benchmarks/jump_by_method_table.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/jump_by_method_table.py"
