"""Published problems of dead-zone oscillators."""


use rule job as published with:
    pathvars:
        job="published",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("published"),
    output:
        **{name: f"results/published/{name}.nc" for name in PUBLISHED},
    priority: LONG
    params:
        script="published",
        settings=canonical(CONFIG.published.model_dump()),
