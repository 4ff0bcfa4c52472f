"""The global picture: basins, bifurcation diagram, Poincare sections."""


use rule job as basins with:
    pathvars:
        job="basins",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("basins"),
    output:
        dataset="results/basins.nc",
    priority: LONG
    params:
        script="basins",
        cases=global_cases(CONFIG.basins),
        settings=canonical(CONFIG.basins.model_dump(exclude={"cases"})),


use rule job as bifurcation with:
    pathvars:
        job="bifurcation",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("bifurcation"),
    output:
        diagram="results/bifurcation.nc",
        shares="results/basin_stability.nc",
    priority: LONG
    params:
        script="bifurcation",
        pair=canonical(CONFIG.damped_parameters(CONFIG.bifurcation.damping)),
        settings=canonical(CONFIG.bifurcation.model_dump(exclude={"damping"})),


use rule job as bifurcation_branches with:
    pathvars:
        job="bifurcation_branches",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("branches"),
    output:
        dataset="results/bifurcation_branches.nc",
    params:
        script="branches",
        name="of the bifurcation diagram",
        pair=canonical(CONFIG.damped_parameters(CONFIG.bifurcation.damping)),
        settings=canonical(
            CONFIG.branches.model_dump(exclude={"loci"})
            | CONFIG.bifurcation.model_dump(include={"start", "stop"})
        ),


use rule job as poincare with:
    pathvars:
        job="poincare",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("poincare"),
    output:
        dataset="results/poincare.nc",
    params:
        script="poincare",
        cases=global_cases(CONFIG.poincare),
        settings=canonical(CONFIG.poincare.model_dump(exclude={"cases"})),
