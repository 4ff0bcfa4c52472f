"""Parametric resonance: the chart, and the tongues of the dampings."""


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


rule parametric_resonance_page:
    input:
        sentence=rules.tongues.output.sentence,
        sources=script_sources("text_page"),
    output:
        page=table_page(
            "parametric_resonance",
            "Parametric resonance: the tuning in question, in words",
            EXPLANATIONS,
        ),
    log:
        "results/logs/parametric_resonance_page.log",
    benchmark:
        "results/benchmarks/parametric_resonance_page.tsv"
    threads: 1
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/text_page.py"
