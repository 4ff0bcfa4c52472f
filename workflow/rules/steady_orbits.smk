"""Settled orbits: errors of the frequency domain beside time integration, wall times apart."""


rule steady_orbits:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("steady_orbits", *time_integration_methods()),
    output:
        dataset="results/steady_orbits/errors.nc",
    log:
        "results/logs/steady_orbits.log",
    benchmark:
        "results/benchmarks/steady_orbits.tsv"
    threads: 1
    priority: LONG
    params:
        methods=CONFIG.steady_orbits.methods,
        problems=CONFIG.steady_orbits.problems,
        pair=canonical(CONFIG.gear_pair.model_dump()),
        settings=work_precision_settings(),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/steady_orbits.py"


# As work_precision_times: nothing may run beside it.
rule steady_orbit_times:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("steady_orbit_times", *time_integration_methods()),
    output:
        dataset="results/steady_orbits/times.nc",
    log:
        "results/logs/steady_orbit_times.log",
    benchmark:
        "results/benchmarks/steady_orbit_times.tsv"
    threads: 1024
    params:
        methods=CONFIG.steady_orbits.methods,
        problems=CONFIG.steady_orbits.problems,
        pair=canonical(CONFIG.gear_pair.model_dump()),
        settings=work_precision_settings(),
        repeats=CONFIG.steady_orbits.repeats,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/steady_orbit_times.py"
