"""Targets of the Makefile, run with stand-ins for their tools that print their arguments."""

import importlib
import os
import re
import shlex
import shutil
import subprocess
import tomllib

import pytest

from tests.workflow.project import ROOT

MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = re.search(r"^\.PHONY: (.*?[^\\])$", MAKEFILE, re.M | re.S)[1].replace("\\\n", " ").split()
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
    "optional-dependencies"
]
CHECKS = ["ruff", "ruff", "snakefmt", "lint-imports", "mypy"]
#: Tools that a target calls in this order; other targets call python once.
TOOLS_OF_TARGETS = {
    "all": ["snakemake"],
    "lint": CHECKS,
    "test": [*CHECKS, "python", "python"],
    "couple-test": ["python", "python"],
    "report": ["snakemake", "snakemake"],
    "docs": ["mkdocs", "python"],
    "speed-and-accuracy": ["snakemake", "python"],
    "clean": [],
    "distclean": [],
}


def run_target(folder, target):
    """Run a target of the Makefile with stand-ins for its tools and return the output.

    A stand-in prints "ran", its name and its arguments.
    """
    tools = folder / ".venv/bin"
    tools.mkdir(parents=True)
    # apt-get has a stand-in, too, because it would install Slurm on this machine.
    for name in {*TOOLS_OF_TARGETS.get(target, ["python"]), "apt-get"}:
        (tools / name).write_text('#!/bin/sh\necho "ran $(basename "$0") $*"\n', encoding="utf-8")
        (tools / name).chmod(0o755)
    shutil.copy2(ROOT / "Makefile", folder)
    up_to_date = [".venv/installed.stamp", ".venv/testing.stamp", "build/config.schema.json"]
    # If make runs the tests, its variables must not reach the make that is tested.
    environment = {name: text for name, text in os.environ.items() if not name.startswith("MAKE")}
    environment["PATH"] = os.pathsep.join([str(tools), environment["PATH"]])
    return subprocess.run(
        ["make", *(f"--assume-old={name}" for name in up_to_date), target],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


@pytest.mark.parametrize(
    "target", [target for target in TARGETS if TOOLS_OF_TARGETS.get(target) != []]
)
def test_targets_name_modules_files_and_extras_that_exist(target, tmp_path):
    """Each target must call its tools with modules, files and extras that exist in the project."""
    calls = [
        shlex.split(call) for call in re.findall(r"^ran (.*)$", run_target(tmp_path, target), re.M)
    ]
    calls = [call for call in calls if call[0] != "apt-get"]
    assert [tool for tool, *_ in calls] == TOOLS_OF_TARGETS.get(target, ["python"])
    for tool, *arguments in calls:
        if tool == "python":
            module = arguments[arguments.index("-m") + 1]
            importlib.import_module(module)
        for argument in arguments:
            if argument.startswith(("tests/", "requirements/")):
                assert (ROOT / argument).exists()
            # An argument such as ".[proof]" installs the project with an extra.
            for extra in re.findall(r"^\.\[(.*)\]$", argument):
                assert extra in EXTRAS


@pytest.mark.parametrize("target", ["clean", "distclean"])
def test_clean_removes_results_but_keeps_their_readme(target, tmp_path):
    """Only `distclean` may also remove the virtual environment, which takes long to install."""
    for name in (".snakemake", "results/figures"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "results/README.md").touch()
    (tmp_path / "results/resonance.nc").touch()
    run_target(tmp_path, target)
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["README.md"]
    assert not (tmp_path / ".snakemake").exists()
    assert (tmp_path / ".venv").exists() == (target == "clean")
