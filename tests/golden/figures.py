"""Every figure drawn from golden data by the workflow itself, against the stored pictures.

What a picture shows depends on these data and on the code that draws: no motion is computed, and no
rounding of chaotic motions comes in between.
"""

import os
import shutil
import time
from pathlib import Path

import yaml
from matplotlib.testing.compare import compare_images

from gearlib.data import variables
from tests.golden import data
from tests.workflow.project import small_project

FOLDER = Path(__file__).with_name("figures")

#: Root of the mean squared difference of pixels (0 to 255); another dash of one line gives 1.5.
MAX_DIFFERENCE = 0.5


def draw(folder, figures=()):
    """Draw figures, by default all, in a new project in `folder`; return the folder of pictures."""
    project = small_project(folder)

    def configure(settings):
        settings["figures"] |= {"formats": ["png"], "dpi": 60}
        # A colour that is no default shows whether that of the configuration is taken.
        settings["figures"]["colours"]["k1"] = "#AA3377"

    project.configure(configure)
    # Jobs that compute would come first: golden data of a new figure are missing.
    for script in ("compile_kernels.py", "compile_larger_kernels.py", "compile_train_kernels.py"):
        message = "golden data of a figure are missing: `make golden` adds them"
        (project / "workflow/scripts" / script).write_text(f"raise SystemExit({message!r})")
    targets = [f"results/figures/{name}.png" for name in figures]
    if not targets:
        settings = yaml.safe_load((project / "config.yaml").read_text(encoding="utf-8"))
        targets = [f"results/figures/{name}.png" for name in settings["scenes"]]
        rules = project.snakemake("--list-rules").split()
        # There are no golden data of measured sets.
        drawing = [rule for rule in rules if rule.startswith("draw_") and "measured" not in rule]
        targets += [rule for rule in drawing if rule != "draw_scene"]
    _write_results(project / "results")
    project.snakemake("-j2", *targets)
    return project / "results/figures"


def _write_results(results):
    """Write the golden data where the rules look for results, newer than all sources."""
    for path in data.FOLDER.rglob("*.nc"):
        name = path.relative_to(data.FOLDER)
        data.write(data.read(name), results / name)
    for path in results.rglob("errors*.nc"):
        # Wall times are no golden data: they follow from the numbers of evaluations.
        errors = data.read(path.relative_to(results))
        evaluations = [str(name) for name in errors if str(name).endswith("_evaluations")]
        times = {
            name.replace("evaluations", "time"): (1e-6 + 1e-7 * errors[name]).drop_attrs()
            for name in evaluations
        }
        times = variables.describe(errors.assign(times | {"closed_form_time": 1e-6}))
        data.write(times, path.with_name(path.name.replace("errors", "times")))
    now = time.time()
    for path in results.rglob("*"):
        os.utime(path, (now, now))


def stored():
    """Return the names of the stored pictures."""
    return sorted(path.stem for path in FOLDER.glob("*.png"))


def difference(name, pictures):
    """Return how the picture of a figure differs from the stored one, None where it does not."""
    stored_picture = FOLDER / f"{name}.png"
    if not stored_picture.exists():
        return f"{name}: new"
    return compare_images(stored_picture, pictures / f"{name}.png", tol=MAX_DIFFERENCE)


def renew(pictures):
    """Store pictures that differ from the stored ones; return what has changed."""
    names = sorted(path.stem for path in pictures.glob("*.png"))
    changes = {name: change for name in names if (change := difference(name, pictures))}
    FOLDER.mkdir(exist_ok=True)
    for name in changes:
        shutil.copy(pictures / f"{name}.png", FOLDER)
    return list(changes.values())
