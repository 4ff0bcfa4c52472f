"""Templates of the rules: a job names itself, its inputs, its outputs and the function it calls."""


# Calls `function` with the other params and the datasets among the inputs; stores what it returns.
rule _compute:
    pathvars:
        job="{job}",
    log:
        "results/logs/<job>.log",
    benchmark:
        "results/benchmarks/<job>.tsv"
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compute.py"


# The same on all cores and one thread, for wall times.
rule _compute_alone:
    pathvars:
        job="{job}",
    log:
        "results/logs/<job>.log",
    benchmark:
        "results/benchmarks/<job>.tsv"
    threads: ALONE
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compute_alone.py"


# Writes the columns and rows that `function` returns as CSV and as a page of the report.
rule _table:
    pathvars:
        job="{job}",
    log:
        "results/logs/<job>.log",
    benchmark:
        "results/benchmarks/<job>.tsv"
    params:
        settings={},
        gears=GEAR_PAIR,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/table.py"


# Draws the figure, or figures by their names, that `draw` returns.
rule _draw:
    pathvars:
        job="{job}",
    log:
        "results/logs/<job>.log",
    benchmark:
        "results/benchmarks/<job>.tsv"
    params:
        settings={},
        gears=GEAR_PAIR,
        absent=[],
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw.py"
