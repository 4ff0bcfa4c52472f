"""The global picture: basins, bifurcation diagram, Poincare sections, computed and drawn."""


rule basins:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("basins"),
    output:
        dataset="results/basins.nc",
    log:
        "results/logs/basins.log",
    benchmark:
        "results/benchmarks/basins.tsv"
    threads: 1
    priority: LONG
    params:
        cases=global_cases(CONFIG.basins),
        settings=canonical(CONFIG.basins.model_dump(exclude={"cases"})),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/basins.py"


rule draw_basins:
    input:
        dataset=rules.basins.output.dataset,
        sources=script_sources("draw_basins"),
    output:
        figure("basins", "Basins of attraction", EXPLANATIONS),
    log:
        "results/logs/draw_basins.log",
    benchmark:
        "results/benchmarks/draw_basins.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_basins.py"


rule bifurcation:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("bifurcation"),
    output:
        diagram="results/bifurcation.nc",
        shares="results/basin_stability.nc",
    log:
        "results/logs/bifurcation.log",
    benchmark:
        "results/benchmarks/bifurcation.tsv"
    threads: 1
    priority: LONG
    params:
        pair=canonical(CONFIG.damped_parameters(CONFIG.bifurcation.damping)),
        settings=canonical(CONFIG.bifurcation.model_dump(exclude={"damping"})),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/bifurcation.py"


rule bifurcation_branches:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("branches"),
    output:
        dataset="results/bifurcation_branches.nc",
    log:
        "results/logs/bifurcation_branches.log",
    benchmark:
        "results/benchmarks/bifurcation_branches.tsv"
    threads: 1
    params:
        name="of the bifurcation diagram",
        pair=canonical(CONFIG.damped_parameters(CONFIG.bifurcation.damping)),
        settings=canonical(
            CONFIG.branches.model_dump(exclude={"loci"})
            | CONFIG.bifurcation.model_dump(include={"start", "stop"})
        ),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/branches.py"


rule draw_bifurcation:
    input:
        diagram=rules.bifurcation.output.diagram,
        branches=rules.bifurcation_branches.output.dataset,
        shares=rules.bifurcation.output.shares,
        sources=script_sources("draw_bifurcation"),
    output:
        figure("bifurcation", "Bifurcation diagram, exponents, shares of the basins", EXPLANATIONS),
    log:
        "results/logs/draw_bifurcation.log",
    benchmark:
        "results/benchmarks/draw_bifurcation.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_bifurcation.py"


rule poincare:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("poincare"),
    output:
        dataset="results/poincare.nc",
    log:
        "results/logs/poincare.log",
    benchmark:
        "results/benchmarks/poincare.tsv"
    threads: 1
    params:
        cases=global_cases(CONFIG.poincare),
        settings=canonical(CONFIG.poincare.model_dump(exclude={"cases"})),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/poincare.py"


rule draw_poincare:
    input:
        dataset=rules.poincare.output.dataset,
        sources=script_sources("draw_poincare"),
    output:
        figure("poincare", "Poincaré sections", EXPLANATIONS),
    log:
        "results/logs/draw_poincare.log",
    benchmark:
        "results/benchmarks/draw_poincare.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_poincare.py"
