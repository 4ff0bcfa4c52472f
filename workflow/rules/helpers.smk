"""The checked configuration, and functions that name the files and parameters of rules.

`CONFIG` is the typed configuration. `config` holds the same as plain values with sorted keys for
params, whose texts Snakemake compares: order and spelling of numbers (2 or 2.0) rerun nothing.
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
#: The folder of the library, another one where both are installed.
LIBRARY = Path(gearlib.__file__).parents[1]

#: Parts of the report, whose menu has alphabetical order.
PAPER, CLAIMS = "1 The paper's figures", "2 The paper's statements"
EXPLANATIONS, METHODS = "3 Explanations", "4 Methods"
TRAINS, DRAWN = "5 Gear trains", "6 From the drawing"
MEASURED, TOLERANCES = "7 Measured", "8 Tolerances"

#: Formats of a figure, of which the report shows the first that is drawn.
REPORT_FORMATS = ["png", "svg", "pdf"]

#: Keys of sections: a grid of tunings, and seeded starts.
GRID = ["start", "stop", "step"]
STARTS = ["starts", "first_starts", "seed", "spread"]

#: Priority of long jobs, which start first.
LONG = 1
#: More threads than any machine has: Snakemake gives the job all cores.
ALONE = 1024

# Jobs share compiled Python files.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Scripts import the library beside this Snakefile.
os.environ.update(
    PYTHONPATH=os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
)


def raise_any(sentences):
    """Raise a ValueError with these sentences, if there are any."""
    if sentences:
        raise ValueError("\n".join(sentences))


def check_numbers(checked):
    """Check measured tables and laws of tolerances, which need numpy or scipy."""
    if checked.measured:
        from gearlib.uncertainty.measured import refused

        raise_any(refused(checked.measured))
    if checked.tolerances.needs_scipy() and not targets.refusal("tolerances", checked):
        from gearlib.uncertainty import distributions

        laws, keys = checked.tolerance_laws(), checked.tolerances.keys()
        distributions.read(laws, known_parameters(), keys=keys)


def checked_configuration():
    """Return the configuration after all checks that need no job, or end with a sentence."""
    replaced = workflow.config_settings.replace_workflow_config
    files = workflow.overwrite_configfiles if replaced else workflow.configfiles
    try:
        raise_any([sentence for path in files for sentence in yaml_keys.read(path)[1]])
        checked = configuration.load(config)
        raise_any([*checked.refusals(), *checked.missing_train_damping()])
        if workflow.is_main_process:
            check_numbers(checked)
        return checked
    except ValueError as error:
        refuse(f"The configuration is refused.\n{error}")


def canonical(value):
    """Return a value as plain values with sorted keys."""
    return json.loads(json.dumps(value, sort_keys=True))


CONFIG = checked_configuration()
#: Targets of a call that names none.
WANTED = CONFIG.computed_targets()
# Rules and captions of the report find defaults as well.
config.update(canonical(CONFIG.model_dump()))


# Parts of the configuration as plain values.


def without(section, *keys):
    """Return a section without some of its keys."""
    return {key: value for key, value in section.items() if key not in keys}


def pick(section, *keys):
    """Return a section with these keys only."""
    return {key: value for key, value in section.items() if key in keys}


def grid(section, step="step"):
    """Return the tunings of a section."""
    return tunings.grid(section["start"], section["stop"], section[step])


def global_cases(section):
    """Return the cases of basins or Poincare sections, with the parameters of their gear pairs."""
    return canonical(
        [
            {
                **case.model_dump(exclude={"damping", "change"}),
                "pair": CONFIG.case_parameters(case),
            }
            for case in section.cases
        ]
    )


#: Damping -> parameters of the gear pair with it.
PAIRS = canonical({damping: CONFIG.pair_parameters(damping) for damping in CONFIG.dampings})
SIX_DEGREES = canonical(CONFIG.six_degree_parameters())
GEAR_PAIR = gear_names.of_pair(CONFIG)
#: Arguments that `sweep` and `simulate` share; the same with samples for `simulate`.
RUN = {
    "initial_state": [
        config["run"]["initial_state"][name] for name in ("displacement", "velocity")
    ],
    "periods": CONFIG.periods,
    "record_periods": CONFIG.record_periods,
}
SAMPLED_RUN = RUN | {"samples_per_period": config["run"]["samples_per_period"]}
COLOURS = {"colours": config["figures"]["colours"]}


# Files.


def sources_of(script, *modules, methods=()):
    """Return the file that lists the sources of a script: its imports, these modules and methods."""
    names = [f"gearlib.{module}" for module in modules]
    names += [f"gearlib.integrators.{integrators.METHODS.data[method]}" for method in methods]
    path = ROOT / "workflow" / "scripts" / f"{script}.py"
    return listed(path, sources(path, LIBRARY, names))


def sources_by_method(script, module):
    """Return method -> file that lists the sources of a job that runs it.

    Snakemake looks for files once, so that all lists are written before.
    """
    return {name: sources_of(script, module, methods=[name]) for name in integrators.METHODS.data}


def per_damping(pattern):
    """Return the files of a pattern, one for each damping."""
    return expand(pattern, damping=CONFIG.dampings)


def figure_files(name, label, part, caption=None):
    """Return the files of a figure, one for each format, of which the report shows one.

    `label` is a text or a function of wildcards; `caption` is the name of a file in
    `workflow/report`, by default that of the figure. Figures of other gears than the paper's have
    no numbers of its figures.
    """
    caption = caption or name
    labels = {"figure": label}
    if callable(label):
        labels = lambda wildcards: {"figure": label(wildcards)}
    elif not gear_names.is_paper(CONFIG):
        labels = {"figure": re.sub(r"^(Beside )?Fig. \d+: ", "", label)}
    if not gear_names.is_paper(CONFIG):
        name = re.sub(r"^fig\d+_", "", name)
    shown = min(CONFIG.figures.formats, key=REPORT_FORMATS.index)
    about = dict(caption=f"../report/{caption}.rst", category=part, labels=labels)
    files = {form: f"results/figures/{name}.{form}" for form in CONFIG.figures.formats}
    return [report(path, **about) if form == shown else path for form, path in files.items()]


def table_page(name, label, part):
    """Return the HTML page of a table for the report; browsers do not show CSV."""
    return report(
        f"results/tables/{name}.html",
        caption=f"../report/{name}_table.rst",
        category=part,
        labels={"figure": label},
    )


def target_files(target, *files):
    """Return the files of a target, or an input function that refuses it for these gears."""
    reason = targets.refusal(target, CONFIG)
    if target in targets.TRAIN_TARGETS:
        reason = reason or targets.undamped(CONFIG)
    if not reason:
        return list(files)
    sentence = f"The configuration is refused.\n{targets.for_targets(reason, target)}"
    return lambda wildcards: refuse(sentence)


def if_wanted(target, files):
    """Return files that a figure shows if their target is wanted too, else none."""
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
    """Return observables, tolerance and candidates of the comparison of models for a scene."""
    scene = config["scenes"][wildcards.scene]
    candidates = CONFIG.candidate_models(CONFIG.scenes[wildcards.scene])
    return pick(scene, "observables", "tolerance") | {"candidates": candidates}


def label_of_scene(wildcards):
    """Return the label of a scene in the report: its name with spaces, and its dampings."""
    title = re.sub(r"^fig(\d+)_", r"Fig. \1: ", wildcards.scene).replace("_", " ")
    dampings = dict.fromkeys(case["damping"] for case in config["scenes"][wildcards.scene]["cases"])
    return f"{title}, damping {', '.join(dampings)}"


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


def not_installed(methods):
    """Return the methods whose packages are not installed."""
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
    """Return the arguments of the study of tolerances that describe a design."""
    section, laws = CONFIG.tolerances, {}
    if not targets.refusal("tolerances", CONFIG):
        laws = CONFIG.tolerance_laws()
    drawn = section.of_drawing() and CONFIG.gears
    return canonical(
        {
            "pair": CONFIG.pair_parameters(section.damping),
            "tolerances": laws,
            "seed": section.seed,
            "quantities": section.quantities,
            **({"drawing": CONFIG.gears.described()} if drawn else {}),
        }
    )


DESIGNS = designs()


#: Texts and facts that captions cannot find in the configuration.
config["captions"] = {
    "dampings": ", ".join(CONFIG.dampings),
    "drawn": CONFIG.gears is not None,
    "paper": gear_names.is_paper(CONFIG),
    "forces": force_note(CONFIG.gear_pair.stiffness_ratio) if CONFIG.gears else "",
    "own_train": targets.has_own_train(CONFIG),
    "missing": ", ".join(not_installed(CONFIG.work_precision.methods)),
    "stiffness_pairs": " and ".join(drawn_pairs(CONFIG, "mesh_stiffness")),
    "reliefs_left_out": bool(
        CONFIG.gears
        and CONFIG.gears.modification_key()
        and takes_configured_gears(CONFIG, "mesh_stiffness")
    ),
    "design_torque": next(iter(drawn_pairs(CONFIG, "harris_map").values())).torque,
}
