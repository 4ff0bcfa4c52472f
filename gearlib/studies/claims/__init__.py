"""The paper's statements, checked against computed data.

Every verdict follows from numbers by a stated rule, with the accuracy of the paper's plots;
nothing is typed in. Where a strict reading answers otherwise, the verdict names both. A statement
that differs stays in the table with its numbers; one for which the configuration has no data is
"not evaluated". Statements P1 ... P13 are those of Hortel & Skuderova (2007).

===================  =================================================
module               responsibility
===================  =================================================
``data``             the data of one configuration
``statements``       the statements and their rules
``characteristics``  rules on scales, characteristics and phase planes
``scene_claims``     rules on single runs
===================  =================================================
"""

from dataclasses import astuple, dataclass, fields

from gearlib.data.files import replacing
from gearlib.studies.claims.data import Data, NoData
from gearlib.studies.claims.statements import CHECKS

HOLDS, DIFFERS, OPEN = "holds", "differs", "not evaluated"


@dataclass(frozen=True)
class Claim:
    """One statement: what the paper says, what was computed, and the verdict."""

    id: str
    statement: str
    where: str
    computed: str
    verdict: str
    figure: str


def evaluate(
    pair,
    dampings,
    resonance,
    phase_planes,
    phase_lag,
    jump,
    scenes,
):
    """Return the claims P1-P13.

    pair (the gear pair; its damping is not used); dampings ({"material_damping": float,
    "backlash_damping": float}, the damping combinations, N s/m, by name); resonance, phase_planes:
    as gathered by `gearlib.data.gathering`; phase_lag: as computed by `gearlib.studies.phase_lag`;
    jump: as computed by `gearlib.studies.jump`; scenes (as computed by `gearlib.studies.scenes`, by
    name; P8 and P11-P13 look at those whose names begin with fig4, fig6, fig7, fig8).
    """
    resonance = resonance.sortby("tuning")
    data = Data(pair, dampings, resonance, phase_planes, phase_lag, jump, scenes)
    return [judge(check, data) for check in CHECKS]


def judge(check, data):
    """Return the claim of one statement."""
    identifier, statement, where, figure, rule = check
    try:
        holds, computed, *strictly = rule(data)
        verdict = HOLDS if holds else DIFFERS
        if strictly:
            verdict += f" at plot resolution; strictly {strictly[0]}"
    except NoData as reason:
        verdict, computed = OPEN, str(reason)
    return Claim(identifier, statement, where, computed, verdict, figure)


def rows(claims):
    """Yield the claims as a table, a row per statement."""
    yield [field.name for field in fields(Claim)]
    yield from map(astuple, claims)


def write_markdown(claims, path):
    """Write the claims as a Markdown table, replacing the file in one step."""
    lines = [
        "# Statements of the paper against computed data",
        "",
        "| id | the paper | computed | verdict | figure |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {c.id} | {c.statement} ({c.where}) | {c.computed} | **{c.verdict}** | {c.figure} |"
        for c in claims
    ]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
