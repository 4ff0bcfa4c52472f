"""Phase lag of the motion behind the mesh stiffness: computed and drawn (Fig. 2)."""


rule phase_lag:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("phase_lag"),
    output:
        dataset="results/phase_lag.nc",
    log:
        "results/logs/phase_lag.log",
    benchmark:
        "results/benchmarks/phase_lag.tsv"
    threads: 1
    params:
        pair=canonical(CONFIG.gear_pair.model_dump()),
        lag=canonical(CONFIG.phase_lag.model_dump()),
        samples_per_period=CONFIG.run.samples_per_period,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/phase_lag.py"
