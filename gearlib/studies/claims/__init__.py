"""The paper's statements, checked against computed data.

Every verdict follows from numbers by a stated rule, with the accuracy of the paper's plots. If a
strict criterion gives another answer, the verdict names both. A statement without data in the
configuration is "not evaluated". Statements P1 ... P13 are those of Hortel & Skuderova (2007).

===================  =================================================
module               responsibility
===================  =================================================
``data``             the data of one configuration
``statements``       the statements and their rules
``characteristics``  rules on scales, characteristics and phase planes
``scene_claims``     rules on single runs
===================  =================================================
"""

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import xarray as xr

from gearlib.data.files import replacing
from gearlib.studies.claims.data import Data, NoData
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


def evaluate(
    pair: Any,
    dampings: dict[str, dict],
    resonance: xr.Dataset,
    phase_planes: xr.Dataset,
    phase_lag: xr.Dataset,
    jump: xr.Dataset,
    scenes: dict[str, xr.Dataset],
) -> list[Claim]:
    """Return the claims P1 to P13, judged on the data of a configuration.

    `pair` is the `GearPair`, whose damping is not used; `dampings` maps names to material_damping
    and backlash_damping (N s/m). The datasets are those of the targets of these names, scenes by
    name; P8 and P11 to P13 use scenes whose names begin with fig4, fig6, fig7 and fig8.
    """
    resonance = resonance.sortby("tuning")
    data = Data(pair, dampings, resonance, phase_planes, phase_lag, jump, scenes)
    return [judge(check, data) for check in CHECKS]


def judge(check: tuple, data: Data) -> Claim:
    """Return the claim of one statement; `check` is an entry of `CHECKS` with its rule."""
    identifier, statement, where, figure, rule = check
    try:
        holds, computed, *strict_differences = rule(data)
        verdict = HOLDS if holds else DIFFERS
        if strict_differences:
            verdict += f" at plot resolution; strictly {strict_differences[0]}"
    except NoData as reason:
        verdict, computed = NOT_EVALUATED, str(reason)
    return Claim(identifier, statement, where, computed, verdict, figure)


def rows(claims: Sequence[Claim]) -> Iterator[tuple | list]:
    """Yield the rows of the table of claims: the names of the columns, then a row per claim."""
    yield [field.name for field in fields(Claim)]
    yield from map(astuple, claims)


def write_markdown(claims: Sequence[Claim], path: Path) -> None:
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
