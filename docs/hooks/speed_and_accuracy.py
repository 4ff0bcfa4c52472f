"""The numbers of `speed_and_accuracy.md`: tables and sentences, made from committed data.

After `make speed-and-accuracy`, or, where the peers are installed,

    python -m docs.hooks.speed_and_accuracy results

takes over data (docs/claims/speed_and_accuracy) and figures of a run of the workflow and renews the
blocks between ``<!-- computed: NAME -->`` and ``<!-- end -->`` of the page. A second argument is a
remark on the measurement of times, such as "other jobs ran beside it". A test holds the page to the
data.
"""

import csv
import math
import re
import statistics
import sys
from pathlib import Path

import numpy as np
import yaml

from docs.hooks.speed_and_accuracy_data import FOLDER, take_over
from gearlib.studies.scenes import DIFFERS

DOCS = Path(__file__).resolve().parents[1]
PAGE = DOCS / "speed_and_accuracy.md"
#: Accuracies of the table of times.
ACCURACIES = (1e-3, 1e-6, 1e-9, 1e-12)

#: What is difficult -> (its problems, why methods fail).
DIFFICULTIES = {
    "contact changes within a step": (
        "graze_short_6 graze_past_6 graze_short_10 graze_past_10 tiny_bounce double_crossing",
        "States at the ends of steps do not show a flank line that is crossed and crossed back in "
        "between. A method has to find every crossing within its steps.",
    ),
    "unusual backlash": (
        "rest_near rest_far no_backlash nano_backlash endless_backlash",
        "A step across a crossing treats two laws of motion as one and loses its order: only tight "
        "tolerances or short steps help.",
    ),
    "extreme parameters": (
        "critical overdamped soft ratio_1 ratio_2 ratio_above_1 ratio_below_2 slow fast",
        "Default tolerances and few steps leave errors above the required 1e-4; fixed steps become "
        "unstable where contact oscillates or decays fast.",
    ),
    "other models": (
        "cubic_damping terms_2 terms_200 stiff_bearings",
        "Strong cubic damping makes fixed explicit steps unstable.",
    ),
    "long runs": (
        "fold_below fold_above chaos conservative",
        "Numerical damping and small errors of the state decide between coexisting orbits, and "
        "change the energy of a motion without damping.",
    ),
    "parametric resonance": (
        "tongue_2 edge_2 tongue_066 edge_066",
        "Numerical damping, or its opposite, changes the Floquet multipliers, by which every error "
        "of the orbit grows or decays.",
    ),
    "gear trains": (
        "planets_at_once planets_apart planets_alike",
        "Equal planets lose and gain contact at the same instant, and a method has to handle all "
        "of these changes.",
    ),
}


def read(name):
    """Return the rows of a committed table."""
    with (FOLDER / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def number(value):
    """Return a number with two digits, as on the page."""
    return f"{value:.1e}".replace("e-0", "e-") if value < 1e-3 else f"{value:.2g}"


def count(value):
    """Return a number of evaluations or a time, without an exponent below a million."""
    return f"{value:.0f}" if value >= 100 else f"{value:.2g}"


def names(values):
    """Return names as code, in the order of their first appearance, joined."""
    return ", ".join(f"`{name}`" for name in dict.fromkeys(values)) or "none"


def table(head, rows):
    """Return a table as Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("|" + "|".join(map(str, line)) + "|" for line in lines)


def points():
    """Return the points of the work-precision diagrams, numbers as floats."""
    found = read("work_precision")
    for row in found:
        for key in ("state_error", "evaluations", "microseconds"):
            row[key] = float(row[key] or "nan")
    return found


def _fastest(rows, problem, accuracy, own):
    """Return the fastest setting within an accuracy; None: there is none."""
    able = [
        row
        for row in rows
        if row["problem"] == problem
        and (row["own"] == "yes") == own
        and row["state_error"] <= accuracy * (1 + 1e-9)
        and row["microseconds"] > 0.0
    ]
    return min(able, key=lambda row: row["microseconds"], default=None)


def machine():
    """Return where and how times were measured."""
    facts = yaml.safe_load((FOLDER / "machine.yaml").read_text(encoding="utf-8"))
    versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    text = (
        f"Computed on {facts['date']} with {versions}. Wall times: {facts['processor']}, one of "
        f"{facts['cores']} cores, one thread, the "
        f"shortest of up to {facts['repeats']} runs."
    )
    if facts["remark"]:
        text += f" Remark: {facts['remark']}; times are comparable with each other only."
    if facts["absent"]:
        text += f" Not installed, and therefore missing: {names(facts['absent'])}."
    return text


def times():
    """Return who is fastest at which accuracy."""
    rows = points()
    problems = list(dict.fromkeys(row["problem"] for row in rows))
    body, ratios, single = [], [], 0
    for problem in problems:
        cells = []
        for accuracy in ACCURACIES:
            own, other = (_fastest(rows, problem, accuracy, mine) for mine in (True, False))
            if own is None:
                cells.append("–")
                continue
            cell = f"`{own['line']}` {count(own['microseconds'])} µs"
            if other is None:
                single += 1
                cells.append(f"{cell}; no other")
                continue
            ratios.append(other["microseconds"] / own["microseconds"])
            cells.append(f"{cell}; `{other['line']}` {count(ratios[-1])} ×")
        body.append([f"`{problem}`", *cells])
    text = (
        f"gearlib's fastest method is ahead in {sum(ratio > 1.0 for ratio in ratios)} of the "
        f"{len(ratios)} cells in which another package reaches the accuracy, {count(min(ratios))} "
        f"to {count(max(ratios))} times, {count(statistics.median(ratios))} times in the median; "
        f"in {single} cells no other package reaches it."
    )
    head = ["", *(f"within {accuracy:.0e}".replace("-0", "-") for accuracy in ACCURACIES)]
    return f"{table(head, body)}\n\n{text}"


def evaluations():
    """Return what each method costs in evaluations, and how far it comes."""
    rows = points()
    problems = list(dict.fromkeys(row["problem"] for row in rows))
    lines = list(dict.fromkeys(row["line"] for row in rows))
    least = {}
    for line in lines:
        for problem in problems:
            mine = [row for row in rows if (row["line"], row["problem"]) == (line, problem)]
            errors = [row["state_error"] for row in mine if not math.isnan(row["state_error"])]
            if errors:
                able = [row["evaluations"] for row in mine if row["state_error"] <= 1e-6]
                least[line, problem] = min(able, default=math.inf), min(errors)
    taylor = [least["taylor", problem] for problem in problems if ("taylor", problem) in least]
    exact = [least["exact", problem][1] for problem in problems if ("exact", problem) in least]
    fixed = ("rk4", "newmark", "generalised alpha")
    short = [line for line in fixed if math.isinf(least[line, "bouncing"][0])]
    most = max(int(row["knob"].split("= ")[1]) for row in rows if row["line"] in fixed)
    return (
        "The closed forms of `exact` evaluate no right-hand side; their errors are "
        f"{number(min(exact))} to {number(max(exact))}. `taylor`, which takes nonlinear meshes "
        f"too, needs {count(min(cost for cost, _ in taylor))} to "
        f"{count(max(cost for cost, _ in taylor))} evaluations per mesh period for 1e-6. On "
        "`bouncing`, where contact is lost, step control without events (`rk45`) needs "
        f"{count(least['rk45', 'bouncing'][0])} against {count(least['taylor', 'bouncing'][0])} "
        f"of `taylor`; the fixed steps of {names(short)} do not reach 1e-6 with up to {most} "
        "steps per mesh period. Smoothing the contact (`smoothed`) costs "
        f"{count(least['smoothed', 'bouncing'][0])} evaluations."
    )


def short():
    """Return the conclusions."""
    rows = read("failures")
    right = {
        trial: f"{column.count('right')} of {len(column) - column.count('refused')}"
        for trial in list(rows[0])[1:]
        for column in [[row[trial] for row in rows]]
    }
    rows = points()
    ours = [
        _fastest(rows, problem, accuracy, True)
        for problem in dict.fromkeys(row["problem"] for row in rows)
        for accuracy in ACCURACIES
    ]
    # Of the gear train nothing is known below 1e-11.
    first = [one["line"] for one in ours if one]
    default = sum(line in ("exact", "taylor") for line in first)
    scenes = [row for row in read("models") if row["chosen"] == "yes"]
    small = [row for row in scenes if row["model"] == "one_degree"]
    conclusions = (
        "**Which method.** Take the default: `exact` for linear damping and "
        "rectangular stiffness, `taylor` for the rest. Both locate every gain and loss of "
        f"contact, reach rounding errors and are right on {right['exact']} and {right['taylor']} "
        f"of the difficult problems that they take. In {default} of the {len(first)} cells of the "
        "table of times below they are gearlib's fastest, whatever the accuracy.",
        "**Other packages.** heyoka, whose Taylor steps locate events too, is right on "
        f"{right['heyoka']}; DOP853 stopped at every event, at tight tolerances, on "
        f"{right['DOP853-split']}. With default settings scipy's `solve_ivp` is right on "
        f"{right['scipy-RK45']} and the pair of MATLAB's ode45 on {right['rk45']}.",
        "**Fixed steps** lose their order, because neither the switches of the stiffness nor "
        "the changes of contact are ends of steps: `rk4` converges with order "
        f"{_order('rk4'):.1f} on `bouncing`. With 2000 steps per mesh period it is right on "
        f"{right['rk4-2000']}, with 200 on {right['rk4-200']}. Near instability tongues fixed "
        "steps invent motion or hide it.",
        f"**Which model.** One degree of freedom suffices for {len(small)} of {len(scenes)} scenes "
        "of the paper; the other scene shows bearings and friction.",
    )
    return "\n".join(f"- {one}" for one in conclusions)


def _order(line, problem="bouncing"):
    """Return the order with which the error of a line falls over its evaluations."""
    mine = [row for row in points() if (row["line"], row["problem"]) == (line, problem)]
    cost, error = (np.log([row[key] for row in mine]) for key in ("evaluations", "state_error"))
    return -np.polyfit(cost, error, 1)[0]


def failures():
    """Return which methods are right on which kind of problem, and why the others fail."""
    rows = read("failures")
    trials = list(rows[0])[1:]
    kinds = {kind: words.split() for kind, (words, _) in DIFFICULTIES.items()}
    verdict = {(row["problem"], trial): row[trial] for row in rows for trial in trials}
    body = []
    for trial in trials:
        cells = []
        for problems in kinds.values():
            given = [verdict[problem, trial] for problem in problems]
            taken = len(given) - given.count("refused")
            cells.append(f"{given.count('right')}/{taken}" if taken else "–")
        body.append([f"`{trial}`", *cells])
    parts = [table(["right", *kinds], body)]
    perfect = [
        t for t in trials if {verdict[r["problem"], t] for r in rows} <= {"right", "refused"}
    ]
    parts.append(f"Right on every problem that they take: {names(perfect)}.")
    parts += [f"- **{kind.capitalize()}.** {why}" for kind, (_, why) in DIFFICULTIES.items()]
    return "\n\n".join(parts[:2]) + "\n\n" + "\n".join(parts[2:])


def models():
    """Return which model each scene needs."""
    rows = read("models")
    body = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        mine = {row["model"]: row for row in rows if row["scene"] == scene}
        one = next(row for row in mine.values() if row["chosen"] == "yes")
        tolerance = float(one["tolerance"])
        change = math.inf if one["change"] == DIFFERS else float(one["change"])
        if math.isnan(change):
            why = "no larger model"
        elif not change:
            why = "larger models change nothing"
        elif math.isinf(change):
            why = "by how much larger models change, rounding decides"
        elif change <= tolerance:
            why = f"larger models change {number(change)}, allowed are {tolerance:g}"
        else:
            why = f"chosen by hand: larger models change {number(change)}, more than {tolerance:g}"
        costs = [row["cost"] for row in mine.values()]
        times = DIFFERS
        if DIFFERS not in costs:
            times = count(max(map(float, costs)) / float(one["cost"])) + " ×"
        body.append([f"`{scene}`", f"`{one['model']}`", why, times])
    return table(["scene", "model", "why it suffices", "cost of the dearest model"], body)


BLOCKS = {
    "machine": machine,
    "short": short,
    "times": times,
    "evaluations": evaluations,
    "failures": failures,
    "models": models,
}


def renewed(text):
    """Return the page with the blocks that follow from the committed data."""
    for name, made in BLOCKS.items():
        block = f"<!-- computed: {name} -->\n\n{made()}\n\n<!-- end -->"
        pattern = rf"<!-- computed: {name} -->.*?<!-- end -->"
        text, found = re.subn(pattern, lambda _, block=block: block, text, flags=re.S)
        if found != 1:
            raise ValueError(f"{PAGE.name} has {found} blocks `{name}`, not one")
    return text


if __name__ == "__main__":
    take_over(*sys.argv[1:])
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
