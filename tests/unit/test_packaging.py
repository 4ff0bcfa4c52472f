"""Check files that must agree with others: conda environments, pins, citation, documentation."""

import itertools
import re
import tomllib
from pathlib import Path

import yaml

from gearlib import __version__

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]
EXTRAS = PROJECT["optional-dependencies"]
#: Names of smaller conda packages by the names that pip uses.
CONDA_NAMES = {"matplotlib": "matplotlib-base", "snakemake": "snakemake-minimal"}


def read_yaml(path):
    """Read a YAML file of the project."""
    return yaml.safe_load((ROOT / path).read_text(encoding="utf-8"))


def lower_bounds(requirements):
    """Return the lower bound of each requirement, such as "numpy >=2.1", by the package name."""
    pattern = re.compile(r"([\w.-]+)\s*(?:>=([\d.]+))?")
    pairs = [pattern.match(requirement).groups() for requirement in requirements]
    return {name.lower(): bound for name, bound in pairs}


def expected_bounds(*extras):
    """Return the lower bounds of Python, all dependencies and given extras, by conda names."""
    requirements = list(PROJECT["dependencies"])
    for extra in extras:
        requirements += EXTRAS[extra]
    python = {"python": PROJECT["requires-python"].removeprefix(">=")}
    pip_bounds = lower_bounds(requirements).items()
    return python | {CONDA_NAMES.get(name, name): bound for name, bound in pip_bounds}


def test_conda_environments_match_the_dependencies_of_pip_and_all_are_pinned():
    """Conda environments must have the bounds of pyproject.toml; all packages must be pinned."""
    packages = lower_bounds(read_yaml("environment.yml")["dependencies"])
    assert packages.pop("pip") is None
    assert packages == expected_bounds("workflow", "explore", "proof")
    packages = lower_bounds(read_yaml("workflow/envs/gearlib.yaml")["dependencies"])
    assert packages.items() <= expected_bounds("workflow", "proof").items()
    constraints = (ROOT / "requirements/constraints.txt").read_text(encoding="utf-8")
    pinned = set(re.findall(r"^([\w.-]+)==", constraints.lower().replace("_", "-"), re.M))
    required = lower_bounds([*PROJECT["dependencies"], *itertools.chain(*EXTRAS.values())])
    # The extra with all extras requires gearlib itself.
    assert {name.replace("_", "-") for name in required} - pinned == {"gearlib"}


def test_the_citation_file_states_the_version():
    assert read_yaml("CITATION.cff")["version"] == __version__


def test_make_runs_every_folder_of_tests():
    test_paths = PYPROJECT["tool"]["pytest"]["ini_options"]["testpaths"]
    paths = (ROOT / "tests").rglob("test_*.py")
    assert {str(path.parent.relative_to(ROOT)) for path in paths} == set(test_paths)


def test_every_file_named_on_the_architecture_page_exists():
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    names = {name for name in re.findall(r"`([\w./-]+/[\w./-]+)`", page) if "results/" not in name}
    assert len(names) > 15 and {name for name in names if not (ROOT / name).exists()} == set()
