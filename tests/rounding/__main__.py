"""What follows from rounding is no result: everything computed again from starts 1e-12 beside.

``python -m tests.rounding`` runs the whole workflow twice, or the small one with ``--small``, the
second time with `tests/rounding/moved` in every process, and says what is not the same in datasets
and tables. Results that are there already are taken with ``--results FOLDER``; they are those of
the same sources and configuration. With ``--moved FOLDER`` nothing is run at all.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.rounding import comparison
from tests.workflow.forked import SNAKEMAKE
from tests.workflow.project import project_copy, small_project

MOVED = Path(__file__).with_name("moved")
#: Compared: datasets, tables, certificates. Wall times are not.
_KINDS = ("*.nc", "*.csv", "certificates.json")
#: Wall times; and errors of methods against references of these very starts, on problems that begin
#: on a flank line: what such a method makes of the last digit is what they show.
_MEASURED = ("times_", "benchmarks", "work_precision", "steady_orbit", "failures", "gradients")


def moved_environment():
    """Return the environment of processes whose starts are moved."""
    paths = [str(MOVED), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}


def compared(one, other):
    """Return a sentence for all that is not the same in two folders of results."""
    names = sorted(
        str(path.relative_to(one))
        for kind in _KINDS
        for path in Path(one).rglob(kind)
        if not any(word in str(path.relative_to(one)) for word in _MEASURED)
    )
    lost = [name for name in names if not Path(other, name).exists()]
    sentences = [f"{name}: is missing" for name in lost]
    for name in names:
        if name not in lost:
            sentences += comparison.files_differ(name, Path(one, name), Path(other, name))
    return sentences, len(names)


def _computed(folder, small, environment):
    """Return the results of the workflow in a new folder."""
    project = small_project(folder) if small else project_copy(folder)
    command = [SNAKEMAKE, "-j2", "--quiet", "all"]
    subprocess.run(command, cwd=project.folder, env=environment, check=True)
    return project / "results"


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.rounding", description=__doc__)
    parser.add_argument("--small", action="store_true", help="the small configuration of the tests")
    parser.add_argument("--results", type=Path, help="results that are there already")
    parser.add_argument("--moved", type=Path, help="those from moved starts too")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        one = given.results or _computed(Path(folder) / "one", given.small, os.environ)
        other = given.moved or _computed(Path(folder) / "two", given.small, moved_environment())
        sentences, count = compared(one, other)
    print(*sentences, f"{count} files compared, {len(sentences)} differences", sep="\n")
    sys.exit(bool(sentences))


if __name__ == "__main__":
    main()
