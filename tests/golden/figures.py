"""Draw every figure of the small workflow from golden data and compare it with a stored picture.

A picture depends only on golden data, the parameters of its job and the drawing code. No motion is
computed, so that rounding errors of chaotic motions cannot change a picture.
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

#: Largest root-mean-square difference of pixels (0 to 255); a changed dash of a line
#: gives 1.5.
MAX_DIFFERENCE = 0.5


def draw(folder, records):
    """Draw the figures of all recorded jobs from golden data and return their folder."""
    _write_results(folder / "results")
    scripts = ROOT / "workflow/scripts"
    sys.path.insert(0, str(scripts))
    # The script imports modules that lie beside it.
    try:
        draw_figures = runpy.run_path(str(scripts / "draw.py"))["draw_figures"]
    finally:
        sys.path.remove(str(scripts))
    for job in records:
        if job["script"] == "draw.py":
            files = {name: _in_folder(folder, paths) for name, paths in job["input"].items()}
            draw_figures(files, _in_folder(folder, job["output"]), **job["params"])
    return folder / "results/figures"


def _in_folder(folder, paths):
    """Return a path, or a list of paths, inside a folder."""
    if isinstance(paths, str):
        return str(folder / paths)
    return [str(folder / path) for path in paths]


def _write_results(results):
    """Write golden data to the paths from which the jobs read their inputs."""
    for path in data.FOLDER.rglob("*.nc"):
        name = path.relative_to(data.FOLDER)
        data.write(data.read(name), results / name)
    for path in results.rglob("errors*.nc"):
        # Wall times are not part of golden data. The pictures show invented times instead: 1 µs per
        # run and 0.1 µs per evaluation.
        errors = data.read(path.relative_to(results))
        evaluation_names = [str(name) for name in errors if str(name).endswith("_evaluations")]
        times = {
            name.replace("evaluations", "time"): (1e-6 + 1e-7 * errors[name]).drop_attrs()
            for name in evaluation_names
        }
        times = variables.add_metadata(errors.assign(times | {"closed_form_time": 1e-6}))
        data.write(times, path.with_name(path.name.replace("errors", "times")))
    (results / "figures").mkdir()


def stored_names(folder=FOLDER):
    """Return the sorted names of the stored pictures."""
    return sorted(path.stem for path in folder.glob("*.png"))


def describe_difference(name, pictures, folder=FOLDER):
    """Return a text on the difference of a picture from the stored one, or None if they match."""
    if name not in stored_names(folder):
        return f"{name}: new"
    stored_picture, new_picture = folder / f"{name}.png", pictures / f"{name}.png"
    try:
        return compare_images(stored_picture, new_picture, tol=MAX_DIFFERENCE)
    except ImageComparisonFailure as error:  # The pictures have different sizes.
        return f"{name}: {error}"


def renew(pictures, folder=FOLDER):
    """Replace stored pictures that differ from new ones, and print the changes."""
    folder.mkdir(exist_ok=True)
    for name in stored_names(pictures):
        if change := describe_difference(name, pictures, folder):
            print(change)
            shutil.copy(pictures / f"{name}.png", folder)
