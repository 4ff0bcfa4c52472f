"""The target `compare`: Fig. 3 of all cases, and of the projects named in `compare`, in one."""

from pathlib import Path

import gearlib
from gearlib.config.experiments import Figures
from workflow import projects
from workflow.sources import listed, sources

SCRIPT = Path(workflow.basedir, "workflow/scripts/draw.py")
LIBRARY = Path(gearlib.__file__).parents[1]
DRAWN = Figures.model_validate(config.get("figures", {}) | {"colours": {}})
#: Label -> folder: those of this run, then others, which it does not compute.
COMPARED = {folder.name if folder.name != "results" else "paper": folder for folder in MACHINES}
OTHERS = {
    name: Path("results", "" if name == "paper" else name) for name in config.get("compare", [])
}


rule compare:
    input:
        curves=lambda wildcards: projects.compared(COMPARED, OTHERS),
        sources=listed(SCRIPT, sources(SCRIPT, LIBRARY, ["gearlib.figures.resonance_figure"])),
    output:
        [f"{RESULTS}/figures/compare.{form}" for form in DRAWN.formats],
    log:
        f"{RESULTS}/logs/compare.log",
    params:
        draw="resonance_figure.draw_cases",
        gears=lambda wildcards: projects.names_of(COMPARED | OTHERS, MACHINES),
        settings={"labels": [*(COMPARED | OTHERS)]},
        absent=[],
        dpi=DRAWN.dpi,
    conda:
        "envs/gearlib.yaml"
    script:
        "scripts/draw.py"
