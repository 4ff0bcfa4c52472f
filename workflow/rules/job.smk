"""What all jobs share; a rule made from this one names its job and its script."""


rule job:
    pathvars:
        job="job",
    params:
        script="job",
    log:
        "results/logs/<job>.log",
    benchmark:
        "results/benchmarks/<job>.tsv"
    conda:
        "../envs/gearlib.yaml"
    script:
        "../scripts/{params.script}.py"
