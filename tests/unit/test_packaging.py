"""Files that repeat others: conda environments, pins, citation, the page of the architecture."""

import re
import tomllib
from pathlib import Path

import yaml

from gearlib import __version__

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
#: Name of a package in pip -> smaller package in conda.
CONDA = {"matplotlib": "matplotlib-base", "snakemake": "snakemake-minimal"}


def load(path):
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def bounds(requirements):
    """Return name -> lower bound of requirements such as "numpy>=2.1" or "numpy >=2.1"."""
    pairs = [re.match(r"([\w.-]+)\s*(?:>=([\d.]+))?", text).groups() for text in requirements]
    return {name.lower(): bound for name, bound in pairs}


def expected(*extras):
    """Return name in conda -> lower bound of Python, the dependencies and those of the extras."""
    rows = bounds([*PROJECT["dependencies"], *(row for name in extras for row in EXTRAS[name])])
    python = {"python": PROJECT["requires-python"].removeprefix(">=")}
    return python | {CONDA.get(name, name): bound for name, bound in rows.items()}


def test_the_conda_environment_has_what_pip_installs():
    packages = bounds(load("environment.yml")["dependencies"])
    assert packages.pop("pip") is None
    assert packages == expected("workflow", "explore", "proof")


def test_the_environment_of_the_jobs_is_part_of_it():
    packages = bounds(load("workflow/envs/gearlib.yaml")["dependencies"])
    assert packages.items() <= expected("workflow", "proof").items()


def test_everything_that_is_asked_for_is_pinned():
    text = (ROOT / "requirements/constraints.txt").read_text(encoding="utf-8")
    pinned = set(re.findall(r"^([\w.-]+)==", text.lower().replace("_", "-"), re.M))
    required = bounds(
        [*PROJECT["dependencies"], *(row for rows in EXTRAS.values() for row in rows)]
    )
    assert {name.replace("_", "-") for name in required} - pinned - {"gearlib"} == set()


def test_the_citation_has_the_version():
    assert load("CITATION.cff")["version"] == __version__


def test_every_folder_of_tests_is_run():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    run = settings["tool"]["pytest"]["ini_options"]["testpaths"]
    paths = (ROOT / "tests").rglob("test_*.py")
    assert {str(path.parent.relative_to(ROOT)) for path in paths} == set(run)


def test_every_file_on_the_page_of_the_architecture_is_there():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    names = {name for name in re.findall(r"`([\w./-]+/[\w./-]+)`", page) if "results/" not in name}
    assert len(names) > 15
    assert [name for name in sorted(names) if not (ROOT / name).exists()] == []
