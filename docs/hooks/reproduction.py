"""The table of `reproduction.md`: the paper's sentence, ours, the verdict, why.

Statements, numbers and verdicts are those of `docs/claims/claims.csv`, a copy of what the workflow
writes. The reasons are prose, in `docs/claims/why.yaml`, with numbers from the copies of
`parametric_resonance.csv` and `certificates.csv`, and from `branches.csv`, the folds and grazings
of the branches. `labels.csv` says which motions from rest settle. After a run of the workflow,

    python -m docs.hooks.reproduction results

takes over the tables and the figures (smaller than the originals).
"""

import contextlib
import csv
import re
import sys
from pathlib import Path

import yaml

from gearlib.studies.claims.statements import CHECKS

FOLDER = Path(__file__).resolve().parents[1] / "claims"
IMAGES = FOLDER.with_name("images")
#: Table of the claims.
CLAIMS = "claims.csv"
#: Tables of the numbers in the reasons.
TONGUES, CERTIFICATES = "parametric_resonance.csv", "certificates.csv"
BRANCHES, LABELS = "branches.csv", "labels.csv"
#: Place of the table on the page; plain files have a sentence there.
PAGE, MARK = "reproduction.md", re.compile("<!-- claims -->.*?<!-- end -->", re.S)
#: Figures shown on the page, and on those of gear trains and of drawn gears.
PICTURES = (
    "reducer",
    "campbell",
    "mesh_stiffness",
    "fig2_phase_shift",
    "fig3_resonance",
    "fig4_contact_ratio",
    "fig5_phase_planes",
    "fig6_two_tunings",
    "fig6_jump",
    "fig7_damping",
    "fig8_six_degrees",
    "harris_map",
)
_WIDTH, _COLOURS = 1000, 64


def on_page_markdown(markdown, page, **_):
    """Put the table into the page."""
    if page.file.src_uri != PAGE:
        return markdown
    return MARK.sub(lambda _: table(), markdown)


def claims(folder=FOLDER):
    """Return the rows of the table of claims in a folder, refused if they are not the code's."""
    path = Path(folder) / CLAIMS
    found = _rows(path)
    have = [(row["id"], row["statement"], row["where"], row["figure"]) for row in found]
    if have != [check[:4] for check in CHECKS]:
        raise ValueError(
            f"{path} is not of this version of gearlib/studies/claims: run the workflow, then "
            "`python -m docs.hooks.reproduction results`"
        )
    return found


def _rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def reasons():
    """Return id -> why the verdict is what it is, with the numbers of the tables."""
    texts = yaml.safe_load((FOLDER / "why.yaml").read_text(encoding="utf-8"))
    known = tables()
    return {key: text.format(**known) for key, text in texts.items()}


def tables():
    """Return the tables that the reasons quote, each by damping.

    `tongue` has a row for each damping, `branches` the tunings of its folds and grazings, `proven`
    its certificates: ranges by their contacts, orbits by their tuning. All ascend with the tuning.
    """
    tongue = {row["damping"]: _numbers(row) for row in _rows(FOLDER / TONGUES)}
    proven, branches = {}, {}
    for row in sorted(map(_numbers, _rows(FOLDER / CERTIFICATES)), key=lambda row: row["tuning"]):
        at = "tuning" if row["claim"] == "orbit" else "contacts"
        kind = f"{row['claim']} {row[at]}".strip()
        proven.setdefault(row["damping"], {}).setdefault(kind, []).append(row)
    for row in map(_numbers, _rows(FOLDER / BRANCHES)):
        branches.setdefault(row["damping"], {}).setdefault(row["point"], []).append(row["tuning"])
    return {"tongue": tongue, "branches": branches, "proven": proven}


def _numbers(row):
    """Return a row with its numbers as such."""
    found = dict(row)
    for key, text in row.items():
        with contextlib.suppress(ValueError):
            found[key] = int(text) if text.isdigit() else float(text)
    return found


def table():
    """Return the table as Markdown."""
    why = reasons()
    lines = ["| | the paper | ours | verdict | why |", "|---|---|---|---|---|"]
    for row in claims():
        paper = f"{row['statement']} ({row['where']})"
        ours = f"{row['computed']} ([{row['figure']}](#{anchor(row['figure'])}))"
        reason = " ".join(why[row["id"]].split())
        lines.append(f"| {row['id']} | {paper} | {ours} | **{row['verdict']}** | {reason} |")
    return "\n".join(lines)


def anchor(figure):
    """Return the anchor of a figure on the page."""
    return figure.lower().replace(". ", "-")


def take_over(results):
    """Copy the claims and the figures of `results` into the documentation."""
    claims(results)
    for name in (CLAIMS, TONGUES, CERTIFICATES):
        (FOLDER / name).write_bytes((Path(results) / name).read_bytes())
    write_motions(Path(results))
    reasons()
    copy_pictures(results, PICTURES)


def write_motions(results):
    """Write the folds and grazings of the branches, and the labels of the motions from rest.

    Labels only at tunings that the certificates name.
    """
    from gearlib.analysis import trust
    from gearlib.analysis.orbits.special_points import FOLD, GRAZING
    from gearlib.data import storage
    from gearlib.data.files import write_table

    points, labels = [["damping", "point", "tuning"]], [["damping", "tuning", "label", "period"]]
    tunings = {float(row["tuning"]) for row in _rows(FOLDER / CERTIFICATES)}
    for path in sorted((results / "branches").glob("*.nc")):
        branch = storage.read(path).sortby("tuning")
        for name, label in (("fold", FOLD), ("grazing", GRAZING)):
            chosen = (branch.label == label) & (branch.period == 1)
            points += [[path.stem, name, f"{nu:.10g}"] for nu in branch.tuning.values[chosen]]
        motions = storage.read(results / "labels" / path.name)
        for nu, label, period in zip(motions.tuning, motions.label, motions.period, strict=True):
            if round(float(nu), 6) in tunings:
                labels.append([path.stem, f"{nu:.6g}", trust.LABELS[int(label)], int(period)])
    write_table(points, FOLDER / BRANCHES)
    write_table(labels, FOLDER / LABELS)


def copy_pictures(results, names):
    """Copy figures of `results`, made smaller, into the documentation."""
    from PIL import Image

    for name in names:
        with Image.open(Path(results) / "figures" / f"{name}.png") as picture:
            small = picture.convert("RGB")
            small.thumbnail((_WIDTH, 10 * _WIDTH))
            small = small.quantize(_COLOURS, dither=Image.Dither.NONE)
            small.save(IMAGES / f"{name}.png", optimize=True)


if __name__ == "__main__":
    take_over(sys.argv[1])
