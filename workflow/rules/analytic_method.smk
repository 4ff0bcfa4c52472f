"""The paper's analytic method and harmonic balance."""


use rule job as analytic_method with:
    pathvars:
        job="analytic_method",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources("gearlib.studies.analytic_method:compute"),
    output:
        dataset="results/analytic_method.nc",
    params:
        script="compute",
        function="gearlib.studies.analytic_method:compute",
        pair=canonical(CONFIG.pair_parameters(CONFIG.analytic_method.damping)),
        settings=canonical(CONFIG.analytic_method.model_dump()),
        run=canonical(run_length()),
        tunings=grid_of(CONFIG.analytic_method),
