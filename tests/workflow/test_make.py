"""Every target of the Makefile does what it says: each runs in a short form.

Most run whole, in a copy of the project whose results are there, with less to do. Those that
install packages, or are tests that `make test` runs with smaller numbers, run with stand-ins for
their tools, which only note what they are told to run.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.workflow.forked import LONGEST
from tests.workflow.project import ROOT

pytestmark = pytest.mark.slow

TEXT = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = re.search(r"^\.PHONY: (.*?[^\\])$", TEXT, re.M | re.S)[1].replace("\\\n", " ").split()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

#: A reference in 50 digits that is quickly computed.
REFERENCE = "tests/physics/test_accuracy.py::test_grazing_the_far_flank_from_both_sides[1-1e-12]"

#: Target -> arguments of its short form, and what it prints.
SHORT = {
    "all": ([], "Nothing to be done"),
    "report": ([], "Report created"),
    "test": (["--assume-old=lint", "JOBS=0", "ARGS=tests/unit/test_tunings.py"], "10 passed"),
    "golden": (["ARGS=--drawn fig2_phase_shift"], "tests.golden"),
    "references": ([f"ARGS='{REFERENCE}'"], "accuracy.json: "),
    "bench": (["SHORT=1"], "all tables of this speed"),
    "clean": ([], "rm -rf .snakemake"),
    "distclean": ([], "rm -rf .venv"),
}

#: Target -> the tools that it runs on what `make test` runs, on the same files with fewer cases.
WHOLE = {
    "lint": ["ruff", "ruff", "snakefmt", "lint-imports", "mypy"],
    "docs": ["mkdocs"],
    "peers": ["python"],
    "random-certificates": ["python"],
    "random-trains": ["python"],
    "slurm-test": ["python"],
    "speed-and-accuracy": ["snakemake", "python"],
    "torture": ["python"],
    "wheel": ["python"],
}

#: Notes its name, its arguments and the numbers of cases.
STAND_IN = """#!/bin/sh
echo "ran $(basename "$0") $*; $(env | grep -E '^GEARLIB_(KILLS|TRAINS|CERTIFICATES)=')"
"""


def make(folder, *words, **environment):
    """Run make without setting up the environment; return what it printed."""
    ready = [f"--assume-old=.venv/{name}.stamp" for name in ("installed", "testing")]
    done = subprocess.run(
        ["make", *ready, *words],
        cwd=folder,
        # Tests may have been started by make themselves.
        env={name: text for name, text in os.environ.items() if not name.startswith("MAKE")}
        | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LONGEST,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.fixture
def checkout(project):
    """The small project with its results and copies of all that targets need."""
    folder = project.folder
    for name in ("benchmarks", "docs", "requirements", "tests"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / name, folder / name, ignore=ignored)
    for name in ("Makefile", "pyproject.toml", "mkdocs.yml", "gallery.yaml", "README.md"):
        shutil.copy2(ROOT / name, folder / name)
    (folder / "results/README.md").touch()
    (folder / ".venv").symlink_to(sys.prefix)
    return folder


@pytest.mark.parametrize("target", SHORT)
def test_short_form(target, checkout):
    words, printed = SHORT[target]
    assert printed in make(checkout, target, *words)
    if "clean" in target:
        assert [path.name for path in (checkout / "results").iterdir()] == ["README.md"]
        assert not (checkout / ".snakemake").exists()
        assert os.path.lexists(checkout / ".venv") == (target == "clean")


@pytest.mark.parametrize("target", WHOLE)
def test_what_make_test_runs_itself(target, tmp_path, request):
    """Run the recipe with stand-ins for its tools; what they are told has to be there."""
    tools = tmp_path / ".venv/bin"
    tools.mkdir(parents=True)
    # What asks for root, too.
    for name in {*WHOLE[target], "apt-get"}:
        (tools / name).write_text(STAND_IN, encoding="utf-8")
        (tools / name).chmod(0o755)
    shutil.copy2(ROOT / "Makefile", tmp_path)
    path = os.pathsep.join([str(tools), os.environ["PATH"]])
    ran = re.findall(r"^ran ([\w-]+) (.*); (.*)$", make(tmp_path, target, PATH=path), re.M)
    ran = [one for one in ran if one[0] != "apt-get"]
    assert [tool for tool, *_ in ran] == WHOLE[target]
    for tool, words, numbers in ran:
        words = shlex.split(words)
        if tool == "snakemake":
            # Its page needs all methods, of which the small project has few.
            built, _ = request.getfixturevalue("first_run")
            assert "Nothing to be done" in built.snakemake("-n", *words)
        if tool != "python":
            assert Path(sys.executable).with_name(tool).exists()
            continue
        assert find_spec(words[words.index("-m") + 1])
        for word in words:
            if word.startswith(("tests/", "requirements/")):
                assert (ROOT / word).exists()
            for extra in re.findall(r"^\.\[(.*)\]$", word):
                assert extra in PROJECT["project"]["optional-dependencies"]
        paths = [ROOT / word for word in words if word.startswith("tests/")]
        assert bool(paths) == (words[:2] == ["-m", "pytest"])
        for name in re.findall(r"(\w+)=\d+", numbers):
            files = [*paths[0].rglob("*.py")] if paths[0].is_dir() else paths
            assert any(f'"{name}"' in file.read_text(encoding="utf-8") for file in files), name


def test_every_target_has_a_short_form():
    assert sorted([*SHORT, *WHOLE]) == sorted(TARGETS)


def test_targets_that_are_named_are_there():
    named = {"all"}
    for page in ("Makefile", "README.md", "CONTRIBUTING.md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        named |= {*re.findall(r"(?:^#? ?|`)make ([a-z-]+)", text, re.M)}
    assert named == {*TARGETS}
