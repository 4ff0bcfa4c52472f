"""Every figure of the small workflow drawn from golden data, against the stored pictures.

What a picture shows depends on these data, on the parameters of its job and on the code that draws:
no motion is computed, and no rounding of chaotic motions comes in between.
"""

import runpy
import shutil
import sys
from pathlib import Path

from matplotlib.testing.compare import compare_images
from matplotlib.testing.exceptions import ImageComparisonFailure

from gearlib.data import variables
from tests.golden import data
from tests.workflow.project import ROOT

FOLDER = Path(__file__).with_name("figures")

#: Largest root-mean-square difference of pixels (0 to 255). A changed dash of a line gives 1.5.
MAX_DIFFERENCE = 0.5


def draw(folder, records):
    """Draw the figures of all recorded jobs into `folder`, from golden data."""
    _write_results(folder / "results")
    scripts = ROOT / "workflow/scripts"
    sys.path.insert(0, str(scripts))
    try:
        draw_figures = runpy.run_path(str(scripts / "draw.py"))["draw_figures"]
    finally:
        sys.path.remove(str(scripts))
    for job in records:
        if job["script"] == "draw.py":
            files = {name: _below(folder, paths) for name, paths in job["input"].items()}
            draw_figures(files, _below(folder, job["output"]), **job["params"])
    return folder / "results/figures"


def _below(folder, paths):
    """Return a path, or a list of paths, below a folder."""
    return str(folder / paths) if isinstance(paths, str) else [str(folder / p) for p in paths]


def _write_results(results):
    """Write golden data to the places where the jobs expect their inputs."""
    for path in data.FOLDER.rglob("*.nc"):
        name = path.relative_to(data.FOLDER)
        data.write(data.read(name), results / name)
    for path in results.rglob("errors*.nc"):
        # Wall times are not part of golden data, and are made up from the numbers of evaluations.
        errors = data.read(path.relative_to(results))
        evaluations = [str(name) for name in errors if str(name).endswith("_evaluations")]
        times = {
            name.replace("evaluations", "time"): (1e-6 + 1e-7 * errors[name]).drop_attrs()
            for name in evaluations
        }
        times = variables.add_metadata(errors.assign(times | {"closed_form_time": 1e-6}))
        data.write(times, path.with_name(path.name.replace("errors", "times")))
    (results / "figures").mkdir()


def stored(folder=FOLDER):
    """Return the names of the stored pictures."""
    return sorted(path.stem for path in folder.glob("*.png"))


def difference(name, pictures, folder=FOLDER):
    """Return how a picture differs from the stored one of its name, or None if it does not."""
    if name not in stored(folder):
        return f"{name}: new"
    paths = folder / f"{name}.png", pictures / f"{name}.png"
    try:
        return compare_images(*paths, tol=MAX_DIFFERENCE)
    except ImageComparisonFailure as error:  # The pictures have different sizes.
        return f"{name}: {error}"


def renew(pictures, folder=FOLDER):
    """Replace stored pictures that differ from new ones, and print the changes."""
    folder.mkdir(exist_ok=True)
    for name in stored(pictures):
        if change := difference(name, pictures, folder):
            print(change)
            shutil.copy(pictures / f"{name}.png", folder)
