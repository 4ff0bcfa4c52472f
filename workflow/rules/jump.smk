"""Jump of the motion from rest, and what moves it (beside Fig. 6)."""


use rule job as jump with:
    pathvars:
        job="jump",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources("gearlib.studies.jump:compute"),
    output:
        dataset="results/jump.nc",
    params:
        script="compute",
        function="gearlib.studies.jump:compute",
        pair=canonical(CONFIG.pair_parameters(CONFIG.jump.damping)),
        settings=canonical(CONFIG.jump.model_dump(exclude={"marked"})),
        run=canonical(run_length()),
        tunings=grid_of(CONFIG.jump),
