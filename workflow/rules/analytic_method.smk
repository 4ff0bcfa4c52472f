"""The paper's analytic method and harmonic balance."""


use rule job as analytic_method with:
    pathvars:
        job="analytic_method",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("analytic_method"),
    output:
        dataset="results/analytic_method.nc",
    params:
        script="analytic_method",
        pair=canonical(CONFIG.pair_parameters(CONFIG.analytic_method.damping)),
        settings=canonical(CONFIG.analytic_method.model_dump()),
        run=canonical(run_length()),
