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
