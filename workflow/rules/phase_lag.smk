"""Phase lag of the motion behind the mesh stiffness (Fig. 2)."""


use rule job as phase_lag with:
    pathvars:
        job="phase_lag",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources("gearlib.studies.phase_lag:compute"),
    output:
        dataset="results/phase_lag.nc",
    params:
        **CONFIG.phase_lag.model_dump(include={"tuning", "harmonics", "periods"}),
        script="compute",
        function="gearlib.studies.phase_lag:compute",
        pair=canonical(CONFIG.gear_pair.model_dump()),
        dampings=CONFIG.phase_lag.material_dampings,
        tunings=grid_of(CONFIG.phase_lag),
        samples_per_period=CONFIG.run.samples_per_period,
