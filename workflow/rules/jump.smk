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
