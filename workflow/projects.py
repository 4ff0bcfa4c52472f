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
    """Return the name of the project, "" for the paper's.

    `config` is the whole configuration, `base` that of the paper, `given` what was laid over it.
    The last of the `files` with that gives the name if its machine is another one.
    """
    if config.get("project") or "cases" in config or not files:
        return config.get("project", "")
    other = any(_differs(given[key], base.get(key)) for key in _MACHINE if key in given)
    return re.sub("[^A-Za-z0-9_-]", "_", Path(files[-1]).stem) if other else ""


def _differs(given, base):
    """Return whether a configuration, laid over another one, changes it."""
    if isinstance(given, dict) and isinstance(base, dict):
        return any(_differs(value, base.get(key)) for key, value in given.items())
    return given != base


def machines(folder, config):
    """Return folder -> its machine; None instead of a machine where the configuration is wrong."""
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
    """Return the name of a machine and the numbers that tell it from others."""
    try:
        c = configuration.load(settings)
    except configuration.ConfigError:
        return None
    mesh = gear_names.PAPER.keys()
    gears = (
        c.gears.model_dump(exclude=_OPERATED) if c.gears else c.gear_pair.model_dump(include=mesh)
    )
    return {"name": gear_names.of_pair(c), "gears": json.loads(json.dumps(gears))}


def _recorded(folder):
    """Return the machine whose results a folder holds by its record, None without a record."""
    path = folder / RECORD
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def of_others(machines):
    """Return a sentence for each folder -> machine that holds the results of another machine."""
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
    """Write into each folder -> machine the record of the machine, if it has changed."""
    for folder, machine in machines.items():
        folder.mkdir(parents=True, exist_ok=True)
        if _recorded(folder) != machine:
            text = json.dumps(machine, indent=2, ensure_ascii=False) + "\n"
            (folder / RECORD).write_text(text, encoding="utf-8")


def compared(folders, others):
    """Return the characteristics in label -> folder, of this run and of others.

    Refused if there is only one, or one of the others is missing, which this run cannot compute.
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
    """Return the gears of each label -> folder as text, by folder -> machine or its record."""
    names = []
    for label, folder in folders.items():
        machine = machines.get(folder) or _recorded(folder) or {"name": "unknown"}
        names.append(f"{label}: {machine['name']}")
    return "; ".join(names)
