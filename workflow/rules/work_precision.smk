"""Work and precision: references, errors and evaluations of each method, their wall times apart."""


# The kernels are those of long runs, which say where Newton's method starts.
rule work_precision_references:
    input:
        kernels=rules.compile_kernels.output.stamp,
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=script_sources("work_precision_references"),
    output:
        dataset="results/work_precision/references.nc",
    log:
        "results/logs/work_precision/references.log",
    benchmark:
        "results/benchmarks/work_precision/references.tsv"
    threads: 1
    priority: LONG
    params:
        problems=CONFIG.work_precision.problems,
        pair=canonical(CONFIG.gear_pair.model_dump()),
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        settings=work_precision_settings(),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/work_precision_references.py"


rule work_precision_errors:
    input:
        kernels=rules.compile_kernels.output.stamp,
        references=rules.work_precision_references.output.dataset,
        sources=sources_with_method("work_precision_errors"),
    output:
        dataset="results/work_precision/errors_{method}.nc",
    log:
        "results/logs/work_precision/errors_{method}.log",
    benchmark:
        "results/benchmarks/work_precision/errors_{method}.tsv"
    threads: 1
    priority: LONG
    params:
        pair=canonical(CONFIG.gear_pair.model_dump()),
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        settings=work_precision_settings(),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/work_precision_errors.py"


# Wall times: no two runs give the same, so nothing but the figure and the table of times may
# depend on this dataset. It asks for more threads than there are: Snakemake then gives it all
# cores of the call and starts no job beside it, whose load would be measured along.
rule work_precision_times:
    input:
        kernels=rules.compile_kernels.output.stamp,
        references=rules.work_precision_references.output.dataset,
        sources=sources_with_method("work_precision_times"),
    output:
        dataset="results/work_precision/times_{method}.nc",
    log:
        "results/logs/work_precision/times_{method}.log",
    benchmark:
        "results/benchmarks/work_precision/times_{method}.tsv"
    threads: 1024
    params:
        pair=canonical(CONFIG.gear_pair.model_dump()),
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        settings=work_precision_settings(),
        repeats=CONFIG.work_precision.repeats,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/work_precision_times.py"


rule work_precision_table:
    input:
        errors=work_precision_files("errors"),
        times=work_precision_files("times"),
        sources=script_sources("work_precision_table"),
    output:
        csv="results/work_precision.csv",
        page=table_page("work_precision", "Work and precision: table of the fastest", METHODS),
    log:
        "results/logs/work_precision_table.log",
    benchmark:
        "results/benchmarks/work_precision_table.tsv"
    threads: 1
    params:
        absent=absent(CONFIG.work_precision.methods),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/work_precision_table.py"


rule draw_work_precision:
    input:
        errors=work_precision_files("errors"),
        sources=script_sources("draw_work_precision"),
    output:
        evaluations=figure("work_precision_evaluations", "Work and precision: evaluations", METHODS),
        measures=figure(
            "work_precision_measures", "Work and precision: events, multipliers", METHODS
        ),
    log:
        "results/logs/draw_work_precision.log",
    benchmark:
        "results/benchmarks/draw_work_precision.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
        absent=absent(CONFIG.work_precision.methods),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_work_precision.py"


rule draw_work_precision_time:
    input:
        errors=work_precision_files("errors"),
        times=work_precision_files("times"),
        sources=script_sources("draw_work_precision_time"),
    output:
        figure("work_precision_time", "Work and precision: wall time", METHODS),
    log:
        "results/logs/draw_work_precision_time.log",
    benchmark:
        "results/benchmarks/draw_work_precision_time.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
        absent=absent(CONFIG.work_precision.methods),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_work_precision_time.py"
