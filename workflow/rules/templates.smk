"""Define templates of rules; a rule adds its job name, inputs, outputs and the function to call."""


wildcard_constraints:
    damping=r"[A-Za-z0-9+_-]+",
    direction="cold|up|down",
    engine="matrix|taylor",
    window=r"\d+\.\d+-\d+\.\d+",
    tuning=r"\d+\.\d+",
    samples=r"\d+-\d+",
    scene=r"[A-Za-z0-9+_-]+",
    method=r"[a-z0-9_]+",
    place="material|oil",
    power="linear|quadratic|cubic",
    trial=r"[A-Za-z0-9+_-]+",
    measured=r"[A-Za-z0-9+_-]+",
    number=r"\d+",


# Call `function` with the other params and the input datasets, and store the returned datasets.
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


# Do the same in one thread while no other job runs, to measure wall times.
rule _compute_alone:
    pathvars:
        job="{job}",
    log:
        "results/logs/<job>.log",
    benchmark:
        "results/benchmarks/<job>.tsv"
    threads: ALL_CORES
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/compute_alone.py"


# Write the column names and rows that `function` yields as CSV and as a page of the report.
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


# Save the figure, or the dict of figures by name, that `draw` returns.
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
