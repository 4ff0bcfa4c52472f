"""Several cases of the configuration side by side: the whole workflow once for each."""

from gearlib import config as configuration
from gearlib.config.configuration import TARGETS
from workflow.refusal import refuse

try:
    CASES = configuration.cases(config)
except configuration.ConfigError as error:
    refuse(f"The configuration is refused.\n{error}")


for case, settings in CASES.items():
    # Also what the names of its rules begin with.
    case_ = f"{case}_"

    module:
        name: case_
        snakefile:
            "Snakefile"
        config:
            settings
        replace_prefix:
            {"results/": f"{RESULTS}/{case}/"}

    use rule * from case_ as case_*


def of_all_cases(target):
    """Return the files of a target, of all cases."""
    return [getattr(rules, f"{case}_{target}").input for case in CASES]


rule all:
    input:
        of_all_cases("all"),


for target in TARGETS:

    rule:
        name:
            target
        input:
            of_all_cases(target),


rule paper:
    input:
        of_all_cases("paper"),
