"""Branches of periodic orbits, one job for each damping, and loci of their special points."""


use rule job as branches with:
    pathvars:
        job="branches/{damping}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("branches"),
    output:
        dataset="results/branches/{damping}.nc",
    params:
        script="branches",
        name="{damping}",
        pair=pair_of,
        settings=canonical(CONFIG.branches.model_dump(exclude={"loci"})),


use rule job as loci with:
    pathvars:
        job="loci",
    input:
        branches=f"results/branches/{CONFIG.branches.loci.damping}.nc",
        sources=script_sources("loci"),
    output:
        dataset="results/loci.nc",
    params:
        script="loci",
        pair=canonical(CONFIG.pair_parameters(CONFIG.branches.loci.damping)),
        settings=canonical(
            CONFIG.branches.model_dump(include={"start", "stop"})
            | CONFIG.branches.loci.model_dump(include={"lowest", "highest"})
        ),
