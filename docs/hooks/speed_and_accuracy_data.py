"""The data of `speed_and_accuracy.md`: taken from a run of the workflow, kept as small tables."""

import csv
import json
import math
from datetime import date
from pathlib import Path

import xarray as xr
import yaml

from docs.hooks.reproduction import copy_pictures
from gearlib import config
from gearlib.studies.trials.work_precision import LIBRARY_METHODS

DOCS = Path(__file__).resolve().parents[1]
FOLDER = DOCS / "claims" / "speed_and_accuracy"
#: Figures shown on the page.
PICTURES = (
    "work_precision_evaluations",
    "work_precision_time",
    "failures",
    "stability_chart",
    "models",
)


def take_over(results, remark=""):
    """Copy data and figures of `results` into the documentation, with a remark on the times."""
    results = Path(results)
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / "models.csv").write_bytes((results / "models.csv").read_bytes())
    _write("work_precision", _points_of(results / "work_precision"))
    _write("failures", _verdicts_of(results / "failures.nc"))
    facts = yaml.safe_dump(_facts_of(results, remark), sort_keys=False)
    (FOLDER / "machine.yaml").write_text(facts, encoding="utf-8")
    copy_pictures(results, PICTURES)


def _write(name, rows):
    with (FOLDER / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _settings():
    return config.load(yaml.safe_load((DOCS.parent / "config.yaml").read_text(encoding="utf-8")))


def _points_of(folder):
    rows = []
    for method in _settings().work_precision.methods:
        if not (folder / f"errors_{method}.nc").exists():
            continue
        with (
            xr.open_dataset(folder / f"errors_{method}.nc") as errors,
            xr.open_dataset(folder / f"times_{method}.nc") as seconds,
        ):
            for i, problem in enumerate(errors.problem.values):
                for k in range(errors.sizes["rung"]):
                    cells = (
                        errors.state_error.values[i, k],
                        errors.period_evaluations.values[i, k],
                        1e6 * seconds.period_time.values[i, k],
                    )
                    if math.isnan(cells[0]):
                        continue
                    labels = (
                        problem,
                        errors.line.values[k],
                        "yes" if method in LIBRARY_METHODS else "no",
                    )
                    keys = ("problem", "line", "own", "knob", "state_error", "evaluations")
                    values = (*labels, errors.knob.values[k], *(f"{c:.3g}" for c in cells))
                    rows.append(dict(zip((*keys, "microseconds"), values, strict=True)))
    return rows


def _verdicts_of(path):
    with xr.open_dataset(path) as data:
        meanings = data.verdict.attrs["flag_meanings"].split()
        order = [trial.name for trial in _settings().failures.trials]
        data = data.sel(trial=[name for name in order if name in data.trial.values])
        return [
            {"problem": str(problem)}
            | {
                str(trial): meanings[int(code)]
                for trial, code in zip(data.trial.values, data.verdict.values[i], strict=True)
            }
            for i, problem in enumerate(data.problem.values)
        ]


def _facts_of(results, remark):
    record = json.loads((results / "provenance.json").read_text(encoding="utf-8"))
    used = ("gearlib", "python", "numba", "numpy", "scipy", "heyoka")
    methods = _settings().work_precision.methods
    absent = [m for m in methods if not (results / f"work_precision/errors_{m}.nc").exists()]
    return {
        "date": date.fromisoformat(record["finished"][:10]).isoformat(),
        "processor": record["machine"]["processor"],
        "cores": record["machine"]["cores"],
        "repeats": _settings().work_precision.repeats,
        "versions": {k: record["versions"][k] for k in used if k in record["versions"]},
        "absent": absent,
        "remark": remark,
    }
