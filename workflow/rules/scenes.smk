"""Scenes: time courses of a few runs, computed and drawn, one figure each."""


rule scene:
    input:
        kernels=rules.compile_kernels.output.stamp,
        comparison="results/models/{scene}.nc",
        sources=script_sources("scene"),
    output:
        dataset="results/scenes/{scene}.nc",
    log:
        "results/logs/scenes/{scene}.log",
    benchmark:
        "results/benchmarks/scenes/{scene}.tsv"
    threads: 1
    params:
        cases=cases_of,
        six_degrees=canonical(CONFIG.six_degrees.model_dump()),
        run=canonical(run_length() | {"samples_per_period": CONFIG.run.samples_per_period}),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/scene.py"
