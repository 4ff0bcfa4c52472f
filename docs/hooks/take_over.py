"""Renew the data and the figures of a page of evidence after a run of the workflow.

    python -m docs.hooks.take_over claims results
    python -m docs.hooks.take_over speed_and_accuracy results

The first call renews `reproduction.md` and the figures of the paper on other pages.
"""

import json
import shutil
import sys
from pathlib import Path

import pandas as pd
import yaml
from PIL import Image

from docs.hooks.evidence import FOLDER, read, read_claims
from gearlib import config
from gearlib.analysis import trust
from gearlib.analysis.orbits.special_points import FOLD, GRAZING
from gearlib.data import storage
from gearlib.studies.trials.work_precision import LIBRARY_METHODS

SPEED = FOLDER / "speed_and_accuracy"
DOCS = FOLDER.parent
_WIDTH, _COLOURS = 1000, 64


def claims(results):
    """Copy the claims, and the numbers that their reasons quote, from `results`."""
    read_claims(results)
    for name in ("claims", "parametric_resonance", "certificates"):
        shutil.copy(results / f"{name}.csv", FOLDER)
    branches = _labelled(results / "branches")
    branches["point"] = branches.label.map({FOLD: "fold", GRAZING: "grazing"})
    special = branches[branches.period == 1].dropna().sort_values(["damping", "point", "tuning"])
    _write(special[["damping", "point", "tuning"]], FOLDER / "branches.csv", "%.10g")
    motions = _labelled(results / "labels")
    motions["label"] = motions.label.map(dict(enumerate(trust.LABELS)))
    certified = motions.tuning.round(6).isin(read("certificates").tuning)
    _write(motions[certified], FOLDER / "labels.csv", "%.6g")


def speed_and_accuracy(results):
    """Copy errors, times and verdicts of the methods, and facts on the machine, from `results`."""
    shutil.copy(results / "models.csv", SPEED)
    text = (DOCS.parent / "config.yaml").read_text(encoding="utf-8")
    settings = config.load(yaml.safe_load(text)).work_precision
    folder = results / "work_precision"
    installed = [name for name in settings.methods if (folder / f"errors_{name}.nc").exists()]
    rows = pd.concat(_settings_of(folder, name) for name in installed)
    _write(rows, SPEED / "work_precision.csv", "%.3g")
    matrix = storage.read(results / "failures.nc").verdict
    meanings = dict(enumerate(matrix.attrs["flag_meanings"].split()))
    matrix.to_pandas().map(meanings.get).to_csv(SPEED / "failures.csv", lineterminator="\n")
    record = json.loads((results / "provenance.json").read_text(encoding="utf-8"))
    versions = record["versions"]
    used = ("gearlib", "python", "numba", "numpy", "scipy", "heyoka")
    facts = {
        "date": record["finished"][:10],
        "processor": record["machine"]["processor"],
        "cores": record["machine"]["cores"],
        "repeats": settings.repeats,
        "versions": {name: versions[name] for name in used if name in versions},
    }
    (SPEED / "machine.yaml").write_text(yaml.safe_dump(facts, sort_keys=False), encoding="utf-8")


def copy_figures(results, page):
    """Copy the figures of a page, made smaller, from `results`."""
    text = (DOCS / "speed_and_accuracy.md").read_text(encoding="utf-8")
    for path in (results / "figures").glob("*.png"):
        target = DOCS / "images" / path.name
        if target.exists() and (path.name in text) == (page == "speed_and_accuracy"):
            picture = Image.open(path).convert("RGB")
            picture.thumbnail((_WIDTH, 10 * _WIDTH))
            small = picture.quantize(_COLOURS, dither=Image.Dither.NONE)
            small.save(target, optimize=True)


def _labelled(folder):
    """Return the points or motions of all dampings in a folder, with their labels."""
    files = (storage.read(path) for path in sorted(folder.glob("*.nc")))
    frames = [data[["tuning", "label", "period"]].to_dataframe().reset_index() for data in files]
    return pd.concat(frames)[["damping", "tuning", "label", "period"]]


def _settings_of(folder, method):
    """Return error, evaluations and wall time of each setting of a method."""
    data = storage.read(folder / f"errors_{method}.nc").rename(period_evaluations="evaluations")
    times = storage.read(folder / f"times_{method}.nc").period_time
    frame = data.assign(microseconds=1e6 * times).to_dataframe().reset_index()
    frame["own"] = "yes" if method in LIBRARY_METHODS else "no"
    names = ["problem", "line", "own", "knob", "state_error", "evaluations", "microseconds"]
    return frame[names].dropna(subset="state_error")


def _write(table, path, number_format):
    """Write a table as CSV."""
    table.to_csv(path, index=False, float_format=number_format, lineterminator="\n")


if __name__ == "__main__":
    page, results = sys.argv[1], Path(sys.argv[2])
    {"claims": claims, "speed_and_accuracy": speed_and_accuracy}[page](results)
    copy_figures(results, page)
