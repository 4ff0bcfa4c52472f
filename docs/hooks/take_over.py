"""Renew the data and the figures of a page of evidence after a run of the workflow.

    python -m docs.hooks.take_over claims results
    python -m docs.hooks.take_over speed_and_accuracy results

The first call also renews the figures of the workflow on other pages.
"""

import json
import shutil
import sys
from pathlib import Path

import pandas as pd
import yaml
from PIL import Image

from docs.hooks.evidence import FOLDER, read
from gearlib import config
from gearlib.analysis import trust
from gearlib.analysis.orbits.special_points import FOLD, GRAZING
from gearlib.data import storage

DOCS, SPEED = FOLDER.parent, FOLDER / "speed_and_accuracy"


def claims(results):
    """Copy the claims and the numbers that their reasons quote."""
    for name in ("claims", "parametric_resonance", "certificates"):
        shutil.copy(results / f"{name}.csv", FOLDER)
    branches = _labelled(results / "branches").query("period == 1")
    branches["point"] = branches.label.map({FOLD: "fold", GRAZING: "grazing"})
    columns = ["damping", "point", "tuning"]
    special = branches.dropna()[columns].sort_values(columns)
    special.to_csv(FOLDER / "branches.csv", index=False, float_format="%.10g")
    motions = _labelled(results / "labels")
    motions["label"] = motions.label.map(dict(enumerate(trust.LABELS)))
    certified = motions[motions.tuning.round(6).isin(read("certificates").tuning)]
    certified.to_csv(FOLDER / "labels.csv", index=False, float_format="%.6g")


def _labelled(folder):
    """Return the points of branches or the motions of all dampings in a folder."""
    files = (storage.read(path) for path in sorted(folder.glob("*.nc")))
    frames = [data[["tuning", "label", "period"]].to_dataframe().reset_index() for data in files]
    return pd.concat(frames)[["damping", "tuning", "label", "period"]]


def speed_and_accuracy(results):
    """Copy models, errors, times and verdicts of methods, and say when and where they were made."""
    shutil.copy(results / "models.csv", SPEED)
    configuration = yaml.safe_load((DOCS.parent / "config.yaml").read_text(encoding="utf-8"))
    settings = config.load(configuration).work_precision
    folder = results / "work_precision"
    methods = [name for name in settings.methods if (folder / f"errors_{name}.nc").exists()]
    points = pd.concat(_points(folder, method) for method in methods)
    points.to_csv(SPEED / "work_precision.csv", index=False, float_format="%.3g")
    matrix = storage.read(results / "failures.nc").verdict
    meanings = dict(enumerate(matrix.attrs["flag_meanings"].split()))
    matrix.to_pandas().map(meanings.get).to_csv(SPEED / "failures.csv")
    record = json.loads((results / "provenance.json").read_text(encoding="utf-8"))
    packages = ("gearlib", "python", "numba", "numpy", "scipy", "heyoka")
    versions = [f"{k} {record['versions'][k]}" for k in packages if k in record["versions"]]
    text = (
        f"Computed on {record['finished'][:10]} with {', '.join(versions)}. Wall times: "
        f"{record['machine']['processor']}, one of {record['machine']['cores']} cores, one "
        f"thread, the shortest of up to {settings.repeats} runs.\n"
    )
    (SPEED / "machine.txt").write_text(text, encoding="utf-8")


def _points(folder, method):
    """Return error, evaluations and wall time of each setting of a method."""
    data = storage.read(folder / f"errors_{method}.nc").rename(period_evaluations="evaluations")
    times = storage.read(folder / f"times_{method}.nc").period_time
    frame = data.assign(microseconds=1e6 * times).to_dataframe().reset_index()
    names = ["problem", "line", "knob", "state_error", "evaluations", "microseconds"]
    return frame[names].dropna(subset="state_error")


def copy_figures(results, page):
    """Copy, made smaller, the figures of a page, or of all pages but that on speed."""
    text = (DOCS / "speed_and_accuracy.md").read_text(encoding="utf-8")
    for path in (results / "figures").glob("*.png"):
        target = DOCS / "images" / path.name
        if target.exists() and (path.name in text) == (page == "speed_and_accuracy"):
            picture = Image.open(path).convert("RGB")
            picture.thumbnail((1000, 10_000))
            picture.quantize(64, dither=Image.Dither.NONE).save(target, optimize=True)


if __name__ == "__main__":
    page, results = sys.argv[1], Path(sys.argv[2])
    {"claims": claims, "speed_and_accuracy": speed_and_accuracy}[page](results)
    copy_figures(results, page)
