"""Draw: one job for each figure, all formats at once."""


rule draw_resonance:
    input:
        **beside_resonance(),
        resonance=rules.gather_resonance.output.dataset,
        sources=script_sources("draw_resonance"),
    output:
        figure("fig3_resonance", "Fig. 3: resonance characteristics, all dampings", PAPER),
    log:
        "results/logs/draw_resonance.log",
    benchmark:
        "results/benchmarks/draw_resonance.tsv"
    threads: 1
    params:
        colours=canonical(CONFIG.figures.colours),
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_resonance.py"


rule draw_phase_planes:
    input:
        phase_planes=rules.gather_phase_planes.output.dataset,
        sources=script_sources("draw_phase_planes"),
    output:
        figure("fig5_phase_planes", "Fig. 5: phase planes, all dampings", PAPER),
    log:
        "results/logs/draw_phase_planes.log",
    benchmark:
        "results/benchmarks/draw_phase_planes.tsv"
    threads: 1
    params:
        colours=canonical(CONFIG.figures.colours),
        dpi=CONFIG.figures.dpi,
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/draw_phase_planes.py"
