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
from workflow.sources import find_sources, write_source_list

ROOT = Path(workflow.basedir)

#: Parts of the report, with numbers because its menu is sorted alphabetically.
CLAIMS, EXPLANATIONS, METHODS = "2 The paper's statements", "3 Explanations", "4 Methods"
TRAINS, GEOMETRY = "5 Gear trains", "6 From the geometry"
MEASURED, TOLERANCES, GEARBOX = "7 Measured", "8 Tolerances", "9 Gearbox"

#: Keys of the configuration that describe a grid of tunings, and random initial states.
GRID = ["start", "stop", "step"]
STARTS = ["starts", "first_starts", "seed", "spread"]

#: Priority of long jobs, which start first.
LONG = 1
#: Number of threads that no machine has, so that a job gets all cores.
ALL_CORES = 1024

# All jobs, also on other nodes, read this file before they load numpy.
os.environ.update(processor.environment_variables())
# This variable would prevent jobs from sharing compiled Python files.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Scripts import the library in the folder of this Snakefile.
os.environ.update(
    PYTHONPATH=os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
)


def exit_with_error(sentence):
    """Log an error message and exit with code 2, without a traceback."""
    logger.error(str(sentence))
    sys.exit(2)


def raise_messages(messages):
    """Raise a ValueError with the given messages unless the list is empty."""
    if messages:
        raise ValueError("\n".join(messages))


def check_tables_and_distributions(checked):
    """Check measured tables and distributions of tolerances, which needs numpy and scipy."""
    if checked.measured:
        from gearlib.uncertainty.measured import read_errors

        raise_messages(read_errors(checked.measured))
    if checked.tolerances.needs_scipy() and not targets.refusal_reason("tolerances", checked):
        from gearlib.uncertainty import distributions

        keys = checked.tolerances.config_keys().items()
        with checks.prefix_error_paths("", **{f"tolerances.{name}": key for name, key in keys}):
            distributions.read_tolerances(checked.tolerance_distributions(), known_parameters())


def load_configuration(changes):
    """Read and check the configuration; return it as a typed object, or exit with an error message.

    The file is config.yaml in the working directory if it exists, else the configuration of the
    paper. `changes` are the values given on the command line.
    """
    base = Path("config.yaml") if Path("config.yaml").exists() else ROOT / "config.yaml"
    try:
        contents = [validation.read_yaml(path) for path in (base, *workflow.overwrite_configfiles)]
        raise_messages([message for _, repeated in contents for message in repeated])
        checked = configuration.load(configuration.overlay_gears(contents[0][0], changes))
        raise_messages([*checked.target_errors(), *checked.train_damping_errors()])
        if workflow.is_main_process:
            check_tables_and_distributions(checked)
        return checked
    except ValueError as error:
        exit_with_error(f"The configuration is refused.\n{error}")


def to_plain_values(value):
    """Convert a value to plain JSON types with sorted keys."""
    return json.loads(json.dumps(value, sort_keys=True))


# Until the file has been read, `config` has the values given on the command line.
CONFIG = load_configuration(dict(config))
IS_PAPER = gear_names.is_paper(CONFIG)
PAPER = "1 The paper's figures" if IS_PAPER else "1 The gears and their motions"
#: Targets that are computed if the command line names none.
WANTED = CONFIG.computed_targets()
# Rules and captions need the defaults, too.
config.clear()
config.update(to_plain_values(CONFIG.model_dump()))

# Processes that run single jobs must not mark results.
if workflow.is_main_process:
    mark_changed(Path("results"))


# The following functions select parts of the configuration as plain values.


def exclude_keys(section, *keys):
    """Return a section of the configuration as a dict without the given keys."""
    return {key: value for key, value in section.items() if key not in keys}


def select_keys(section, *keys):
    """Return a section of the configuration as a dict with only the given keys."""
    return {key: value for key, value in section.items() if key in keys}


def tuning_grid(section, step_key="step"):
    """Return the tunings from start to stop of a section; `step_key` is the key of the step."""
    return tunings.grid(section["start"], section["stop"], section[step_key])


def add_gear_pairs(cases):
    """Return cases as plain values in which a gear pair replaces the keys damping and change."""
    values = []
    for case in cases:
        pair = CONFIG.pair_description(case.damping, case.change)
        values.append(case.model_dump(exclude={"damping", "change"}) | {"pair": pair})
    return to_plain_values(values)


#: Name of a damping -> description of the gear pair, and of the model for sweeps and run-ups.
PAIRS = to_plain_values({damping: CONFIG.pair_description(damping) for damping in CONFIG.dampings})
MODELS = to_plain_values(
    {damping: CONFIG.model_description(damping) for damping in CONFIG.dampings}
)
UNDAMPED = to_plain_values(CONFIG.pair_description())
SIX_DEGREES = to_plain_values(CONFIG.six_degree_parameters())
#: Names of the gears with rectangular stiffness, and with the model for sweeps and run-ups.
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
#: Arguments for the model of sweeps; load-sharing pairs start in static equilibrium.
GEARS_RUN = dict(RUN)
if CONFIG.gears and "initial_state" not in CONFIG.run.model_fields_set:
    GEARS_RUN["initial_state"] = "static"
#: Arguments of `simulate` for time histories.
SAMPLES = {"samples_per_period": config["run"]["samples_per_period"]}
SAMPLED_RUN = RUN | SAMPLES
GEARS_SAMPLED_RUN = GEARS_RUN | SAMPLES
#: Sweeps of the load-sharing pair, if the geometry is given. Figures that need the rectangular
#: stiffness state whether this pair loses contact.
TEETH_SWEEPS = ["results/resonance.nc"] if CONFIG.gears else []
COLOURS = {"colours": config["figures"]["colours"]}


# Files.


def sources_of(script, *modules, methods=()):
    """Return the path of the list of source files of a script; update the list if needed.

    The sources are the imports of the script, the `modules` of gearlib that it loads by name, and
    the integrators of the given `methods`.
    """
    names = [f"gearlib.{module}" for module in modules]
    names += [f"gearlib.integrators.{integrators.METHODS.data[method]}" for method in methods]
    path = ROOT / "workflow" / "scripts" / f"{script}.py"
    return write_source_list(path, find_sources(path, names))


def sources_by_method(script, module, *references):
    """Return a dict of method -> path of the list of source files of a job that runs the method.

    The job also runs the methods `references`. All lists are written in advance, because Snakemake
    searches for files only once.
    """
    return {
        name: sources_of(script, module, methods=[name, *references])
        for name in integrators.METHODS.data
    }


def per_damping(pattern):
    """Return the file names for all dampings; `pattern` contains "{damping}"."""
    return expand(pattern, damping=CONFIG.dampings)


def figure_files(name, label, part, caption=None):
    """Return the files of a figure, one per format; one of them is shown in the report.

    `label` is a text or a function of wildcards that returns labels, and `part` the part of the
    report. `caption` is the name of a file in `workflow/report`, by default the name of the figure.
    For gears other than the paper's, figure numbers are removed from names and labels.
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
    """Return the files of a table: the key "csv", and the key "page" for a page of the report.

    `label` is the label of the table, and `part` the part of the report.
    """
    labels = {"figure": label}
    page = f"results/tables/{name}.html"
    caption = f"../report/{name}_table.rst"
    return {
        "csv": f"results/{name}.csv",
        "page": report(page, caption=caption, category=part, labels=labels),
    }


def target_files(target, *files):
    """Return the files of a target, or an input function that exits with an error message.

    The error is that the target is not possible with the configured gears.
    """
    reason = targets.refusal_reason(target, CONFIG)
    if target in targets.TRAIN_TARGETS:
        reason = reason or targets.mesh_damping_error(CONFIG)
    if not reason:
        return list(files)
    message = f"The configuration is refused.\n{targets.append_target_names(reason, [target])}"
    return lambda wildcards: exit_with_error(message)


def if_wanted(target, files, pairs_only=False):
    """Return `files` if their target is to be computed, else an empty list.

    If `pairs_only` is true, the list is also empty for gears given by their geometry, because their
    sweeps use a different model, the load-sharing pair.
    """
    if target not in WANTED or (pairs_only and CONFIG.gears):
        return []
    return files


# Functions of wildcards for scenes and measured sets.


def scene_cases(wildcards):
    """Return the cases of a scene as plain values, including their gear pairs."""
    return add_gear_pairs(CONFIG.scenes[wildcards.scene].cases)


def scene_criteria(wildcards):
    """Return observables, tolerance and candidate models for the comparison of a scene."""
    scene = config["scenes"][wildcards.scene]
    candidates = CONFIG.candidate_models(CONFIG.scenes[wildcards.scene])
    return select_keys(scene, "observables", "tolerance") | {"candidates": candidates}


def scene_label(wildcards):
    """Return the label of a scene in the report, with its name and its dampings."""
    number = r"Fig. \1: " if IS_PAPER else ""
    title = re.sub(r"^fig(\d+)_", number, wildcards.scene).replace("_", " ")
    dampings = dict.fromkeys(case["damping"] for case in config["scenes"][wildcards.scene]["cases"])
    return {"figure": f"{title}, damping {', '.join(dampings)}"}


#: Name of a measured set -> (YAML file, description).
MEASURED_SETS = measured_description.read_sets(CONFIG.measured)


def measured_set_files(wildcards):
    """Return the files of a measured set: the description and the tables."""
    path, description = MEASURED_SETS[wildcards.measured]
    return [path, *description.table_paths(path)]


# Parameters of methods, gears and designs.


def list_gearbox_jobs():
    """Return the pairs (stage, load case) to compute, and the load cases of the whole gearbox.

    Both lists are empty unless the target gearbox is to be computed.
    """
    if "gearbox" not in WANTED:
        return [], []
    from gearlib.studies.gearboxes import list_computations

    try:
        stages, boxes, _ = list_computations(CONFIG.gearbox.file)
    except (OSError, ValueError) as error:
        exit_with_error(f"The configuration is refused.\ngearbox.file: {error}")
    return stages, boxes


def gearbox_label(title):
    """Return a function of wildcards that returns the label of a figure of the whole gearbox."""
    return lambda wildcards: {"figure": f"{title}, load case {BOXES[int(wildcards.number)]}"}


def select_missing_packages(methods):
    """Return the methods whose packages are not installed."""
    return [name for name in dict.fromkeys(methods) if not targets.is_installed(name)]


def stage_descriptions(section):
    """Return the gear stages of a section of the configuration as a dict of plain values."""
    pairs = stage_sections(CONFIG, section)
    return to_plain_values({name: pair.model_dump() for name, pair in pairs.items()})


def stage_names(section, teeth=False):
    """Return the names of the gears of a section as a text for figures.

    If `teeth` is true, the gears are load-sharing pairs, and the text includes their stiffness.
    """
    pairs, suffix = stage_sections(CONFIG, section).values(), ""
    if teeth:
        method = config[section].get("stiffness")
        if not method and CONFIG.gears:
            method = CONFIG.gears.stiffness
        method = method or next(iter(pairs)).gear_stage().tooth_stiffness
        suffix = f"; pairs of teeth, {METHOD_NAMES[method]}"
    names = (gear_names.gear_stage_name(pair, teeth, pitch_errors=False) for pair in pairs)
    return " and ".join(dict.fromkeys(names)) + suffix


def teeth_over_speed():
    """Return the model and, if known, the operating speed for the target dynamic_factor."""
    if uses_configured_gears(CONFIG, "dynamic_factor"):
        return {"model": next(iter(MODELS.values())), "speed": CONFIG.gears.speed}
    gears = to_plain_values(CONFIG.dynamic_factor.gears.model_dump())
    damping = {"damping_ratio": CONFIG.dynamic_factor.damping_ratio}
    return {"model": {"model": "teeth", "gears": gears, "damping": damping, "pitch_errors": False}}


#: Arguments of the target tolerances that describe the designs.
DESIGNS = to_plain_values(
    {
        "pair": CONFIG.pair_description(CONFIG.tolerances.damping),
        "tolerances": (
            {} if targets.refusal_reason("tolerances", CONFIG) else CONFIG.tolerance_distributions()
        ),
        **select_keys(config["tolerances"], "seed", "quantities"),
    }
)
if CONFIG.tolerances.has_geometry_parameters() and CONFIG.gears:
    DESIGNS["gears"] = to_plain_values(CONFIG.gears.geometry_dict())

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
    "missing": ", ".join(select_missing_packages(CONFIG.work_precision.methods)),
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
