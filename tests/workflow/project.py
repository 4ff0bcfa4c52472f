"""A small project in a temporary folder, on which the tests run the real Snakemake."""

import re
import shutil
import tempfile
from pathlib import Path

import yaml

from gearlib.config.configuration import TARGETS
from tests.workflow import forked

ROOT = Path(__file__).resolve().parents[2]
COPIED = ["Snakefile", "config.yaml", "gearlib", "profiles", "workflow"]


class Project:
    """One checkout with its results."""

    def __init__(self, folder):
        self.folder = folder

    def __truediv__(self, path):
        return self.folder / path

    def snakemake(self, *arguments, succeed=True):
        """Run Snakemake and return what it printed."""
        with tempfile.NamedTemporaryFile("r", encoding="utf-8") as printed:
            status = forked.run(self.folder, arguments, printed.name)
            output = printed.read()
        assert (status == 0) == succeed, output
        return output

    def jobs(self, *arguments):
        """Return the jobs, as rule -> number, that Snakemake with these arguments runs."""
        return job_counts(self.snakemake(*arguments))

    def planned(self, *arguments):
        """Return the jobs, as rule -> number, that Snakemake would run."""
        return self.jobs("-n", *arguments)

    def configure(self, change):
        """Change the configuration: `change` gets it as a dict."""
        path = self / "config.yaml"
        settings = yaml.safe_load(path.read_text(encoding="utf-8"))
        change(settings)
        path.write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")

    def results(self):
        """Return the contents of all result files by their paths; those with times left out."""
        return {
            str(path.relative_to(self.folder)): path.read_bytes()
            for path in sorted((self / "results").rglob("*"))
            if path.is_file() and not {"logs", "benchmarks", "provenance.json"} & set(path.parts)
        }


def job_counts(output):
    """Return rule -> number from Snakemake's first table of jobs; the target `all` left out."""
    table = re.search(r"^Job stats:\njob +count\n[- ]+\n(.*?)^total ", output, re.S | re.M)
    if table is None:
        assert "Nothing to be done" in output, output
        return {}
    counts = dict(re.findall(r"^(\w+) +(\d+)$", table[1], re.M))
    return {rule: int(count) for rule, count in counts.items() if rule != "all"}


def merge(base, changes):
    """Lay one configuration over another, in place, as Snakemake does."""
    for key, value in changes.items():
        if isinstance(value, dict):
            merge(base.setdefault(key, {}), value)
        else:
            base[key] = value


def project_copy(folder):
    """Return a copy of the project without results."""
    folder.mkdir()
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, folder / name)
    return Project(folder)


def small_project(folder):
    """Return a copy of the project without results, its configuration the small one."""
    project = project_copy(folder)
    small = yaml.safe_load((ROOT / "tests/workflow/small.yaml").read_text(encoding="utf-8"))
    # Those that nobody gets unasked too.
    small["targets"] = [name for name in TARGETS if name != "measured"]
    project.configure(lambda settings: merge(settings, small))
    return project
