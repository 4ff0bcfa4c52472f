"""Which tests reach a line, and how long they take: recorded once with coverage, then looked up.

Compiled kernels cannot be traced. Tests that are quick are therefore recorded once more with
kernels that run as plain Python ("plain"); most mutants of a kernel die there, uncompiled.
"""

import ast
import contextlib
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import coverage

from tests.mutants.mutations import ROOT

#: Tests that take less are recorded with plain kernels too; so long may they take then, in seconds.
QUICK, LONGEST_PLAIN = 0.2, 2.0
KERNELS = "gearlib/kernels/"
PARTS = ("compiled", "plain")
PLAIN = {"NUMBA_DISABLE_JIT": "1"}
#: They plant faults themselves, or kill what runs.
LEFT_OUT = ("tests/faults", "tests/mutants", "tests/robustness", "tests/slurm")
_SETTINGS = """
[run]
data_file = {folder}/coverage
parallel = true
patch = subprocess, fork
include =
    */gearlib/*
    */workflow/*
omit =
    */site-packages/*
"""


#: Tests of what coverage does not see: rules, and scripts in processes of Snakemake.
_OF_THE_WORKFLOW = ("tests/workflow", "tests/unit/test_captions", "tests/unit/test_cases")


class Reach:
    """What was recorded: tests as they are ("compiled"), and those with plain kernels."""

    def __init__(self, recorded):
        self.recorded = recorded
        self.width = Counter()
        for part in PARTS:
            names = recorded.get(part, {}).get("tests", ())
            for lines in recorded.get(part, {}).get("lines", {}).values():
                self.width.update({names[i] for tests in lines.values() for i in tests})

    def worth(self, tests):
        """Return tests, with their seconds, in their order: first quick ones that reach little."""
        key = {name: (seconds + 0.02) * self.width[name] for name, seconds in tests.items()}
        return {name: tests[name] for name in sorted(tests, key=key.get)}

    def tests(self, one, kernels="compiled"):
        """Return the tests that reach the lines of a mutation, with their seconds.

        Lines that run when a module is imported are reached by all that reach the module.
        """
        known = self.recorded[kernels]["seconds"]
        reached = {name for part in PARTS for name in self._reached(part, one)}
        found = self.worth({name: known[name] for name in sorted(reached) if name in known})
        if one.file.startswith("workflow/"):
            found |= self.of(_OF_THE_WORKFLOW)
        if kernels == "compiled" and one.file.startswith(KERNELS):
            # Many are too slow to reach it as plain Python.
            callers = {name for file in _callers(one.file) for name in self._of_file(file)}
            found |= self.worth({name: known[name] for name in sorted(callers) if name in known})
        return found

    def _of_file(self, file):
        part = self.recorded["compiled"]
        tests = {i for names in part["lines"].get(file, {}).values() for i in names}
        return [part["tests"][i] for i in tests]

    def _reached(self, part, one):
        if part not in self.recorded:
            return []
        names, lines = self.recorded[part]["tests"], self.recorded[part]["lines"].get(one.file, {})
        found = {test for n in range(one.line, one.last + 1) for test in lines.get(str(n), ())}
        if _at_import(one):
            found = set()
        return [names[i] for i in found or {test for tests in lines.values() for test in tests}]

    def of(self, start):
        """Return all tests, with their seconds, whose names begin so."""
        known = self.recorded["compiled"]["seconds"]
        return self.worth({name: known[name] for name in known if name.startswith(start)})

    def whole_files(self, tests):
        """Return all tests of the files of some: what one keeps in memory the others use."""
        # Each figure by itself.
        paths = {test.partition("::")[0] for test in tests} - {"tests/golden/test_drawn.py"}
        known = self.recorded["compiled"]["seconds"]
        return self.worth({name: known[name] for name in known if name.partition("::")[0] in paths})


def reach(path, tests=(), workers=2, plain=False):
    """Return what is recorded in a file, for the texts as they are; record what is missing there.

    Parameters
    ----------
    path : pathlib.Path
    tests : sequence of str, optional
        Files or folders of tests; by default all.
    workers : int, optional
        Processes that record.
    plain : bool, optional
        Whether kernels are asked for.
    """
    wanted = {"tests": sorted(tests), "texts": _hash()}
    recorded = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    if recorded.get("of") != wanted:
        chosen = [*tests] or [part for name in LEFT_OUT for part in ("--ignore", name)]
        recorded = {"of": wanted, "compiled": record([chosen], 600.0, workers)}
    if plain and "plain" not in recorded:
        seconds = recorded["compiled"]["seconds"]
        quick = {name for name in seconds if seconds[name] < QUICK and name.startswith(_NUMERICAL)}
        chosen = sorted({name.partition("::")[0] for name in quick})
        # One by one: threads that a test has left behind can wait for ever.
        chosen = [[name] for name in chosen]
        recorded["plain"] = record(chosen, LONGEST_PLAIN, 1, PLAIN, quick, 300.0)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(recorded), encoding="utf-8")
    return Reach(recorded)


_NUMERICAL = ("tests/geometry", "tests/physics", "tests/proofs", "tests/trains", "tests/unit")


def record(runs, longest, workers, environment=(), only=(), most=None):
    """Run tests with coverage; return their seconds and the tests of each line of each file.

    Parameters
    ----------
    runs : sequence of list of str
        Arguments of pytest, one process after the other.
    longest : float
        Seconds after which a test is given up.
    workers : int
    environment : dict, optional
    only : set of str, optional
        Tests that count; by default all.
    most : float, optional
        Seconds after which a process is given up, with all its tests.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "settings").write_text(_SETTINGS.format(folder=name), encoding="utf-8")
        (folder / "only.json").write_text(json.dumps(sorted(only)), encoding="utf-8")
        more = {
            "COVERAGE_PROCESS_START": str(folder / "settings"),
            "MUTANTS_FOLDER": name,
            "MUTANTS_SECONDS": str(longest),
        }
        spread = ["-n", str(workers), "--dist", "loadfile"] if workers > 1 else ["-p", "no:xdist"]
        command = [sys.executable, "-m", "pytest", "-p", "tests.mutants.recorder", *spread]
        given = {"cwd": ROOT, "env": os.environ | more | dict(environment), "stdout": sys.stderr}
        for run in runs:
            with contextlib.suppress(subprocess.TimeoutExpired):
                subprocess.run([*command, *run], **given, timeout=most, check=False)
        return _gathered(folder)


def _gathered(folder):
    seconds, names, lines = {}, {}, {}
    for path in folder.glob("*.seconds.json"):
        seconds |= json.loads(path.read_text(encoding="utf-8"))
    for path in folder.glob("coverage.*"):
        data = coverage.CoverageData(str(path))
        try:
            data.read()
        except coverage.exceptions.DataError:
            # Of a process that is just ending; what tests saw is in the files of the workers.
            continue
        for file in data.measured_files():
            # Of the checkout, or of a copy of it on which Snakemake ran.
            found = re.search(r"(?:.*/)?((?:gearlib|workflow)/.*)", file)
            if found is None or not (ROOT / found[1]).is_file():
                continue
            of_file = lines.setdefault(found[1], {})
            for line, contexts in data.contexts_by_lineno(file).items():
                for test in contexts:
                    if test in seconds or test.startswith("tests/"):
                        at = names.setdefault(test, len(names))
                        of_file.setdefault(str(line), set()).add(at)
    for of_file in lines.values():
        for line, tests in of_file.items():
            of_file[line] = sorted(tests)
    return {"tests": list(names), "seconds": seconds, "lines": lines}


def _at_import(one):
    """Return whether a mutation lies outside the bodies of all functions."""
    if not one.file.endswith(".py"):
        return False
    nodes = ast.walk(ast.parse((ROOT / one.file).read_text(encoding="utf-8")))
    functions = (node for node in nodes if isinstance(node, ast.FunctionDef))
    return not any(node.body[0].lineno <= one.line <= node.end_lineno for node in functions)


def _callers(kernel):
    """Return the files outside of the kernels that import one, or what imports it."""
    texts = {path: path.read_text(encoding="utf-8") for path in ROOT.glob("gearlib/**/*.py")}
    texts = {path.relative_to(ROOT).as_posix(): text for path, text in texts.items()}
    found, waiting = set(), [kernel]
    while waiting:
        parent, _, name = waiting.pop().removesuffix(".py").replace("/", ".").rpartition(".")
        named = re.compile(rf"{parent}\.{name}\b|from {parent} import [^\n]*\b{name}\b")
        new = {file for file, text in texts.items() if named.search(text)} - found
        found |= new
        waiting += [file for file in new if file.startswith(KERNELS)]
    return {file for file in found if not file.startswith(KERNELS)}


def _hash():
    digest = hashlib.sha256()
    for folder in ("gearlib", "workflow", "tests"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if not path.is_relative_to(ROOT / "tests/mutants"):
                digest.update(path.read_bytes())
    return digest.hexdigest()
