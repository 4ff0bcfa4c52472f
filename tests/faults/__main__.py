"""Plant faults one at a time and see whether the tests notice: `make faults`.

In a temporary copy of the tree, with a folder of its own for compiled kernels. First the tests
that are named have to pass there as they are. Names of faults or rooms, where given, choose.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.faults.faults import ROOT, faults

#: What is not needed to run tests, or large.
LEFT_OUT = (".git", ".venv", ".snakemake", "__pycache__", "build", "results", "site", "*.egg-info")


def copied(folder):
    """Return a copy of the tree."""
    copy = Path(folder) / "tree"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(*LEFT_OUT))
    return copy


def run(tree, tests, kernels=None):
    """Run tests in a tree; return pytest's exit status and what it printed."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTEST_ADDOPTS"}
    environment["PYTHONPATH"] = str(tree)
    # Of two texts of one size within a second the older one's bytecode would be taken.
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    if kernels:
        environment["NUMBA_CACHE_DIR"] = str(kernels)
    command = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", "-p", "no:xdist"]
    done = subprocess.run(
        [*command, *tests],
        cwd=tree,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    return done.returncode, done.stdout


def verdict(fault, tree):
    """Plant one fault and return what becomes of it, and a line of evidence."""
    path = tree / fault.file
    try:
        planted = fault.planted(tree)
    except ValueError as error:
        return "not plantable", str(error)
    sound = path.read_text(encoding="utf-8")
    path.write_text(planted, encoding="utf-8")
    try:
        with tempfile.TemporaryDirectory() as kernels:
            inside = fault.file.startswith("gearlib/kernels/")
            status, output = run(tree, fault.tests, kernels if inside else None)
    finally:
        path.write_text(sound, encoding="utf-8")
    failed = [line for line in output.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if status == 1 and failed:
        return "caught", failed[0].split(" - ")[0]
    last = output.strip().splitlines()[-1:] or [""]
    return "not caught", f"pytest ended with {status}: {last[0]}"


def main():
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="name", help="faults or rooms; default: all")
    parser.add_argument("--list", action="store_true", help="name the faults, run nothing")
    parser.add_argument("--planted-only", action="store_true", help="leave out the sound tests")
    given = parser.parse_args()
    known = faults()
    unknown = set(given.names) - {fault.name for fault in known} - {fault.room for fault in known}
    if unknown:
        parser.error(f"no such fault or room: {', '.join(sorted(unknown))}")
    names = set(given.names)
    chosen = [fault for fault in known if not names or names & {fault.name, fault.room}]
    if given.list:
        print(*(f"{fault.room}: {fault.name}" for fault in chosen), sep="\n")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(folder)
        if not given.planted_only:
            status, output = run(tree, sorted({test for fault in chosen for test in fault.tests}))
            if status:
                print(output, "Without any fault these tests have to pass.", sep="\n")
                return 1
        missed = 0
        for fault in chosen:
            start = time.monotonic()
            found, evidence = verdict(fault, tree)
            missed += found != "caught"
            seconds = time.monotonic() - start
            print(f"{found:13} {seconds:4.0f} s  {fault.room}: {fault.name}", flush=True)
            print(f"{'':21} {evidence}", flush=True)
    print(f"{len(chosen) - missed} of {len(chosen)} faults caught")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
