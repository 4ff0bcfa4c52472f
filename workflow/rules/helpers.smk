"""The checked configuration, and functions that name files and parameters of the rules.

`CONFIG` is the typed configuration, for functions; `config` holds the same as plain values with
sorted keys, for params: Snakemake compares their texts, so that order and spelling of numbers in
config.yaml (2 or 2.0) rerun nothing. A job's params hold exactly the values that it uses.
"""

import json
import os
import re
from importlib.util import find_spec
from pathlib import Path

import gearlib
from gearlib import config as configuration
from gearlib import integrators, tunings
from gearlib.config import gear_names, measured_description, targets, yaml_keys
from gearlib.config.gears_section import drawn_pairs, takes_configured_gears
from gearlib.config.tolerances_section import known_parameters
from gearlib.engines.pair.stiffness import force_note
from workflow.refusal import refuse
from workflow.sources import listed, sources

ROOT = Path(workflow.basedir)
#: The folder of the library: the same, but where both are installed.
LIBRARY = Path(gearlib.__file__).parents[1]

#: Parts of the report, numbered because its menu is in the order of the alphabet.
PAPER, CLAIMS = "1 The paper's figures", "2 The paper's statements"
EXPLANATIONS, METHODS = "3 Explanations", "4 Methods"
TRAINS, DRAWN = "5 Gear trains", "6 From the drawing"
MEASURED, TOLERANCES = "7 Measured", "8 Tolerances"

#: What the report shows of a figure, the first that there is; browsers zoom pixels best.
SHOWN_FORMATS = ["png", "svg", "pdf"]

#: Keys of a grid of tunings, and of the seeded starts of every motion.
GRID = ["start", "stop", "step"]
STARTS = ["starts", "first_starts", "seed", "spread"]

#: Priority of jobs that take long: at the end of a build none of them runs alone.
LONG = 1
#: More threads than there are: Snakemake gives such a job all cores, and runs none beside it.
ALONE = 1024

# What a first job has to compile is kept for all others, also where Python is told to keep nothing.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Scripts import the library beside this Snakefile, whatever else is installed.
os.environ.update(
    PYTHONPATH=os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
)


def checked_configuration():
    """Return the configuration after all checks that need no job; refuse it in sentences."""
    # With --replace-workflow-config that of the workflow itself is not read.
    replacing = workflow.config_settings.replace_workflow_config
    read = workflow.overwrite_configfiles if replacing else workflow.configfiles
    try:
        if repeated := [text for path in read for text in yaml_keys.read(path)[1]]:
            raise ValueError("\n".join(repeated))
        checked = configuration.load(config)
        if refused := [*checked.refused(), *checked.without_damping()]:
            raise ValueError("\n".join(refused))
        if workflow.is_main_process and checked.measured:
            # The tables as well, before any job runs; they cost numpy.
            from gearlib.uncertainty.measured import refused as refused_tables

            if refused := refused_tables(checked.measured):
                raise ValueError("\n".join(refused))
        section = checked.tolerances
        if workflow.is_main_process and section.needs_scipy():
            # So do laws of scipy and correlations.
            from gearlib.uncertainty import distributions

            if not targets.refusal("tolerances", checked):
                laws = checked.tolerance_laws()
                distributions.read(laws, known_parameters(), keys=section.keys())
        return checked
    except ValueError as error:
        refuse(f"The configuration is refused.\n{error}")


def canonical(value):
    """Return a value as plain values with sorted keys."""
    return json.loads(json.dumps(value, sort_keys=True))


CONFIG = checked_configuration()
#: Targets of a call that names none.
WANTED = CONFIG.wanted()
# Captions of the report read this too, and find what the configuration leaves out as well.
config.update(canonical(CONFIG.model_dump()))


# Parts of the configuration, as plain values.


def without(section, *keys):
    """Return a section without some of its keys."""
    return {key: value for key, value in section.items() if key not in keys}


def only(section, *keys):
    """Return those of some keys that a section has."""
    return {key: value for key, value in section.items() if key in keys}


def grid(section, step="step"):
    """Return the tunings of a section."""
    return tunings.grid(section["start"], section["stop"], section[step])


def global_cases(section):
    """Return the cases of basins or Poincare sections, with the parameters of their gear pairs."""
    return canonical(
        [
            case.model_dump(exclude={"damping", "change"})
            | {"pair": CONFIG.global_parameters(case)}
            for case in section.cases
        ]
    )


#: Damping -> parameters of the gear pair with it.
PAIRS = canonical({damping: CONFIG.pair_parameters(damping) for damping in CONFIG.dampings})
SIX_DEGREES = canonical(CONFIG.six_degree_parameters())
GEAR_PAIR = gear_names.of_pair(CONFIG)
#: Arguments that `sweep` and `simulate` share; those of runs with samples.
RUN = {
    "initial_state": [
        config["run"]["initial_state"]["displacement"],
        config["run"]["initial_state"]["velocity"],
    ],
    "periods": CONFIG.periods,
    "record_periods": CONFIG.record_periods,
}
SAMPLED_RUN = RUN | {"samples_per_period": config["run"]["samples_per_period"]}
COLOURS = {"colours": config["figures"]["colours"]}


# Files.


def sources_of(script, *modules, methods=()):
    """Return the list of the source files on which the results of a script depend.

    It loads these modules of the library, and these methods; those that it always loads it imports,
    see `workflow.sources`.
    """
    names = [f"gearlib.{module}" for module in modules]
    names += [f"gearlib.integrators.{integrators.METHODS.data[method]}" for method in methods]
    path = ROOT / "workflow" / "scripts" / f"{script}.py"
    return listed(path, sources(path, LIBRARY, names))


def sources_by_method(script, module):
    """Return method -> list of the source files of a job that runs this method."""
    # All of them now: what is written later is not there for Snakemake, which looks once.
    return {name: sources_of(script, module, methods=[name]) for name in integrators.METHODS.data}


def of_dampings(pattern):
    """Return a file for each damping."""
    return expand(pattern, damping=CONFIG.dampings)


def figure_of(name, label, part, caption=None):
    """Return the files of a figure, one for each format, of which the report shows one.

    Its caption is the file of the same name in `workflow/report`. Figures of other gears than the
    paper's do without the numbers of its figures.
    """
    caption = caption or name
    if not gear_names.is_paper(CONFIG):
        name = re.sub(r"^fig\d+_", "", name)
        label = label if callable(label) else re.sub(r"^(Beside )?Fig. \d+: ", "", label)
    shown = f".{min(CONFIG.figures.formats, key=SHOWN_FORMATS.index)}"
    labels = {"figure": label}
    if callable(label):
        labels = lambda wildcards: {"figure": label(wildcards)}
    in_report = dict(caption=f"../report/{caption}.rst", category=part, labels=labels)
    files = [f"results/figures/{name}.{form}" for form in CONFIG.figures.formats]
    return [report(path, **in_report) if path.endswith(shown) else path for path in files]


def page_of(name, label, part):
    """Return the page of a table, for the report: browsers do not show CSV."""
    return report(
        f"results/tables/{name}.html",
        caption=f"../report/{name}_table.rst",
        category=part,
        labels={"figure": label},
    )


def asked(target, *files):
    """Return the files of a target; if it cannot be about these gears, a function that refuses."""
    words = targets.refusal(target, CONFIG)
    if target in targets.OF_ANY_TRAIN:
        words = words or targets.undamped(CONFIG)
    if not words:
        return list(files)
    words = f"The configuration is refused.\n{targets.for_targets(words, target)}"
    return lambda wildcards: refuse(words)


def beside(target, files):
    """Return files that a figure shows if the configuration asks for their target, else none."""
    return files if target in WANTED else []


# Scenes and measured sets.


def cases_of_scene(wildcards):
    """Return the cases of a scene, with the parameters of their gear pairs."""
    return canonical(
        [
            {"title": case.title, "tuning": case.tuning, "pair": CONFIG.case_parameters(case)}
            for case in CONFIG.scenes[wildcards.scene].cases
        ]
    )


def question_of_scene(wildcards):
    """Return what the comparison of models asks of a scene."""
    scene = config["scenes"][wildcards.scene]
    candidates = CONFIG.candidates(CONFIG.scenes[wildcards.scene])
    return only(scene, "observables", "tolerance") | {"candidates": candidates}


def label_of_scene(wildcards):
    """Return the label of a scene in the report: its name in words, its dampings."""
    words = re.sub(r"^fig(\d+)_", r"Fig. \1: ", wildcards.scene).replace("_", " ")
    dampings = dict.fromkeys(case["damping"] for case in config["scenes"][wildcards.scene]["cases"])
    return f"{words}, damping {', '.join(dampings)}"


#: Name -> its YAML file, and its description.
MEASURED_SETS = measured_description.sets(CONFIG.measured)


def files_of_set(wildcards):
    """Return the files of a measured set: its description and its tables."""
    path, description = MEASURED_SETS[wildcards.measured]
    return [path, *description.files(path)]


def path_of_set(wildcards):
    """Return the YAML file of a measured set."""
    return MEASURED_SETS[wildcards.measured][0]


# Methods, drawings, designs.


def missing(methods):
    """Return the methods that are left out because their packages are not installed."""
    return [name for name in dict.fromkeys(methods) if not targets.installed(name)]


def drawings(section):
    """Return name -> drawing of the gears that a section is about."""
    pairs = drawn_pairs(CONFIG, section)
    return canonical({name: pair.model_dump() for name, pair in pairs.items()})


def names_of_drawings(section):
    """Return the names of the gears that a section is about."""
    pairs = drawn_pairs(CONFIG, section).values()
    return " and ".join(dict.fromkeys(map(gear_names.of_drawing, pairs)))


def designs():
    """Return what the study of tolerances asks of a design."""
    section = CONFIG.tolerances
    refused = targets.refusal("tolerances", CONFIG)
    found = {
        "pair": CONFIG.pair_parameters(section.damping),
        "tolerances": {} if refused else CONFIG.tolerance_laws(),
        "seed": section.seed,
        "quantities": section.quantities,
    }
    if section.of_drawing() and CONFIG.gears:
        found["drawing"] = CONFIG.gears.described()
    return canonical(found)


DESIGNS = designs()


#: Words of captions that templates cannot make themselves.
config["captions"] = {
    "dampings": ", ".join(CONFIG.dampings),
    "drawn": CONFIG.gears is not None,
    "paper": gear_names.is_paper(CONFIG),
    "forces": force_note(CONFIG.gear_pair.stiffness_ratio) if CONFIG.gears else "",
    "own_train": targets.has_own_train(CONFIG),
    "missing": ", ".join(missing(CONFIG.work_precision.methods)),
    "stiffness_pairs": " and ".join(drawn_pairs(CONFIG, "mesh_stiffness")),
    "reliefs_left_out": bool(
        CONFIG.gears and CONFIG.gears.relief() and takes_configured_gears(CONFIG, "mesh_stiffness")
    ),
    "design_torque": next(iter(drawn_pairs(CONFIG, "harris_map").values())).torque,
}
