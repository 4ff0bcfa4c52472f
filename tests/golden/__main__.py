"""Renew the golden data and the stored pictures of figures: `make golden`.

It runs the small workflow of tests/workflow in a temporary folder, prints what has changed and
replaces only that.
"""

import tempfile
from pathlib import Path

from tests.golden import data, figures, plots
from tests.workflow.project import run_recorded


def renew_numbers(results):
    """Replace golden data that differ from the folder `results`, and print the differences."""
    names = data.dataset_names(results)
    for name in names:
        dataset = data.read_compared_data(results / name)
        if (data.FOLDER / name).exists():
            changes = data.describe_differences(name, data.read(name), dataset)
        else:
            changes = [f"{name}: new"]
        if changes:
            print(*changes, sep="\n")
            data.write(dataset, data.FOLDER / name)
    for path in data.FOLDER.rglob("*.nc"):
        if str(path.relative_to(data.FOLDER)) not in names:
            print(f"{path.relative_to(data.FOLDER)}: removed")
            path.unlink()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        project, _, records = run_recorded(Path(temporary) / "small")
        renew_numbers(project / "results")
        figures.renew(figures.draw(Path(temporary) / "drawn", records))
        for name in plots.PLOTS:
            plots.draw(name, Path(temporary))
        figures.renew(Path(temporary), plots.FOLDER)
