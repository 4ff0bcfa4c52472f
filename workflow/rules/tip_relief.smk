"""Tip relief: Harris maps, and the motion by two models."""


use rule job as harris_map with:
    pathvars:
        job="harris_map",
    input:
        sources=function_sources("gearlib.studies.tip_relief:harris_map"),
    output:
        dataset="results/harris_map.nc",
    params:
        script="compute",
        function="gearlib.studies.tip_relief:harris_map",
        gears=canonical(CONFIG.harris_map.gears.model_dump()),
        loads=CONFIG.harris_map.loads,
        stiffness=CONFIG.harris_map.stiffness,
        phases=CONFIG.harris_map.phases,


# Its own kernels are compiled by itself: no other job needs them.
use rule job as relief_dynamics with:
    pathvars:
        job="relief_dynamics",
    input:
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=function_sources("gearlib.studies.tip_relief:dynamics"),
    output:
        dataset="results/relief_dynamics.nc",
    params:
        script="compute",
        function="gearlib.studies.tip_relief:dynamics",
        gears=canonical(CONFIG.harris_map.gears.model_dump()),
        stiffness=CONFIG.harris_map.stiffness,
        tunings=grid_of(CONFIG.relief_dynamics),
        settings=canonical(CONFIG.relief_dynamics.model_dump(exclude=GRID)),
