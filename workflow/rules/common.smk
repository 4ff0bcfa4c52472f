"""What the rules share: the checked configuration, and names of files and parameters.

Rules see the configuration through these functions only: a job's `params` hold exactly the
values that it uses, with sorted keys, so that order and spelling of numbers in config.yaml (2 or
2.0) rerun nothing.
"""

import json
import os
import re
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import gearlib
from gearlib import config as configuration
from gearlib import integrators
from gearlib.config import yaml_keys
from gearlib.config.studies import STUDIES
from gearlib.config.studies.of_trains import undamped
from gearlib.config.studies.study import for_targets, pairs_of, run_length, text_of
from gearlib.config.tolerances_section import known_parameters
from workflow.refusal import refuse
from workflow.sources import listed, sources

ROOT = Path(workflow.basedir)
#: The folder of the library: the same, but where both are installed.
LIBRARY = Path(gearlib.__file__).parents[1]

#: Fig. 2 to 8 and the table of statements.
PAPER_TARGETS = ["phase_lag", "resonance", "phase_planes", "scenes", "jump", "claims"]

#: What the report shows of a figure, the first that there is; browsers zoom pixels best.
SHOWN_FORMATS = ["png", "svg", "pdf"]
#: Captions of the first figure of a rule, and of a second one: they find their texts by its outputs.
CAPTION_FILES = ["../report/figure.rst", "../report/last_figure.rst"]

# What a first job has to compile is kept for all others, also where Python is told to keep nothing.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Scripts import the library beside this Snakefile, whatever else is installed.
os.environ.update(
    PYTHONPATH=os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
)

# With --replace-workflow-config that of the workflow itself is not read.
replacing = workflow.config_settings.replace_workflow_config
read = workflow.overwrite_configfiles if replacing else workflow.configfiles
repeated = [text for path in read for text in yaml_keys.read(path)[1]]
try:
    if repeated:
        raise configuration.ConfigError("\n".join(repeated))
    CONFIG = configuration.load(config)
    if refused := [*CONFIG.refused(), *CONFIG.without_damping()]:
        raise configuration.ConfigError("\n".join(refused))
    if workflow.is_main_process and CONFIG.measured:
        # The tables as well, before any job runs; they cost numpy.
        from gearlib.uncertainty.measured import refused as refused_tables

        if refused := refused_tables(CONFIG.measured):
            raise configuration.ConfigError("\n".join(refused))
    if workflow.is_main_process and CONFIG.tolerances.needs_scipy():
        # So do laws of scipy and correlations.
        from gearlib.config.studies.of_tolerances import question
        from gearlib.uncertainty import distributions

        laws, section = question(CONFIG)["tolerances"], CONFIG.tolerances
        try:
            laws and distributions.read(laws, known_parameters(), keys=section.keys())
        except ValueError as error:
            raise configuration.ConfigError(str(error)) from None
    # Captions of the report read this, and find what the configuration leaves out as well.
    config.update(CONFIG.model_dump())
except configuration.ConfigError as error:
    refuse(f"The configuration is refused.\n{error}")


wildcard_constraints:
    damping=r"[A-Za-z0-9+_-]+",
    direction="cold|up|down",
    window=r"\d+\.\d+-\d+\.\d+",
    tuning=r"\d+\.\d+",
    samples=r"\d+-\d+",
    scene=r"[A-Za-z0-9+_-]+",
    method=r"[a-z0-9_]+",
    place="material|oil",
    power="linear|quadratic|cubic",
    trial=r"[A-Za-z0-9+_-]+",
    measured=r"[A-Za-z0-9+_-]+",


def script_sources(name, *methods, loaded=()):
    """Return the list of the source files on which the results of a script depend.

    It is told to run these methods, and to load these modules; of those that are always loaded a
    script says so itself, see `workflow.sources`.
    """
    methods = [f"gearlib.integrators.{integrators.METHODS.data[method]}" for method in methods]
    script = ROOT / "workflow" / "scripts" / f"{name}.py"
    return listed(script, sources(script, LIBRARY, [*methods, *loaded]))


def result(path):
    """Return the path of a result; None where it is not asked for."""
    return path and os.path.join("results", path)


def canonical(value):
    """Return a value as it stands in `params`: Snakemake compares texts, in which order counts."""
    if callable(value):
        return lambda wildcards: canonical(value(wildcards))
    return json.loads(json.dumps(value, sort_keys=True))


def inputs_of(data):
    """Return name -> file, or files, of the datasets of a job."""
    found = {}
    for name, files in data.items():
        files = files(CONFIG) if callable(files) else files
        if files is not None:
            one = isinstance(files, str)
            found[name] = result(files) if one else [*map(result, files)]
    return found


def figure_files(name):
    """Return the files of one figure, one for each format."""
    return [f"results/figures/{name}.{form}" for form in CONFIG.figures.formats]


def figure(name, label, part, caption):
    """Return the files of one figure, of which one is shown in the report.

    One label only: of two, where a part has two results, the report makes a switch that breaks.
    """
    shown = f".{min(CONFIG.figures.formats, key=SHOWN_FORMATS.index)}"
    label = partial(label, CONFIG) if callable(label) else label
    labels = {"figure": label}
    if callable(label):
        labels = lambda wildcards: {"figure": label(wildcards)}
    in_report = dict(caption=caption, category=part, labels=labels)
    files = figure_files(name)
    return [report(path, **in_report) if path.endswith(shown) else path for path in files]


def table_page(study, table):
    """Return the page of a table, for the report: browsers do not show CSV."""
    return report(
        f"results/tables/{table.name}.html",
        caption="../report/table.rst",
        category=study.part,
        labels={"figure": table.label},
    )


def page_of(name):
    """Return the page of the only table of a study whose rule has a script of its own."""
    return table_page(STUDIES[name], STUDIES[name].tables[0])


def names_of(drawing):
    """Return the names of all figures of a drawing."""
    names = list(drawing.figures)
    for wildcard, values in drawing.names(CONFIG).items():
        names = [name.replace(f"{{{wildcard}}}", value) for name in names for value in values]
    return names


def target_files(targets):
    """Return the files of targets of the configuration."""
    found = []
    for study in (STUDIES[name] for name in targets if STUDIES[name].needs(CONFIG)):
        for drawing in filter(lambda one: one.wanted(CONFIG), study.drawings):
            found += [path for name in names_of(drawing) for path in figure_files(name)]
        found += [f"results/{table.name}.csv" for table in study.tables]
        found += map(result, study.results(CONFIG))
    return found


def files_asked_by_name(study):
    """Return the files of a study; where it cannot be about these gears, what says so if asked."""
    words = study.refusal(CONFIG)
    if study.name in configuration.OF_ANY_TRAIN:
        words = words or undamped(CONFIG)
    if not words:
        return target_files([study.name])
    words = f"The configuration is refused.\n{for_targets(words, study.name)}"
    return lambda wildcards: refuse(words)


def captions():
    """Return the captions of all figures and tables, by their names, for the report."""
    found = {"figures": {}, "tables": {}}
    for study in STUDIES.values():
        gears = f"Gears: {study.gears(CONFIG)}."
        for table in study.tables:
            found["tables"][table.name] = f"{text_of(table.caption, CONFIG)} {gears}"
        for drawing in study.drawings:
            wildcards = drawing.names(CONFIG)
            for name, (_, caption) in drawing.figures.items():
                text = f"{text_of(caption, CONFIG)} {gears}"
                found["figures"][name] = text
                for wildcard, values in wildcards.items():
                    for value in values:
                        own = f"{{{wildcard}}}"
                        found["figures"][name.replace(own, value)] = text.replace(own, value)
    return found


config["captions"] = captions()
