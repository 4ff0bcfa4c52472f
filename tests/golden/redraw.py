"""Every figure drawn again from golden data, by the rules and scripts of the workflow itself.

What comes out depends on nothing but these data and on what draws: no motion has to be computed,
and no rounding of chaotic ones comes in between. Snakemake tells what the script of each job gets,
and one process runs them all: others' packages are most of the time that a job takes.
"""

import contextlib
import io
import os
import pickle
import runpy
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import matplotlib
import yaml

from gearlib.data import variables
from gearlib.figures import style
from tests.golden import data, drawn
from tests.workflow.project import ROOT, small_project

FOLDER = Path(__file__).with_name("drawn")

_LACKING = "golden data of a figure are lacking: `make golden` adds them"

#: In the project, the script that draws: it writes what it got.
_TELL = """
import pickle

named = [{key: value if isinstance(value, (str, int, dict)) else [*value]
          for key, value in part.items()} for part in (snakemake.input, snakemake.params)]
for path in snakemake.output:
    with open(path, "wb") as file:
        pickle.dump((*named, [*snakemake.output]), file)
"""


def redraw(folder, figures=()):
    """Draw figures, by default all.

    Parameters
    ----------
    folder : pathlib.Path
        For the project, whose results they are afterwards.
    figures : iterable of str
        Names of files below results/figures, without suffix.

    Returns
    -------
    dict of str to dict
        As of `drawn.read`, by name.
    """
    project = small_project(folder)
    # A colour that is no default: it shows whether that of the configuration is taken.
    project.configure(lambda settings: settings["figures"]["colours"].update(k1="#AA3377"))
    (project / "workflow/scripts/draw.py").write_text(_TELL)
    # What is not there would be computed, and this comes first.
    for script in ("compile_kernels.py", "compile_larger_kernels.py", "compile_train_kernels.py"):
        (project / "workflow/scripts" / script).write_text(f"raise SystemExit({_LACKING!r})")
    targets = [f"results/figures/{name}.png" for name in figures]
    if not targets:
        settings = yaml.safe_load((project / "config.yaml").read_text(encoding="utf-8"))
        targets = [f"results/figures/{name}.png" for name in settings["scenes"]]
        rules = project.snakemake("--list-rules").split()
        # Of measured sets there are no golden data.
        targets += [
            name
            for name in rules
            if name.startswith("draw_") and name != "draw_scene" and "measured" not in name
        ]
    _put_data(project)
    project.snakemake("-j2", *targets)
    found = sorted((project / "results/figures").glob("*.png"))
    with contextlib.chdir(project.folder):
        for job in {path.read_bytes() for path in found}:
            _draw(*pickle.loads(job))
    return {path.stem: drawn.load(path) for path in found}


def _draw(given, params, output):
    """Do one job of `workflow/scripts/draw.py`: write what figures hold instead of pictures."""

    def save(figure, path):
        with style.styled():
            # The layout is not read, and takes half of the time.
            figure.set_layout_engine("none")
            drawn.write(drawn.read(figure), path)
            # Whatever it holds can be drawn as vectors too; to embed whole fonts takes long.
            with matplotlib.rc_context({"pdf.fonttype": 3}):
                figure.savefig(io.BytesIO(), format="pdf")

    job = SimpleNamespace(input=given, params=SimpleNamespace(**params), output=output, log=[""])
    scripts = ROOT / "workflow/scripts"
    # Not by `mock.patch.dict`, which would forget all that is imported meanwhile.
    sys.modules["joblog"] = SimpleNamespace(redirect_output=lambda log: None)
    try:
        with (
            mock.patch.object(style, "save", save),
            mock.patch.object(sys, "path", [str(scripts), *sys.path]),
        ):
            runpy.run_path(str(scripts / "draw.py"), {"snakemake": job}, "__main__")
    finally:
        del sys.modules["joblog"]


def _put_data(project):
    """Lay golden data where the rules look for results."""
    for path in data.FOLDER.rglob("*.nc"):
        name = path.relative_to(data.FOLDER)
        data.write(data.read(name), project / "results" / name)
    for path in (project / "results").rglob("errors*.nc"):
        # Wall times, which are no golden data.
        one = data.read(path.relative_to(project / "results"))
        counted = {name: one[name] for name in one if str(name).endswith("_evaluations")}
        times = {
            name.replace("evaluations", "time"): (1e-6 + 1e-7 * count).drop_attrs()
            for name, count in counted.items()
        }
        times = variables.describe(one.assign(times | {"closed_form_time": 1e-6}))
        data.write(times, path.with_name(path.name.replace("errors", "times")))
    # One time for all, later than that of the sources: to Snakemake they are up to date.
    now = time.time()
    for path in (project / "results").rglob("*"):
        os.utime(path, (now, now))


def stored():
    """Return the names of the figures of which golden data are stored."""
    return sorted(path.stem for path in FOLDER.glob("*.json"))


def renew(found, figures=()):
    """Store what figures, by default all, hold where it differs; return sentences on what moved."""
    sentences = []
    FOLDER.mkdir(exist_ok=True)
    for name, facts in found.items():
        path = FOLDER / f"{name}.json"
        moved = [f"{name}: new"]
        if path.exists():
            moved = drawn.differences(name, drawn.load(path), facts)
        if moved:
            drawn.write(facts, path)
        sentences += moved
    for name in set() if figures else set(stored()) - set(found):
        (FOLDER / f"{name}.json").unlink()
        sentences.append(f"{name}: gone")
    return sentences
