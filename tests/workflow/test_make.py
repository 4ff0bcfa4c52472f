"""Every target of the Makefile: its recipe runs with stand-ins for its tools.

The stand-ins only print how they are called; the modules, files and extras that they are given have
to exist.
"""

import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.workflow.project import ROOT

TEXT = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = re.search(r"^\.PHONY: (.*?[^\\])$", TEXT, re.M | re.S)[1].replace("\\\n", " ").split()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

#: Target -> the tools that it calls.
TOOLS = {
    "all": ["snakemake"],
    "lint": ["ruff", "ruff", "snakefmt", "lint-imports", "mypy"],
    "golden": ["python"],
    "references": ["python"],
    "test": ["ruff", "ruff", "snakefmt", "lint-imports", "mypy", "python"],
    "torture": ["python"],
    "peers": ["python"],
    "random-trains": ["python"],
    "random-certificates": ["python"],
    "slurm-test": ["python"],
    "bench": ["python"],
    "report": ["snakemake", "snakemake"],
    "docs": ["mkdocs"],
    "speed-and-accuracy": ["snakemake", "python"],
    "wheel": ["python"],
    "clean": [],
    "distclean": [],
}

#: Prints its name, its arguments and the numbers of cases.
STAND_IN = """#!/bin/sh
echo "ran $(basename "$0") $*; $(env | grep -E '^GEARLIB_(KILLS|TRAINS|CERTIFICATES)=')"
"""


def make(folder, target):
    """Run a target of the Makefile in a folder whose tools are stand-ins; return its output."""
    tools = folder / ".venv/bin"
    tools.mkdir(parents=True)
    # Installing Slurm asks for root.
    for name in {*TOOLS[target], "apt-get"}:
        (tools / name).write_text(STAND_IN, encoding="utf-8")
        (tools / name).chmod(0o755)
    shutil.copy2(ROOT / "Makefile", folder)
    ready = [f"--assume-old=.venv/{name}.stamp" for name in ("installed", "testing")]
    # Tests may have been started by make themselves.
    clean = {name: text for name, text in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(
        ["make", *ready, "--assume-old=build/config.schema.json", target],
        cwd=folder,
        env=clean | {"PATH": os.pathsep.join([str(tools), os.environ["PATH"]])},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.parametrize("target", [target for target, tools in TOOLS.items() if tools])
def test_target_calls_tools_with_what_exists(target, tmp_path):
    calls = re.findall(r"^ran ([\w-]+) (.*); (.*)$", make(tmp_path, target), re.M)
    calls = [call for call in calls if call[0] != "apt-get"]
    assert [tool for tool, *_ in calls] == TOOLS[target]
    for tool, arguments, case_numbers in calls:
        words = shlex.split(arguments)
        assert Path(sys.executable).with_name(tool).exists()
        if tool != "python":
            continue
        importlib.import_module(words[words.index("-m") + 1])
        for word in words:
            if word.startswith(("tests/", "requirements/")):
                assert (ROOT / word).exists()
            for extra in re.findall(r"^\.\[(.*)\]$", word):
                assert extra in PROJECT["project"]["optional-dependencies"]
        paths = [ROOT / word for word in words if word.startswith("tests/")]
        for name in re.findall(r"(\w+)=\d+", case_numbers):
            files = [*paths[0].rglob("*.py")] if paths[0].is_dir() else paths
            assert any(f'"{name}"' in file.read_text(encoding="utf-8") for file in files), name


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


def test_every_target_is_tested_and_described():
    assert sorted(TOOLS) == sorted(TARGETS)
    named = {"all"}
    for page in ("Makefile", "README.md", "CONTRIBUTING.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        named |= {*re.findall(r"(?:^#? ?|`)make ([a-z-]+)", text, re.M)}
    assert named == {*TARGETS}
