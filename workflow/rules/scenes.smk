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


rule draw_scene:
    input:
        dataset=rules.scene.output.dataset,
        sources=script_sources("draw_scene"),
    output:
        figure("{scene}", label_of_scene, PAPER, caption="scene"),
    log:
        "results/logs/draw_scene/{scene}.log",
    benchmark:
        "results/benchmarks/draw_scene/{scene}.tsv"
    threads: 1
    params:
        look=look_of,
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_scene.py"
