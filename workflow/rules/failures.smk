"""Failures: difficult problems against methods, a job for each method, one matrix; gradients."""


use rule job as trial with:
    pathvars:
        job="failures/{trial}",
    input:
        kernels=rules.compile_kernels.output.stamp,
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=lambda wildcards: script_sources("trial", trial_named(wildcards.trial).method),
    output:
        dataset="results/failures/{trial}.nc",
    priority: LONG
    params:
        script="trial",
        trial=trial_of,


use rule job as gather_failures with:
    pathvars:
        job="gather_failures",
    input:
        shards=[f"results/failures/{name}.nc" for name in trial_names()],
        sources=script_sources("gather"),
    output:
        dataset="results/failures.nc",
    params:
        script="gather",
        gather="gather_failures",


use rule job as gradients with:
    pathvars:
        job="gradients",
    input:
        kernels=rules.compile_kernels.output.stamp,
        larger_kernels=rules.compile_larger_kernels.output.stamp,
        sources=function_sources("gearlib.studies.trials.gradients:compute"),
    output:
        dataset="results/gradients.nc",
    params:
        script="compute",
        function="gearlib.studies.trials.gradients:compute",
        ways=gradient_ways(),
