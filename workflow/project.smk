"""A project with a name: the whole workflow, its results in a folder of its own."""


module project:
    snakefile:
        "Snakefile"
    config:
        config
    replace_prefix:
        {"results/": f"{RESULTS}/"}


use rule * from project
