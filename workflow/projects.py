"""Whose results a folder holds: a project has a name, and no folder those of two machines."""

import json
import re
from pathlib import Path

from gearlib import config as configuration
from gearlib.config import gear_names, laid_over
from workflow.refusal import refuse

#: Sections that describe a machine.
_MACHINE = ("gears", "gear_pair", "train")
#: What a machine may have otherwise from one run to the next, and how its stiffness is found.
_OPERATED = {"torque", "power", "speed", "backlash", "stiffness", "stiffness_options"}
RECORD = "gears.json"


def name_of(config, base, given, files):
    """Return the name of the project, "" for the paper's.

    Parameters
    ----------
    config, base, given : dict
        All that was read; the configuration of the paper; what was laid over that.
    files : sequence of str or os.PathLike
        Where that was read from. The last one names the project where its machine is another one.
    """
    if config.get("project") or "cases" in config or not files:
        return config.get("project", "")
    other = any(_differs(given[key], base.get(key)) for key in _MACHINE if key in given)
    return re.sub("[^A-Za-z0-9_-]", "_", Path(files[-1]).stem) if other else ""


def _differs(given, base):
    if isinstance(given, dict) and isinstance(base, dict):
        return any(_differs(value, base.get(key)) for key, value in given.items())
    return given != base


def machines(folder, config):
    """Return folder -> whose results it holds; None where the configuration is to be refused."""
    if "cases" not in config:
        return {folder: _machine(config)}
    common = {key: value for key, value in config.items() if key != "cases"}
    try:
        return {
            folder / case: _machine(laid_over(common, own)) for case, own in config["cases"].items()
        }
    except (AttributeError, TypeError):
        return {}


def _machine(settings):
    """Return the name of a machine, and the numbers that make it another one."""
    try:
        c = configuration.load(settings)
    except configuration.ConfigError:
        return None
    mesh = gear_names.PAPER.keys()
    made = (
        c.gears.model_dump(exclude=_OPERATED) if c.gears else c.gear_pair.model_dump(include=mesh)
    )
    return {"name": gear_names.of_pair(c), "gears": json.loads(json.dumps(made))}


def of_others(found):
    """Return a sentence for each folder, of `machines`, with the results of another machine."""
    sentences = []
    for folder, own in found.items():
        path = folder / RECORD
        known = json.loads(path.read_text(encoding="utf-8")) if own and path.exists() else own
        if known != own and known["gears"] != own["gears"]:
            sentences.append(
                f"{folder}/ holds what was computed for the {known['name']}, and the configuration "
                f"is about the {own['name']}: give it a folder of its own, `project: name`, or "
                f"remove {folder}/."
            )
    return sentences


def record(found):
    """Write into each folder, of `machines`, whose results it holds."""
    for folder, own in found.items():
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(own, indent=2, ensure_ascii=False) + "\n"
        path = folder / RECORD
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def compared(own, others):
    """Return the characteristics of label -> folder, of this run and of others, over each other.

    Refused if there is only one, or one of the others is not there: this run cannot compute it.
    """
    missing = [name for name, path in others.items() if not (path / "resonance.nc").exists()]
    if missing or len(own | others) < 2:
        lacking = f"{missing[0]} has no resonance.nc yet" if missing else "there is only one"
        refuse(
            f"compare needs several cases or projects: {lacking}. It takes all `cases` of the "
            "configuration, and those named in `compare`, as in --config 'compare=[paper]'."
        )
    return [str(folder / "resonance.nc") for folder in (own | others).values()]


def names_of(labels, found):
    """Return whose gears each of label -> folder is about, of `machines` or by its record."""
    known = {folder: own["name"] for folder, own in found.items() if own}
    words = []
    for label, folder in labels.items():
        path = folder / RECORD
        if folder not in known and path.exists():
            known[folder] = json.loads(path.read_text(encoding="utf-8"))["name"]
        words.append(f"{label}: {known.get(folder, 'unknown')}")
    return "; ".join(words)
