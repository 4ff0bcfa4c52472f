"""Phase lag of the motion behind the mesh stiffness (Fig. 2)."""


use rule job as phase_lag with:
    pathvars:
        job="phase_lag",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("phase_lag"),
    output:
        dataset="results/phase_lag.nc",
    params:
        script="phase_lag",
        pair=canonical(CONFIG.gear_pair.model_dump()),
        lag=canonical(CONFIG.phase_lag.model_dump()),
        samples_per_period=CONFIG.run.samples_per_period,
