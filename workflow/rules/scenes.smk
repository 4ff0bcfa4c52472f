"""Scenes: time courses of a few runs, computed and drawn, one figure each."""


def cases_of(wildcards):
    """Return the cases of a scene, with the parameters of their gear pairs."""
    return canonical(
        [
            {"title": case.title, "tuning": case.tuning, "pair": CONFIG.case_parameters(case)}
            for case in CONFIG.scenes[wildcards.scene].cases
        ]
    )


def six_degrees_of(wildcards):
    """Return what the model of a scene needs beyond the pair, null for one degree."""
    six = CONFIG.scenes[wildcards.scene].model == "six_degrees"
    return canonical(CONFIG.six_degrees.model_dump() if six else None)


def look_of(wildcards):
    """Return what the figure of a scene shows."""
    scene = CONFIG.scenes[wildcards.scene]
    return canonical({"courses": scene.courses, "periods_shown": scene.periods_shown})


rule scene:
    input:
        kernels=rules.compile_kernels.output.stamp,
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
        six_degrees=six_degrees_of,
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
        report(
            expand("results/figures/{{scene}}.{format}", format=CONFIG.figures.formats),
            caption="../report/scene.rst",
            category="Figures",
            labels={"figure": "{scene}", "shows": "time courses"},
        ),
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
