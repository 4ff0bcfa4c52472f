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

TEXT = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = re.search(r"^\.PHONY: (.*?[^\\])$", TEXT, re.M | re.S)[1].replace("\\\n", " ").split()
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
    "optional-dependencies"
]
CHECKS = ["ruff", "ruff", "snakefmt", "lint-imports", "mypy"]
#: Tools that a target calls, if it does not call python once.
TOOLS = {
    "all": ["snakemake"],
    "lint": CHECKS,
    "test": [*CHECKS, "python", "python"],
    "couple-test": ["python", "python"],
    "report": ["snakemake", "snakemake"],
    "docs": ["mkdocs"],
    "speed-and-accuracy": ["snakemake", "python"],
    "clean": [],
    "distclean": [],
}


def make(folder, target):
    """Run a target of the Makefile with stand-ins for its tools and return the output."""
    tools = folder / ".venv/bin"
    tools.mkdir(parents=True)
    # Installing Slurm would need the rights of root.
    for name in {*TOOLS.get(target, ["python"]), "apt-get"}:
        (tools / name).write_text('#!/bin/sh\necho "ran $(basename "$0") $*"\n', encoding="utf-8")
        (tools / name).chmod(0o755)
    shutil.copy2(ROOT / "Makefile", folder)
    ready = [".venv/installed.stamp", ".venv/testing.stamp", "build/config.schema.json"]
    # The tests may have been started by make themselves.
    environment = {name: text for name, text in os.environ.items() if not name.startswith("MAKE")}
    environment["PATH"] = os.pathsep.join([str(tools), environment["PATH"]])
    return subprocess.run(
        ["make", *(f"--assume-old={name}" for name in ready), target],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


@pytest.mark.parametrize("target", [target for target in TARGETS if TOOLS.get(target) != []])
def test_targets_name_modules_files_and_extras_that_exist(target, tmp_path):
    """Run a target and check the arguments that its tools receive."""
    calls = [shlex.split(call) for call in re.findall(r"^ran (.*)$", make(tmp_path, target), re.M)]
    calls = [call for call in calls if call[0] != "apt-get"]
    assert [tool for tool, *_ in calls] == TOOLS.get(target, ["python"])
    for words in calls:
        if words[0] == "python":
            importlib.import_module(words[words.index("-m") + 1])
        for word in words:
            assert not word.startswith(("tests/", "requirements/")) or (ROOT / word).exists()
            for extra in re.findall(r"^\.\[(.*)\]$", word):
                assert extra in EXTRAS


@pytest.mark.parametrize("target", ["clean", "distclean"])
def test_clean_keeps_the_readme_of_results(target, tmp_path):
    for name in (".snakemake", "results/figures"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "results/README.md").touch()
    (tmp_path / "results/resonance.nc").touch()
    make(tmp_path, target)
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["README.md"]
    assert not (tmp_path / ".snakemake").exists()
    assert (tmp_path / ".venv").exists() == (target == "clean")
