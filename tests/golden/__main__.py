"""Renew golden numbers and pictures of figures: `make golden`.

Runs the small workflow of tests/workflow in a temporary folder, prints what has changed and writes
only that. After a change of nothing but figures, ``--drawn`` draws them again, all or those named,
from the golden numbers.
"""

import argparse
import tempfile
from pathlib import Path

from tests.golden import data, figures
from tests.workflow.project import small_project


def renew_numbers(results):
    """Write what differs from the golden data of these results, and print it."""
    names = data.datasets(results)
    for name in names:
        dataset = data.compared_part(results / name)
        if (data.FOLDER / name).exists():
            changes = data.differences(name, data.read(name), dataset)
        else:
            changes = [f"{name}: new"]
        if changes:
            print(*changes, sep="\n")
            data.write(dataset, data.FOLDER / name)
    for path in data.FOLDER.rglob("*.nc"):
        if str(path.relative_to(data.FOLDER)) not in names:
            print(f"{path.relative_to(data.FOLDER)}: gone")
            path.unlink()


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("--drawn", nargs="*", metavar="figure", help="renew pictures only")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if options.drawn is None:
            project = small_project(Path(folder) / "small")
            project.snakemake("-j2")
            renew_numbers(project / "results")
        pictures = figures.draw(Path(folder) / "drawn", options.drawn or ())
        print(*figures.renew(pictures), sep="\n")


if __name__ == "__main__":
    main()
