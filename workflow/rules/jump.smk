"""Jump of the motion from rest, and what moves it: computed and drawn (beside Fig. 6)."""


rule jump:
    input:
        kernels=rules.compile_kernels.output.stamp,
        sources=script_sources("jump"),
    output:
        dataset="results/jump.nc",
    log:
        "results/logs/jump.log",
    benchmark:
        "results/benchmarks/jump.tsv"
    threads: 1
    params:
        pair=canonical(CONFIG.pair_parameters(CONFIG.jump.damping)),
        settings=canonical(CONFIG.jump.model_dump(exclude={"marked"})),
        run=canonical(run_length()),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/jump.py"


rule draw_jump:
    input:
        dataset=rules.jump.output.dataset,
        sources=script_sources("draw_jump"),
    output:
        figure("fig6_jump", "Beside Fig. 6: what moves the jump from rest", EXPLANATIONS),
    log:
        "results/logs/draw_jump.log",
    benchmark:
        "results/benchmarks/draw_jump.tsv"
    threads: 1
    params:
        dpi=CONFIG.figures.dpi,
        marked=canonical(CONFIG.jump.marked),
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_jump.py"
