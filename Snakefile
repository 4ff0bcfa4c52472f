"""The workflow: everything that the configuration asks for, from one command, `snakemake -j2`.

One gear pair, or several side by side: each of `cases` lays its keys over the others, and its
results go to results/<case>/.
"""

from pathlib import Path

from snakemake.utils import min_version
from workflow.provenance import write as write_provenance

min_version("9.0")


configfile: "config.yaml"


if "cases" in config:

    include: "workflow/cases.smk"

else:

    include: "workflow/Snakefile"


# Without this, a Snakefile that only includes others builds nothing.
workflow.default_target = "all"


onsuccess:
    for case in config.get("cases", [""]):
        write_provenance(Path("results", case), workflow.basedir)
