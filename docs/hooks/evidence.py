"""Tables of `reproduction.md` and `speed_and_accuracy.md`, made from the data in docs/claims.

A comment ``<!-- table: NAME -->`` on a page stands for what the function `NAME` returns.
The data are copies from results of the workflow, see take_over.py.
"""

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
    facts = yaml.safe_load((FOLDER / "speed_and_accuracy/machine.yaml").read_text("utf-8"))
    versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    return (
        f"Computed on {facts['date']} with {versions}. Wall times: {facts['processor']}, one of "
        f"{facts['cores']} cores, one thread, the shortest of up to {facts['repeats']} runs."
    )


def fastest():
    """Return the fastest setting of gearlib ("yes") and of others by problem and accuracy."""
    # Times that other work on the machine disturbed may be negative.
    rows = read("speed_and_accuracy/work_precision").query("microseconds > 0")
    timed = rows.sort_values("microseconds", kind="stable")
    accurate = {limit: timed[timed.state_error <= limit * (1 + 1e-9)] for limit in ACCURACIES}
    rows = pd.concat(accurate, names=["accuracy", None]).reset_index("accuracy")
    keys = ["own", "problem", "accuracy"]
    return rows.groupby(keys, sort=False)[["line", "microseconds"]].first()


def wall_times():
    """Return the table of the fastest methods of gearlib and of other packages."""
    own, other = fastest().loc["yes"], fastest().loc["no"]
    ratios = (other.microseconds / own.microseconds).map(_number)
    others = ("`" + other.line + "` " + ratios + " ×").reindex(own.index).fillna("no other")
    cells = "`" + own.line + "` " + own.microseconds.map(_number) + " µs; " + others
    table = cells.unstack(sort=False).rename(columns="within {:.0e}".format)
    return _markdown(table.fillna("–"))


def evaluations():
    """Return the table of evaluations per mesh period that methods need for an error of 1e-6."""
    rows = read("speed_and_accuracy/work_precision")
    rows["evaluations"] = rows.evaluations.where(rows.state_error <= 1e-6)
    least = rows.groupby(["line", "problem"], sort=False).evaluations.min()
    return _markdown(least.map(_number, na_action="ignore").unstack(sort=False).fillna("–"))


def verdicts():
    """Return the table that says on how many problems of each kind a method is right."""
    rows = read("speed_and_accuracy/failures").set_index("problem")
    kinds = {name: kind for kind, names in DIFFICULTIES.items() for name in names.split()}
    kinds = [kinds[problem] for problem in rows.index]
    right = (rows == "right").groupby(kinds).sum().T
    taken = (rows != "refused").groupby(kinds).sum().T
    right["all"], taken["all"] = right.sum(axis=1), taken.sum(axis=1)
    cells = (right.astype(str) + "/" + taken.astype(str)).where(taken > 0, "–")
    return _markdown(cells[[*DIFFICULTIES, "all"]].rename_axis("right"))


def models():
    """Return the table of the smallest model that suffices for each scene."""
    rows = read("speed_and_accuracy/models").set_index("scene")
    chosen = rows[rows.chosen == "yes"]
    costs = pd.to_numeric(rows.cost, errors="coerce").groupby("scene").max()
    ratios = costs / pd.to_numeric(chosen.cost, errors="coerce")
    columns = {
        "model": "`" + chosen.model + "`",
        "change by larger models": chosen.change.fillna("no larger model"),
        "allowed": chosen.tolerance,
        "cost of the dearest model": ratios.map("{:.0f} ×".format, na_action="ignore"),
    }
    return _markdown(pd.DataFrame(columns).fillna("unknown"))


def _number(value):
    """Return a number with two digits, without an exponent if it is below a million."""
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def _markdown(table, **options):
    """Return a table as Markdown."""
    return table.to_markdown(disable_numparse=True, **options)
