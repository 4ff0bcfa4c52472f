"""The workflow: all targets of the configuration by one command, `snakemake -j2`.

Each of `cases` lays its keys over the others, and its results go to results/<case>/. Results of a
project with a name go to results/<project>/.
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
from gearlib.removed import REMOVED, removal_message
from workflow import projects
from workflow.provenance import write as write_provenance
from workflow.checksums import foreign, replaced
from workflow.refusal import interrupted, refuse, unknown_target

min_version("9.12")

# All jobs read this file, also on other nodes; before anything loads numpy.
os.environ.update(processor.settings())

# Jobs and files are many objects that stay: collecting garbage takes a fifth of a start.
gc.set_threshold(200_000)

# Ctrl-C prints a sentence while Snakemake plans, and ends a job at once.
sys.excepthook = interrupted
shell.prefix("set -eu; trap 'kill $! 2>/dev/null' INT TERM;")
shell.suffix("& wait $!")

#: Options of calls that compute nothing, beside a dry run.
NO_JOBS = {"--unlock", "--lint", "--dag", "--rulegraph", "--filegraph", "--summary", "--list-rules"}

# The configuration of this folder, else that of the installed package.
CONFIG_FILE = "config.yaml"
if not Path(CONFIG_FILE).exists():
    CONFIG_FILE = Path(workflow.basedir, "config.yaml")
try:
    BASE = yaml_keys.read(CONFIG_FILE)[0]
except ValueError as error:
    refuse(error)


configfile: CONFIG_FILE


given = workflow.config_settings.overwrite_config
if given:
    # Snakemake has merged the files, unless they replace the configuration of this folder.
    replaced_base = workflow.config_settings.replace_workflow_config
    chosen = configuration.overlay_gears(config if replaced_base else BASE, given)
    config.clear()
    config.update(chosen)

NAME = projects.name_of(config, BASE, given, workflow.overwrite_configfiles)
if NAME:
    config["project"] = NAME
# A name that is no text is refused below.
RESULTS = Path("results", str(NAME))
# Before rules add defaults to the configuration.
MACHINES = projects.machines(RESULTS, config)

# The process that sends jobs to other nodes has checked this for them.
if workflow.is_main_process:
    fault = ""
    if paths := foreign(Path("results")):
        fault = (
            f"No record says how these were made, {len(paths)} in all: {paths[0]} ... They "
            "come from another folder, or .snakemake was removed. Remove results/, or bring the "
            ".snakemake that belongs to it."
        )
    elif paths := replaced(Path("results")):
        names = " ".join(map(str, paths))
        fault = (
            f"Not what their jobs wrote: {names}. To have them computed anew, remove them and "
            f"call snakemake -j2 {names}"
        )
    elif sentences := projects.of_others(MACHINES):
        fault = "\n".join(sentences)
    if fault and (workflow.output_settings.dryrun or NO_JOBS & set(sys.argv)):
        logger.warning(fault)
    elif fault:
        refuse(fault)
    for argument in sys.argv[1:]:
        if argument in REMOVED:
            refuse(removal_message(argument))


if "cases" in config:

    include: "workflow/cases.smk"

elif NAME:

    include: "workflow/project.smk"

else:

    include: "workflow/Snakefile"


include: "workflow/compare.smk"


rule _unknown_target:
    input:
        lambda wildcards: refuse(unknown_target(wildcards.target, workflow.rules)),
    output:
        r"{target,[A-Za-z]\w*}",


# Without this, a Snakefile that only includes others builds nothing.
workflow.default_target = "all"


onstart:
    folders = dict.fromkeys([Path("results"), RESULTS, *MACHINES])
    read_only = [
        str(path) for path in folders if path.exists() and not os.access(path, os.W_OK)
    ]
    if read_only:
        refuse(f"Nothing can be written to {', '.join(read_only)}.")
    # Snakemake holds its lock, so that temporary files are those of a run that was killed.
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
