"""Folders of projects: each holds the results of one machine, of which it has a record."""

import json
import re
from pathlib import Path

from gearlib import config as configuration
from gearlib.config import gear_names, overlay
from workflow.refusal import refuse

#: Sections that describe a machine.
_MACHINE = ("gears", "gear_pair", "train")
#: Keys of gears that may differ between runs of one machine: operation and stiffness.
_OPERATED = {"torque", "power", "speed", "backlash", "stiffness", "stiffness_options"}
RECORD = "gears.json"


def name_of(config, base, given, files):
    """Return the name of the project, or "" for the gears of the paper.

    `config` is the whole configuration: that of the paper, `base`, with the changes `given` by
    configuration `files`. If the changes describe other gears, the last file gives the name.
    """
    if config.get("project") or "cases" in config or not files:
        return config.get("project", "")
    sections = [section for section in _MACHINE if section in given]
    other_gears = any(_differs(given[section], base.get(section)) for section in sections)
    return re.sub("[^A-Za-z0-9_-]", "_", Path(files[-1]).stem) if other_gears else ""


def _differs(given, base):
    """Return whether merging the values `given` into the configuration `base` would change it."""
    if isinstance(given, dict) and isinstance(base, dict):
        return any(_differs(value, base.get(key)) for key, value in given.items())
    return given != base


def machines(folder, config):
    """Return result folder -> gears of each case, with None if the configuration is invalid."""
    if "cases" not in config:
        return {folder: _machine(config)}
    common = {key: value for key, value in config.items() if key != "cases"}
    try:
        return {
            folder / case: _machine(overlay(common, changes))
            for case, changes in config["cases"].items()
        }
    except (AttributeError, TypeError):
        return {}


def _machine(settings):
    """Return the name and parameters of configured gears, or None if they are invalid."""
    try:
        loaded = configuration.load(settings)
    except configuration.ConfigError:
        return None
    if loaded.gears:
        gears = loaded.gears.model_dump(exclude=_OPERATED)
    else:
        gears = loaded.gear_pair.model_dump(include=gear_names.PAPER.keys())
    return {"name": gear_names.name_of_pair(loaded), "gears": json.loads(json.dumps(gears))}


def _recorded(folder):
    """Return the recorded gears of a result folder, or None without a record."""
    path = folder / RECORD
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def of_others(machines):
    """Return an error message for each folder -> gears whose folder has results of other gears."""
    sentences = []
    for folder, machine in machines.items():
        known = machine and _recorded(folder)
        if known and known["gears"] != machine["gears"]:
            sentences.append(
                f"{folder}/ holds what was computed for the {known['name']}, and the configuration "
                f"is about the {machine['name']}: give it a folder of its own, `project: name`, or "
                f"remove {folder}/."
            )
    return sentences


def record(machines):
    """Write the gears in `machines`, folder -> gears, as JSON into their folders if changed."""
    for folder, machine in machines.items():
        folder.mkdir(parents=True, exist_ok=True)
        if _recorded(folder) != machine:
            text = json.dumps(machine, indent=2, ensure_ascii=False) + "\n"
            (folder / RECORD).write_text(text, encoding="utf-8")


def compared(folders, others):
    """Return the paths of the resonance datasets to compare.

    `folders` and `others` map labels to result folders of this run and of other projects. The
    workflow ends with a message if a dataset of `others` is missing or there is only one.
    """
    missing = [name for name, path in others.items() if not (path / "resonance.nc").exists()]
    if missing or len(folders | others) < 2:
        lacking = f"{missing[0]} has no resonance.nc yet" if missing else "there is only one"
        refuse(
            f"compare needs several cases or projects: {lacking}. It takes all `cases` of the "
            "configuration, and those named in `compare`, as in --config 'compare=[paper]'."
        )
    return [str(folder / "resonance.nc") for folder in (folders | others).values()]


def names_of(folders, machines):
    """Return a text with the label and gears of each folder.

    `folders` maps labels to folders, `machines` folders to gears; other folders have a record.
    """
    names = []
    for label, folder in folders.items():
        machine = machines.get(folder) or _recorded(folder) or {"name": "unknown"}
        names.append(f"{label}: {machine['name']}")
    return "; ".join(names)
