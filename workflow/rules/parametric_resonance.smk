"""Parametric resonance: the chart, the tongues of the dampings, and the picture of both."""


rule parametric_resonance:
    input:
        sources=script_sources("parametric_resonance"),
        kernels=rules.compile_kernels.output.stamp,
    output:
        dataset="results/parametric_resonance.nc",
    log:
        "results/logs/parametric_resonance.log",
    benchmark:
        "results/benchmarks/parametric_resonance.tsv"
    threads: 1
    params:
        pair=canonical(CONFIG.gear_pair.model_dump()),
        settings=canonical(CONFIG.parametric_resonance.model_dump(exclude={"asked"})),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/parametric_resonance.py"


rule tongues:
    input:
        sources=script_sources("tongues"),
        kernels=rules.compile_kernels.output.stamp,
    output:
        dataset="results/tongues.nc",
        sentence="results/parametric_resonance.txt",
    log:
        "results/logs/tongues.log",
    benchmark:
        "results/benchmarks/tongues.tsv"
    threads: 1
    params:
        pairs=canonical({name: CONFIG.pair_parameters(name) for name in CONFIG.dampings}),
        asked=CONFIG.parametric_resonance.asked,
        tunings=canonical([CONFIG.parametric_resonance.start, CONFIG.parametric_resonance.stop]),
        run=canonical(run_length()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/tongues.py"


rule draw_parametric_resonance:
    input:
        chart=rules.parametric_resonance.output.dataset,
        tongues=rules.tongues.output.dataset,
        sources=script_sources("draw_parametric_resonance"),
    output:
        pictures=figure("parametric_resonance", "Parametric resonance: tongues", EXPLANATIONS),
        page=table_page(
            "parametric_resonance",
            "Parametric resonance: the tuning in question, in words",
            EXPLANATIONS,
        ),
    log:
        "results/logs/draw_parametric_resonance.log",
    benchmark:
        "results/benchmarks/draw_parametric_resonance.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_parametric_resonance.py"
