"""The dynamic factor of drawn gears over speed, beside that of ISO 6336-1."""


use rule job as dynamic_factor with:
    pathvars:
        job="dynamic_factor",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources("gearlib.studies.dynamic_factor:compute"),
    output:
        dataset="results/dynamic_factor.nc",
    params:
        script="compute",
        function="gearlib.studies.dynamic_factor:compute",
        pair=canonical(CONFIG.dynamic_factor.model_dump()["pair"]),
        ratios=grid_of(CONFIG.dynamic_factor),
        settings=canonical(CONFIG.dynamic_factor.model_dump(exclude={"pair", *GRID})),
