"""Files that repeat others: conda environments, pins, citation, the page of the architecture."""

import itertools
import re
import tomllib
from pathlib import Path

import yaml

from gearlib import __version__

ROOT = Path(__file__).resolve().parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = SETTINGS["project"]
EXTRAS = PROJECT["optional-dependencies"]
#: Name of a package in pip -> smaller package in conda.
CONDA = {"matplotlib": "matplotlib-base", "snakemake": "snakemake-minimal"}


def load(path):
    """Read a YAML file of the project."""
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def bounds(requirements):
    """Return the lower bounds of requirements such as "numpy>=2.1" or "numpy >=2.1" by name."""
    pairs = [re.match(r"([\w.-]+)\s*(?:>=([\d.]+))?", text).groups() for text in requirements]
    return {name.lower(): bound for name, bound in pairs}


def expected_bounds(*extras):
    """Return the lower bounds of Python, the dependencies and given extras by conda names."""
    rows = bounds([*PROJECT["dependencies"], *(row for name in extras for row in EXTRAS[name])])
    python = {"python": PROJECT["requires-python"].removeprefix(">=")}
    return python | {CONDA.get(name, name): bound for name, bound in rows.items()}


def test_conda_environments_match_the_dependencies_of_pip_and_all_are_pinned():
    """Compare both conda environments and the constraints with pyproject.toml."""
    packages = bounds(load("environment.yml")["dependencies"])
    assert packages.pop("pip") is None
    assert packages == expected_bounds("workflow", "explore", "proof")
    packages = bounds(load("workflow/envs/gearlib.yaml")["dependencies"])
    assert packages.items() <= expected_bounds("workflow", "proof").items()
    text = (ROOT / "requirements/constraints.txt").read_text(encoding="utf-8")
    pinned = set(re.findall(r"^([\w.-]+)==", text.lower().replace("_", "-"), re.M))
    required = bounds([*PROJECT["dependencies"], *itertools.chain(*EXTRAS.values())])
    assert {name.replace("_", "-") for name in required} - pinned == {"gearlib"}


def test_the_citation_file_states_the_version():
    assert load("CITATION.cff")["version"] == __version__


def test_make_runs_every_folder_of_tests():
    test_paths = SETTINGS["tool"]["pytest"]["ini_options"]["testpaths"]
    paths = (ROOT / "tests").rglob("test_*.py")
    assert {str(path.parent.relative_to(ROOT)) for path in paths} == set(test_paths)


def test_every_file_named_on_the_architecture_page_exists():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    names = {name for name in re.findall(r"`([\w./-]+/[\w./-]+)`", page) if "results/" not in name}
    assert len(names) > 15 and {name for name in names if not (ROOT / name).exists()} == set()
