"""The paper's statements, checked against computed data.

Every verdict follows from numbers by a stated rule, with the accuracy of the paper's plots. If a
strict criterion gives another answer, the verdict names both. A statement without data in the
configuration is "not evaluated". Statements P1 ... P13 are those of Hortel & Skuderova (2007).

`statements` lists them; `rules` has the data of one configuration and the rules that judge it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from gearlib.data.files import replacing
from gearlib.studies.claims.rules import Data, NoData
from gearlib.studies.claims.statements import CHECKS

HOLDS, DIFFERS, NOT_EVALUATED = "holds", "differs", "not evaluated"


@dataclass(frozen=True)
class Claim:
    """One statement of the paper, the computed result, and the verdict."""

    id: str
    statement: str
    where: str  #: place in the paper
    computed: str
    verdict: str
    figure: str  #: figure of the workflow


def evaluate(pair, dampings, resonance, phase_planes, phase_lag, jump, scenes) -> list[Claim]:
    """Check the 13 statements P1 to P13 of the paper against the data of a configuration.

    `pair` is the `GearPair`, whose damping is not used; `dampings` maps names to material_damping
    and backlash_damping (N s/m). The others are datasets: `resonance` has sweeps and `phase_planes`
    time histories for each damping, `phase_lag` has the lag of displacement behind stiffness,
    `jump` the tuning at which the motion from rest jumps to another orbit. `scenes` maps names that
    begin with a figure of the paper, such as "fig4_contact_ratio", to datasets of simulated cases.
    """
    resonance = resonance.sortby("tuning")
    data = Data(pair, dampings, resonance, phase_planes, phase_lag, jump, scenes)
    return [evaluate_check(check, data) for check in CHECKS]


def evaluate_check(check: tuple, data: Data) -> Claim:
    """Return a statement of the paper with the verdict of its rule.

    `check` is an entry of `CHECKS`: id, statement, place in the paper, figure of the workflow, and
    rule. The rule is called with `data`. It returns whether the statement holds at the resolution
    of the plots, the computed result as text, and optionally what a strict criterion gives instead.
    """
    identifier, statement, place, figure, rule = check
    try:
        holds, computed, *strict_results = rule(data)
        verdict = HOLDS if holds else DIFFERS
        if any(strict_results):
            verdict += f" at plot resolution; strictly {strict_results[0]}"
    except NoData as reason:
        verdict, computed = NOT_EVALUATED, str(reason)
    return Claim(identifier, statement, place, computed, verdict, figure)


def rows(claims: Sequence[Claim]) -> Iterator[tuple | list]:
    """Yield the rows of the table of claims: the names of the columns, then a row per claim."""
    yield [field.name for field in fields(Claim)]
    yield from map(astuple, claims)


def write_markdown(claims: Sequence[Claim], path: Path) -> None:
    """Write the claims as a Markdown table, replacing the file in one step."""
    lines = ["# Statements of the paper against computed data", ""]
    lines += ["| id | the paper | computed | verdict | figure |", "|---|---|---|---|---|"]
    for claim in claims:
        cells = [claim.id, f"{claim.statement} ({claim.where})", claim.computed]
        lines.append(f"| {' | '.join(cells)} | **{claim.verdict}** | {claim.figure} |")
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
