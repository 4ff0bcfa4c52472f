"""Check the configuration, and define functions for the files and parameters of rules.

`CONFIG` is the typed configuration. `config` has the same values as plain types with sorted keys.
Snakemake compares params as text, so the order of keys and the format of numbers (2 or 2.0) in the
file cause no reruns.
"""

import json
import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path

from snakemake.logging import logger
from gearlib import checks
from gearlib import config as configuration
from gearlib import integrators, processor, tunings
from gearlib.config import gear_names, measured_description, targets, validation
from gearlib.config.gears_section import stage_sections, uses_configured_gears
from gearlib.config.tolerances_section import known_parameters
from gearlib.models.geometry.iso import METHOD_NAMES
from workflow.records import mark_changed
from workflow.sources import listed, sources

ROOT = Path(workflow.basedir)

#: Parts of the report, with numbers because its menu is in alphabetical order.
CLAIMS, EXPLANATIONS, METHODS = "2 The paper's statements", "3 Explanations", "4 Methods"
TRAINS, GEOMETRY = "5 Gear trains", "6 From the geometry"
MEASURED, TOLERANCES, GEARBOX = "7 Measured", "8 Tolerances", "9 Gearbox"

#: Keys in sections of the configuration: of a grid of tunings, and of seeded initial states.
GRID = ["start", "stop", "step"]
STARTS = ["starts", "first_starts", "seed", "spread"]

#: Priority of long jobs, which start before others.
LONG = 1
#: Number of threads above that of any machine, so that Snakemake gives the job all cores.
ALL_CORES = 1024

# All jobs read this file, also on other nodes, before they load numpy.
os.environ.update(processor.environment_variables())
# Jobs share compiled Python files, which this variable would prevent.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Scripts import the library beside this Snakefile.
os.environ.update(
    PYTHONPATH=os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
)


def refuse(sentence):
    """Log an error message and exit without the traceback that Snakemake prints for exceptions."""
    logger.error(str(sentence))
    sys.exit(2)


def raise_errors(messages):
    """Raise a ValueError with the given messages, if there are any."""
    if messages:
        raise ValueError("\n".join(messages))


def check_tables_and_distributions(checked):
    """Check measured tables and distributions of tolerances, which require numpy or scipy."""
    if checked.measured:
        from gearlib.uncertainty.measured import read_errors

        raise_errors(read_errors(checked.measured))
    if checked.tolerances.needs_scipy() and not targets.refusal_reason("tolerances", checked):
        from gearlib.uncertainty import distributions

        keys = checked.tolerances.config_keys().items()
        with checks.prefix_error_paths("", **{f"tolerances.{name}": key for name, key in keys}):
            distributions.read_tolerances(checked.tolerance_distributions(), known_parameters())


def checked_configuration(changes):
    """Read and check the configuration; return it as a typed object, or exit with an error message.

    It is read from config.yaml in the working directory, else from the file of the paper's gears;
    `changes` are the values on the command line.
    """
    base = Path("config.yaml") if Path("config.yaml").exists() else ROOT / "config.yaml"
    try:
        contents = [validation.read_yaml(path) for path in (base, *workflow.overwrite_configfiles)]
        raise_errors([message for _, repeated in contents for message in repeated])
        checked = configuration.load(configuration.overlay_gears(contents[0][0], changes))
        raise_errors([*checked.target_errors(), *checked.train_damping_errors()])
        if workflow.is_main_process:
            check_tables_and_distributions(checked)
        return checked
    except ValueError as error:
        refuse(f"The configuration is refused.\n{error}")


def canonical(value):
    """Return a value in plain JSON types with sorted keys."""
    return json.loads(json.dumps(value, sort_keys=True))


# Before the file is read, `config` has the values on the command line.
CONFIG = checked_configuration(dict(config))
IS_PAPER = gear_names.is_paper(CONFIG)
PAPER = "1 The paper's figures" if IS_PAPER else "1 The gears and their motions"
#: Targets that are computed if the command line names none.
WANTED = CONFIG.computed_targets()
# Rules and captions need the defaults, too.
config.clear()
config.update(canonical(CONFIG.model_dump()))

# Only the main process does this, also for the jobs that it sends to other nodes.
if workflow.is_main_process:
    mark_changed(Path("results"))


# Select parts of the configuration as plain values.


def without(section, *keys):
    """Return a section of the configuration without the given keys."""
    return {key: value for key, value in section.items() if key not in keys}


def pick(section, *keys):
    """Return only the given keys of a section of the configuration."""
    return {key: value for key, value in section.items() if key in keys}


def grid(section, step_key="step"):
    """Return the tunings of a section from start to stop, with the step in its key `step_key`."""
    return tunings.grid(section["start"], section["stop"], section[step_key])


def with_pairs(cases):
    """Return cases as plain values, with the parameters of a gear pair for damping and change."""
    values = []
    for case in cases:
        pair = CONFIG.pair(case.damping, case.change)
        values.append(case.model_dump(exclude={"damping", "change"}) | {"pair": pair})
    return canonical(values)


#: Damping -> description of the gear pair, and of the model of sweeps and run-ups.
PAIRS = canonical({damping: CONFIG.pair(damping) for damping in CONFIG.dampings})
MODELS = canonical({damping: CONFIG.model_description(damping) for damping in CONFIG.dampings})
UNDAMPED = canonical(CONFIG.pair())
SIX_DEGREES = canonical(CONFIG.six_degree_parameters())
#: Names of the gears with the rectangular stiffness, and with the model of sweeps and run-ups.
GEAR_PAIR = gear_names.gear_pair_name_with_stiffness(CONFIG, teeth=False)
GEARS = gear_names.gear_pair_name_with_stiffness(CONFIG, teeth=True)
#: Common arguments of `sweep` and `simulate`.
RUN = {
    "initial_state": [
        config["run"]["initial_state"][name] for name in ("displacement", "velocity")
    ],
    "periods": CONFIG.periods,
    "record_periods": CONFIG.record_periods,
}
#: The same for the model of sweeps; load-sharing pairs start in static equilibrium.
GEARS_RUN = dict(RUN)
if CONFIG.gears and "initial_state" not in CONFIG.run.model_fields_set:
    GEARS_RUN["initial_state"] = "static"
#: Arguments of `simulate` for time histories.
SAMPLES = {"samples_per_period": config["run"]["samples_per_period"]}
SAMPLED_RUN = RUN | SAMPLES
GEARS_SAMPLED_RUN = GEARS_RUN | SAMPLES
#: Sweeps of the load-sharing pair of gears given by geometry. Figures that need the rectangular
#: stiffness have a note about them.
TEETH_SWEEPS = ["results/resonance.nc"] if CONFIG.gears else []
COLOURS = {"colours": config["figures"]["colours"]}


# Files.


def sources_of(script, *modules, methods=()):
    """Return the file that lists the sources of a script, which is written if it has changed.

    The sources are the imports of the script, `modules` of gearlib, which it loads by name, and the
    integrators with the names `methods`.
    """
    names = [f"gearlib.{module}" for module in modules]
    names += [f"gearlib.integrators.{integrators.METHODS.data[method]}" for method in methods]
    path = ROOT / "workflow" / "scripts" / f"{script}.py"
    return listed(path, sources(path, names))


def sources_by_method(script, module, *references):
    """Return a dict of method -> file that lists the sources of a job that runs this method.

    The job also runs the methods `references`. All lists are written in advance, because Snakemake
    looks for files only once.
    """
    return {
        name: sources_of(script, module, methods=[name, *references])
        for name in integrators.METHODS.data
    }


def per_damping(pattern):
    """Return the file names of all dampings; `pattern` contains "{damping}"."""
    return expand(pattern, damping=CONFIG.dampings)


def figure_files(name, label, part, caption=None):
    """Return the files of a figure, one for each format, of which the report shows one.

    `label` is a text, or a function of wildcards that returns labels; `part` is the part of the
    report; `caption` is the name of a file in `workflow/report`, by default the name of the figure.
    Numbers of the paper's figures are removed from names and labels of other gears.
    """
    caption = caption or name
    if not IS_PAPER:
        name = re.sub(r"^fig\d+_", "", name)
        if not callable(label):
            label = re.sub(r"^(Beside )?Fig. \d+: ", "", label)
    labels = label if callable(label) else {"figure": label}
    report_format = min(CONFIG.figures.formats, key=["png", "svg", "pdf"].index)
    options = {"caption": f"../report/{caption}.rst", "category": part, "labels": labels}
    files = []
    for suffix in CONFIG.figures.formats:
        path = f"results/figures/{name}.{suffix}"
        files.append(report(path, **options) if suffix == report_format else path)
    return files


def table_files(name, label, part):
    """Return the files of a table: "csv", and "page", a page for the report.

    `label` is its label and `part` its part in the report.
    """
    labels = {"figure": label}
    page = f"results/tables/{name}.html"
    caption = f"../report/{name}_table.rst"
    return {
        "csv": f"results/{name}.csv",
        "page": report(page, caption=caption, category=part, labels=labels),
    }


def target_files(target, *files):
    """Return the files of a target, or an input function that exits if it is refused.

    A target is refused if the configured gears do not allow it.
    """
    reason = targets.refusal_reason(target, CONFIG)
    if target in targets.TRAIN_TARGETS:
        reason = reason or targets.mesh_damping_error(CONFIG)
    if not reason:
        return list(files)
    message = f"The configuration is refused.\n{targets.append_target_names(reason, [target])}"
    return lambda wildcards: refuse(message)


def if_wanted(target, files, pairs_only=False):
    """Return files if their target is wanted, else an empty list.

    With `pairs_only`, files are left out for gears given by geometry, because their sweeps have
    another model, the load-sharing pair.
    """
    if target not in WANTED or (pairs_only and CONFIG.gears):
        return []
    return files


# Functions of wildcards for scenes and measured sets.


def cases_of_scene(wildcards):
    """Return the cases of a scene as plain values, with the parameters of their gear pairs."""
    return with_pairs(CONFIG.scenes[wildcards.scene].cases)


def criteria_of_scene(wildcards):
    """Return observables, tolerance and candidate models for the comparison of a scene."""
    scene = config["scenes"][wildcards.scene]
    candidates = CONFIG.candidate_models(CONFIG.scenes[wildcards.scene])
    return pick(scene, "observables", "tolerance") | {"candidates": candidates}


def label_of_scene(wildcards):
    """Return the labels of a scene in the report: its name with spaces, and its dampings."""
    number = r"Fig. \1: " if IS_PAPER else ""
    title = re.sub(r"^fig(\d+)_", number, wildcards.scene).replace("_", " ")
    dampings = dict.fromkeys(case["damping"] for case in config["scenes"][wildcards.scene]["cases"])
    return {"figure": f"{title}, damping {', '.join(dampings)}"}


#: Name of a measured set -> (YAML file, description).
MEASURED_SETS = measured_description.read_sets(CONFIG.measured)


def files_of_set(wildcards):
    """Return the files of a measured set: its description and its tables."""
    path, description = MEASURED_SETS[wildcards.measured]
    return [path, *description.table_paths(path)]


# Parameters of methods, gears and designs.


def jobs_of_gearbox():
    """Return (stage, load case) of the stages of a gearbox, and the load cases of the whole box.

    Both are empty unless the target gearbox is wanted.
    """
    if "gearbox" not in WANTED:
        return [], []
    from gearlib.studies.gearboxes import list_computations

    try:
        stages, boxes, _ = list_computations(CONFIG.gearbox.file)
    except (OSError, ValueError) as error:
        refuse(f"The configuration is refused.\ngearbox.file: {error}")
    return stages, boxes


def label_of_box(title):
    """Return a function of wildcards that returns the labels of a figure of the whole box."""
    return lambda wildcards: {"figure": f"{title}, load case {BOXES[int(wildcards.number)]}"}


def not_installed(methods):
    """Return those of the methods whose packages are not installed."""
    return [name for name in dict.fromkeys(methods) if not targets.is_installed(name)]


def stages(section):
    """Return the gears of a section of the configuration as plain values, by name."""
    pairs = stage_sections(CONFIG, section)
    return canonical({name: pair.model_dump() for name, pair in pairs.items()})


def names_of_stages(section, teeth=False):
    """Return a text with the names of the gears of a section for figures.

    With `teeth`, they are computed as load-sharing pairs, and the text names their stiffness.
    """
    pairs, suffix = stage_sections(CONFIG, section).values(), ""
    if teeth:
        method = config[section].get("stiffness")
        if not method and CONFIG.gears:
            method = CONFIG.gears.stiffness
        method = method or next(iter(pairs)).mesh().tooth_stiffness
        suffix = f"; pairs of teeth, {METHOD_NAMES[method]}"
    names = (gear_names.gear_stage_name(pair, teeth, pitch_errors=False) for pair in pairs)
    return " and ".join(dict.fromkeys(names)) + suffix


def teeth_over_speed():
    """Return the model and, if known, the operating speed for the target dynamic_factor."""
    if uses_configured_gears(CONFIG, "dynamic_factor"):
        return {"model": next(iter(MODELS.values())), "speed": CONFIG.gears.speed}
    gears = canonical(CONFIG.dynamic_factor.gears.model_dump())
    damping = {"damping_ratio": CONFIG.dynamic_factor.damping_ratio}
    return {"model": {"model": "teeth", "gears": gears, "damping": damping, "pitch_errors": False}}


#: Arguments of the target tolerances that describe the designs.
DESIGNS = canonical(
    {
        "pair": CONFIG.pair(CONFIG.tolerances.damping),
        "tolerances": (
            {} if targets.refusal_reason("tolerances", CONFIG) else CONFIG.tolerance_distributions()
        ),
        **pick(config["tolerances"], "seed", "quantities"),
    }
)
if CONFIG.tolerances.apply_to_geometry() and CONFIG.gears:
    DESIGNS["gears"] = canonical(CONFIG.gears.geometry_dict())

#: The gears of the Harris map.
HARRIS_PAIR = next(iter(stage_sections(CONFIG, "harris_map").values()))

#: Values for captions that the configuration does not contain.
config["captions"] = {
    "dampings": ", ".join(CONFIG.dampings),
    "geometry": CONFIG.gears is not None,
    "paper": IS_PAPER,
    "forces": CONFIG.gear_pair.force_note if CONFIG.gears else "",
    # The model of sweeps and run-ups.
    "model": (
        f"Model: {GEARS.partition('; ')[2]}, which share the load and touch early at their tip "
        "corners; with tip relief, without pitch errors."
        if CONFIG.gears
        else f"Model: one degree of freedom, {GEARS.partition('; ')[2] or 'rectangular stiffness'}."
    ),
    "train": (
        f"the train of the section ``train``, {CONFIG.train.kind.replace('_', ' ')}"
        if targets.has_custom_train(CONFIG)
        else "the reducer with equal branches, in which every mesh has the damping "
        f"{CONFIG.reducer.damping}"
    ),
    "missing": ", ".join(not_installed(CONFIG.work_precision.methods)),
    "stiffness_pairs": " and ".join(stage_sections(CONFIG, "mesh_stiffness")),
    "reliefs_left_out": bool(
        CONFIG.gears
        and CONFIG.gears.modification_key()
        and uses_configured_gears(CONFIG, "mesh_stiffness")
    ),
    "design_torque": HARRIS_PAIR.torque,
    "dynamic_factor_torque": next(iter(stage_sections(CONFIG, "dynamic_factor").values())).torque,
    "errors_left_out": bool(HARRIS_PAIR.modification_key("pitch_errors")),
}
