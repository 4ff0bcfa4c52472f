"""Settled orbits: errors of the frequency domain beside time integration, wall times apart."""


use rule job as steady_orbits with:
    pathvars:
        job="steady_orbits",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=function_sources(
            "gearlib.studies.trials.steady_orbits:errors", *time_integration_methods()
        ),
    output:
        dataset="results/steady_orbits/errors.nc",
    priority: LONG
    params:
        script="compute",
        function="gearlib.studies.trials.steady_orbits:errors",
        methods=CONFIG.steady_orbits.methods,
        names=CONFIG.steady_orbits.problems,
        pair=canonical(CONFIG.gear_pair.model_dump()),
        settings=work_precision_settings(),


# As work_precision_times: nothing may run beside it.
use rule job as steady_orbit_times with:
    pathvars:
        job="steady_orbit_times",
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("steady_orbit_times", *time_integration_methods()),
    output:
        dataset="results/steady_orbits/times.nc",
    threads: 1024
    params:
        script="steady_orbit_times",
        methods=CONFIG.steady_orbits.methods,
        problems=CONFIG.steady_orbits.problems,
        pair=canonical(CONFIG.gear_pair.model_dump()),
        settings=work_precision_settings(),
        repeats=CONFIG.steady_orbits.repeats,
