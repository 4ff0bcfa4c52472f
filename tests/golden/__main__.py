"""Renew golden numbers and what figures hold of them: `make golden`.

Runs the small workflow of tests/workflow in a temporary folder, says what has moved and writes only
that: review the difference before it is committed, and say why in the commit. Results of a small
workflow that is there already are taken with ``--results FOLDER``; after a change of nothing but
figures, ``--drawn`` draws them again from the golden numbers, in a minute, or some of them in less.
"""

import argparse
import tempfile
from pathlib import Path

from tests.golden import data, redraw
from tests.workflow.project import small_project


def renew(results):
    """Write what differs from the golden data; print it."""
    names = data.datasets(results)
    for name in names:
        found = data.kept(results / name)
        known = (data.FOLDER / name).exists()
        moved = data.differences(name, data.read(name), found) if known else [f"{name}: new"]
        if moved:
            print(*moved, sep="\n")
            data.write(found, data.FOLDER / name)
    for path in data.FOLDER.rglob("*.nc"):
        if str(path.relative_to(data.FOLDER)) not in names:
            print(f"{path.relative_to(data.FOLDER)}: gone")
            path.unlink()
    renew_drawn()


def renew_drawn(figures=()):
    """Write what figures, by default all, hold where it differs; print it."""
    with tempfile.TemporaryDirectory() as folder:
        found = redraw.redraw(Path(folder) / "drawn", figures)
        print(*redraw.renew(found, figures), sep="\n")


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("--results", type=Path, help="results of a small workflow")
    parser.add_argument(
        "--drawn", nargs="*", metavar="figure", help="what figures hold, nothing else; default: all"
    )
    given = parser.parse_args()
    if given.drawn is not None:
        renew_drawn(given.drawn)
        return
    if given.results:
        renew(given.results)
        return
    with tempfile.TemporaryDirectory() as folder:
        project = small_project(Path(folder) / "small")
        project.snakemake("-j2")
        renew(project / "results")


if __name__ == "__main__":
    main()
