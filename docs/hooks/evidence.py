"""Tables of `reproduction.md` and `speed_and_accuracy.md`, made from the data in docs/claims.

The comment ``<!-- table: NAME -->`` on a page stands for the table that the function `NAME` returns.
The data are copies from results of the workflow, see take_over.py.
"""

import json
import re
from pathlib import Path

import pandas as pd
import yaml

from gearlib.studies.claims.statements import CHECKS

FOLDER = Path(__file__).resolve().parents[1] / "claims"
#: Errors that the table of wall times allows.
ACCURACIES = (1e-3, 1e-6, 1e-9, 1e-12)
#: What is difficult -> the problems of `gearlib.studies.trials.difficult_problems`.
DIFFICULTIES = {
    "contact changes within a step": (
        "graze_short_6 graze_past_6 graze_short_10 graze_past_10 tiny_bounce double_crossing"
    ),
    "unusual backlash": "rest_near rest_far no_backlash nano_backlash endless_backlash",
    "extreme parameters": (
        "critical overdamped soft ratio_1 ratio_2 ratio_above_1 ratio_below_2 slow fast"
    ),
    "other models": "cubic_damping terms_2 terms_200 stiff_bearings",
    "long runs": "fold_below fold_above chaos conservative",
    "parametric resonance": "tongue_2 edge_2 tongue_066 edge_066",
    "gear trains": "planets_at_once planets_apart planets_alike",
}


def on_page_markdown(markdown, **_):
    """Put the tables into a page."""
    return re.sub(r"<!-- table: (\w+) -->", lambda comment: globals()[comment[1]](), markdown)


def read(name, folder=FOLDER):
    """Return a table of data."""
    return pd.read_csv(folder / f"{name}.csv", float_precision="round_trip")


def read_claims(folder=FOLDER):
    """Return the paper's statements with our numbers and verdicts; refuse those of old code."""
    rows = read("claims", folder)
    stated = rows[["id", "statement", "where", "figure"]].itertuples(index=False, name=None)
    if [*stated] != [check[:4] for check in CHECKS]:
        raise ValueError(
            f"{folder}/claims.csv has other statements than gearlib/studies/claims: run the "
            "workflow, then `python -m docs.hooks.take_over claims results`"
        )
    return rows


def reasons():
    """Return the reason for each verdict by the id of its statement."""
    texts = yaml.safe_load((FOLDER / "why.yaml").read_text(encoding="utf-8"))
    numbers = quoted_numbers()
    return {key: " ".join(text.format(**numbers).split()) for key, text in texts.items()}


def quoted_numbers():
    """Return the data that the reasons quote, by damping, in the order of the tunings.

    `branches` has the tunings of each kind of point, `proven` the rows of each kind of certificate:
    ranges of tunings by their contacts, such as "range N", orbits by their tuning.
    """
    rows = read("certificates").sort_values("tuning", kind="stable")
    details = rows.tuning.astype(str).where(rows.claim == "orbit", rows.contacts.fillna(""))
    kinds = (rows.claim + " " + details).str.strip()
    return {
        "tongue": read("parametric_resonance").set_index("damping").to_dict("index"),
        "branches": read("branches").groupby(["damping", "point"]).tuning.apply(list),
        "proven": rows.groupby(["damping", kinds]).apply(lambda group: group.to_dict("records")),
    }


def claims():
    """Return the table of the paper's statements."""
    rows = read_claims()
    links = rows.figure.map(lambda figure: f"[{figure}](#{anchor(figure)})")
    columns = {
        "": rows.id,
        "the paper": rows.statement + " (" + rows["where"] + ")",
        "ours": rows.computed + " (" + links + ")",
        "verdict": "**" + rows.verdict + "**",
        "why": rows.id.map(reasons()),
    }
    return _markdown(pd.DataFrame(columns), index=False)


def anchor(figure):
    """Return the anchor of a figure on the page."""
    return figure.lower().replace(". ", "-")


def machine():
    """Return when, with which versions and on which machine the methods were compared."""
    record = json.loads((FOLDER / "speed_and_accuracy/provenance.json").read_text("utf-8"))
    used = ("gearlib", "python", "numba", "numpy", "scipy", "heyoka")
    versions = ", ".join(f"{k} {record['versions'][k]}" for k in used if k in record["versions"])
    processor, cores = (record["machine"][key] for key in ("processor", "cores"))
    return (
        f"Computed on {record['finished'][:10]} with {versions}. Wall times: {processor}, one of "
        f"{cores} cores, one thread, the shortest of several runs."
    )


def wall_times():
    """Return the table of the fastest methods of gearlib and of other packages."""
    times = fastest()
    own, other = times.own_method, times.other_method
    ratio = times.other_microseconds / times.own_microseconds
    cells = [
        "–" if pd.isna(a) else f"`{a}` {_digits(t)} µs; " + ("no other" if pd.isna(b) else f"`{b}` {_digits(r)} ×")
        for a, t, b, r in zip(own, times.own_microseconds, other, ratio, strict=True)
    ]
    return cells


def _markdown(table, **options):
    return table.to_markdown(disable_numparse=True, **options)
