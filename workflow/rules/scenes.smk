"""Scenes: time courses of a few runs, one dataset each."""


use rule job as scene with:
    pathvars:
        job="scenes/{scene}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        comparison="results/models/{scene}.nc",
        sources=script_sources("scene"),
    output:
        dataset="results/scenes/{scene}.nc",
    params:
        script="scene",
        cases=cases_of,
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        run=canonical(run_length() | {"samples_per_period": CONFIG.run.samples_per_period}),
        starts=canonical(CONFIG.models.model_dump(include=STARTS)),
