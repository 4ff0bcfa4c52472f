"""Tables of `reproduction.md` and `speed_and_accuracy.md`, made from the data in docs/claims.

A comment ``<!-- table: costs evaluations -->`` on a page stands for what `costs` returns.
take_over.py copies the data from results of the workflow.
"""

import re
from pathlib import Path

import pandas as pd
import yaml

FOLDER = Path(__file__).resolve().parents[1] / "claims"
#: What is difficult -> the problems of `gearlib.studies.trials.difficult_problems`.
DIFFICULTIES = {
    "events": "graze_short_6 graze_past_6 graze_short_10 graze_past_10 tiny_bounce double_crossing",
    "backlash": "rest_near rest_far no_backlash nano_backlash endless_backlash",
    "parameters": "critical overdamped soft ratio_1 ratio_2 ratio_above_1 ratio_below_2 slow fast",
    "other models": "cubic_damping terms_2 terms_200 stiff_bearings",
    "long runs": "fold_below fold_above chaos conservative",
    "parametric resonance": "tongue_2 edge_2 tongue_066 edge_066",
    "gear trains": "planets_at_once planets_apart planets_alike",
}


def on_page_markdown(markdown, **_):
    """Put the tables into a page."""

    def table(comment):
        name, *arguments = comment[1].split()
        rows = globals()[name](*arguments)
        return rows.fillna("–").to_markdown(index=False, disable_numparse=True)

    return re.sub(r"<!-- table: (.+?) -->", table, markdown)


def read(name):
    """Return a table of data."""
    return pd.read_csv(FOLDER / f"{name}.csv")


def reasons():
    """Return the reason for each verdict by the id of its statement."""
    texts = yaml.safe_load((FOLDER / "why.yaml").read_text(encoding="utf-8"))
    return {key: " ".join(text.format(**quoted_numbers()).split()) for key, text in texts.items()}


def quoted_numbers():
    """Return the data that the reasons quote, by damping, in the order of the tunings.

    `branches` has the tunings of each kind of point, `proven` the rows of each kind of certificate:
    ranges of tunings by their contacts, such as "range D", orbits by their tuning.
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
    rows = read("claims")
    anchors = rows.figure.str.lower().str.replace(". ", "-")
    columns = {
        "": rows.id,
        "the paper": rows.statement + " (" + rows["where"] + ")",
        "ours": rows.computed + " ([" + rows.figure + "](#" + anchors + "))",
        "verdict": "**" + rows.verdict + "**",
        "why": rows.id.map(reasons()),
    }
    return pd.DataFrame(columns)


def costs(column):
    """Return the least cost of each method for an error of at most 1e-6 in each problem."""
    rows = read("speed_and_accuracy/work_precision")
    # Times that other work on the machine disturbed may be negative.
    rows[column] = rows[column].where((rows.state_error <= 1e-6) & (rows.microseconds > 0.0))
    least = rows.groupby(["line", "problem"], sort=False)[column].min().unstack(sort=False)
    cells = least.map(lambda x: f"{x:.0f}" if x >= 100 else f"{x:.2g}", na_action="ignore")
    return cells.rename_axis("method").reset_index()


def verdicts():
    """Return the table that says on how many problems of each kind a method is right."""
    rows = read("speed_and_accuracy/failures").set_index("problem")
    kind_of = {name: kind for kind, names in DIFFICULTIES.items() for name in names.split()}
    kinds = [kind_of[problem] for problem in rows.index]
    right = (rows == "right").groupby(kinds).sum().T
    taken = (rows != "refused").groupby(kinds).sum().T
    right["all"], taken["all"] = right.sum(axis=1), taken.sum(axis=1)
    cells = (right.astype(str) + "/" + taken.astype(str)).where(taken > 0)
    return cells[[*DIFFICULTIES, "all"]].rename_axis("right").reset_index()
