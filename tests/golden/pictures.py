"""Pictures of the figures against those looked at last, by pytest-mpl: for people, no verdict.

Other versions of matplotlib or FreeType draw letters a little differently, so pictures inform and
the numbers behind them (data.py) decide.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).with_name("pictures")
ROOT = Path(__file__).resolve().parents[2]

#: The page that shows then, now and the difference of each picture.
PAGE = "fig_comparison.html"

#: Where the comparison, a process of its own, finds the results.
VARIABLE = "GEARLIB_RESULTS"


def pictures(results):
    """Return the figures as PNG, by name; those of wall times, never twice the same, left out."""
    paths = sorted((Path(results) / "figures").glob("*.png"))
    return {path.stem: path for path in paths if not path.stem.endswith("_time")}


def compare(results, report):
    """Write the page and the pictures that it shows into the folder `report`.

    Returns
    -------
    str
        A line for each picture that is gone, and what pytest printed, with a line for each that
        differs.
    """
    shutil.rmtree(report, ignore_errors=True)
    gone = {path.stem for path in FOLDER.glob("*.png")} - set(pictures(results))
    return "".join(f"{name}: gone\n" for name in sorted(gone)) + _pytest(
        results,
        "--mpl",
        "--mpl-generate-summary=html",
        f"--mpl-results-path={Path(report).resolve()}",
        f"--mpl-baseline-path={FOLDER}",
    )


def renew(results):
    """Keep the pictures of `results` as those to compare with."""
    with tempfile.TemporaryDirectory() as folder:
        printed = _pytest(results, f"--mpl-generate-path={folder}")
        made = sorted(Path(folder).glob("*.png"))
        if [path.stem for path in made] != sorted(pictures(results)):
            raise RuntimeError(f"not all pictures were made:\n{printed}")
        for path in FOLDER.glob("*.png"):
            path.unlink()
        for path in made:
            shutil.copyfile(path, FOLDER / path.name)


def _pytest(results, *options):
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "no:xdist"]
    script = Path(__file__).with_name("compare_pictures.py")
    done = subprocess.run(
        [*command, *options, "-c", os.devnull, "--rootdir", ROOT, script],
        cwd=ROOT,
        env=os.environ | {VARIABLE: str(Path(results).resolve()), "PYTEST_ADDOPTS": ""},
        capture_output=True,
        text=True,
    )
    return done.stdout + done.stderr
