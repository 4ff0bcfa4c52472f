"""Labels: what the motion from rest is over the tuning, one job for each damping."""


use rule job as label with:
    pathvars:
        job="labels/{damping}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("label"),
    output:
        dataset="results/labels/{damping}.nc",
    params:
        script="label",
        pair=pair_of,
        settings=canonical(CONFIG.labels.model_dump()),
