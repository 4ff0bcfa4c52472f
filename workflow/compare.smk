"""The target `compare`: Fig. 3 of all cases, and of the projects named in `compare`, in one."""

import json
from pathlib import Path

from snakemake.exceptions import WorkflowError

import gearlib
from gearlib.config.experiments import Figures
from workflow.sources import listed, sources

DRAWN = Figures.model_validate(config.get("figures", {}) | {"colours": {}})
#: Label -> folder: those of this run, then others, which it does not compute.
COMPARED = {folder.name if folder.name != "results" else "paper": folder for folder in MACHINES}
OTHERS = {
    name: Path("results", "" if name == "paper" else name) for name in config.get("compare", [])
}


def compared(wildcards):
    """Return the characteristics that are laid over each other."""
    missing = [name for name, folder in OTHERS.items() if not (folder / "resonance.nc").exists()]
    if missing or len(COMPARED | OTHERS) < 2:
        lacking = f"{missing[0]} has no resonance.nc yet" if missing else "there is only one"
        raise WorkflowError(f"compare needs several cases or projects: {lacking}.")
    return [str(folder / "resonance.nc") for folder in (COMPARED | OTHERS).values()]


def names_compared(wildcards):
    """Return what the figure says below: whose gears each label is about."""
    known = {folder: own["name"] for folder, own in MACHINES.items() if own}
    found = []
    for label, folder in (COMPARED | OTHERS).items():
        path = folder / "gears.json"
        if folder not in known and path.exists():
            known[folder] = json.loads(path.read_text(encoding="utf-8"))["name"]
        found.append(f"{label}: {known.get(folder, 'unknown')}")
    return "; ".join(found)


rule compare:
    input:
        curves=compared,
        sources=listed(
            Path(workflow.basedir, "workflow/scripts/draw.py"),
            sources(
                Path(workflow.basedir, "workflow/scripts/draw.py"),
                Path(gearlib.__file__).parents[1],
                ["gearlib.figures.comparison_figure"],
            ),
        ),
    output:
        [f"{RESULTS}/figures/compare.{form}" for form in DRAWN.formats],
    log:
        f"{RESULTS}/logs/compare.log",
    params:
        draw="comparison_figure.draw",
        gears=names_compared,
        settings={"labels": [*(COMPARED | OTHERS)]},
        absent=[],
        dpi=DRAWN.dpi,
    conda:
        "envs/gearlib.yaml"
    script:
        "scripts/draw.py"
