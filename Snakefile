"""The workflow: everything that the configuration asks for, from one command, `snakemake -j2`.

One gear pair, or several side by side: each of `cases` lays its keys over the others, and its
results go to results/<case>/. A project with a name has results/<project>/.
"""

import gc
import os
import sys
from pathlib import Path

from snakemake.logging import logger
from snakemake.shell import shell
from snakemake.utils import min_version
from gearlib import config as configuration
from gearlib import processor
from gearlib.data.files import remove_leftovers
from gearlib.config import yaml_keys
from gearlib.removed import REMOVED, sentence
from workflow import projects
from workflow.provenance import write as write_provenance
from workflow.checksums import foreign, replaced
from workflow.refusal import interrupted, refuse

min_version("9.12")

# Here, before a drawing loads numpy, for all jobs: those on other nodes read this file there.
os.environ.update(processor.settings())

# Jobs and their files are many objects that stay: to look for garbage among them takes an eighth of
# a start.
gc.set_threshold(200_000)

# Ctrl-C: Snakemake does not tell where it was in its plans, and a job ends at once, since Python
# does not hear of it.
sys.excepthook = interrupted
shell.prefix("set -eu; trap 'kill $! 2>/dev/null' INT TERM;")
shell.suffix("& wait $!")

#: Calls that compute nothing; of a dry run Snakemake itself tells.
ASKING = {"--unlock", "--lint", "--dag", "--rulegraph", "--filegraph", "--summary", "--list-rules"}


# Of an installed package, unless this folder has one of its own.
OF_PAPER = "config.yaml" if Path("config.yaml").exists() else Path(workflow.basedir, "config.yaml")
try:
    BASE = yaml_keys.read(OF_PAPER)[0]
except ValueError as error:
    refuse(error)


configfile: OF_PAPER


given = workflow.config_settings.overwrite_config
if given:
    counts = configuration.chosen(config, given)
    config.clear()
    config.update(counts)

NAME = projects.name_of(config, BASE, given, workflow.overwrite_configfiles)
if NAME:
    config["project"] = NAME
RESULTS = Path("results", NAME)
# Before rules add to it what it leaves out.
MACHINES = projects.machines(RESULTS, config)

# Jobs on other nodes leave this to the process that sent them.
if workflow.is_main_process:
    elsewhere, others = foreign(Path("results")), replaced(Path("results"))
    fault = ""
    if elsewhere:
        fault = (
            f"No record says how these were made, {len(elsewhere)} in all: {elsewhere[0]} ... They "
            "come from another folder, or .snakemake was removed. Remove results/, or bring the "
            ".snakemake that belongs to it."
        )
    elif others:
        others = " ".join(map(str, others))
        fault = (
            f"Not what their jobs wrote: {others}. To have them computed anew, remove them and "
            f"call snakemake -j2 {others}"
        )
    elif others := projects.of_others(MACHINES):
        fault = "\n".join(others)
    if fault and (workflow.output_settings.dryrun or ASKING & set(sys.argv)):
        logger.warning(fault)
    elif fault:
        refuse(fault)
    for word in sys.argv[1:]:
        if word in REMOVED:
            refuse(sentence(word))


if "cases" in config:

    include: "workflow/cases.smk"

elif NAME:

    include: "workflow/project.smk"

else:

    include: "workflow/Snakefile"


include: "workflow/compare.smk"


# Without this, a Snakefile that only includes others builds nothing.
workflow.default_target = "all"


onstart:
    folders = dict.fromkeys([Path("results"), RESULTS, *MACHINES])
    refused = [str(path) for path in folders if path.exists() and not os.access(path, os.W_OK)]
    if refused:
        refuse(f"Nothing can be written to {', '.join(refused)}.")
    # Snakemake holds its lock: what is left is from a run that was killed.
    remove_leftovers(Path("results"))
    projects.record(MACHINES)
    # Its limit of 100 starts a second, needless on one machine, wakes the scheduler once a second
    # for every job that has run: after 150 jobs that is a quarter of a core.
    # Private to Snakemake: where it is called otherwise, the limit stays.
    if workflow.local_exec and hasattr(workflow.scheduler, "job_rate_limiter"):
        workflow.scheduler.job_rate_limiter = None


onsuccess:
    for folder in MACHINES:
        write_provenance(folder, workflow.basedir)
