"""A small project in a temporary folder, on which the tests run the real Snakemake."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import yaml

from gearlib.config.configuration import TARGETS

ROOT = Path(__file__).resolve().parents[2]
SNAKEMAKE = Path(sys.executable).with_name("snakemake")
#: Seconds after which Snakemake is killed.
TIMEOUT = 1800
_COPIED = ["Snakefile", "config.yaml", "gearlib", "profiles", "workflow"]


class Project:
    """A copy of the project in its own folder, with its results."""

    def __init__(self, folder):
        self.folder = folder

    def __truediv__(self, path):
        return self.folder / path

    def snakemake(self, *arguments, succeed=True, **environment):
        """Run Snakemake, assert that it succeeds or fails, and return its output."""
        process = subprocess.run(
            [SNAKEMAKE, *map(str, arguments)],
            cwd=self.folder,
            env=os.environ | environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=TIMEOUT,
        )
        assert (process.returncode == 0) == succeed, process.stdout
        return process.stdout

    def run_rules(self, *arguments):
        """Run Snakemake and return the names of the rules that it runs."""
        return rules_in_job_table(self.snakemake(*arguments))

    def planned_rules(self, *arguments):
        """Return the names of the rules that Snakemake would run."""
        return self.run_rules("-n", *arguments)

    def configure(self, change):
        """Rewrite config.yaml after `change` has changed its content, a dict, in place."""
        path = self / "config.yaml"
        configuration = yaml.safe_load(path.read_text(encoding="utf-8"))
        change(configuration)
        path.write_text(yaml.safe_dump(configuration, sort_keys=False), encoding="utf-8")

    def results(self):
        """Return the contents of result files by path, without logs, benchmarks and provenance."""
        return {
            str(path.relative_to(self.folder)): path.read_bytes()
            for path in sorted((self / "results").rglob("*"))
            if path.is_file() and not {"logs", "benchmarks", "provenance.json"} & set(path.parts)
        }


def rules_in_job_table(output):
    """Return the names of the rules in the first job table that Snakemake printed, except `all`."""
    table = re.search(r"^Job stats:\njob +count\n[- ]+\n(.*?)^total ", output, re.S | re.M)
    if table is None:
        assert "Nothing to be done" in output, output
        return set()
    return {*re.findall(r"^(\w+) +\d+$", table[1], re.M)} - {"all"}


def project_copy(folder):
    """Return a copy of the project without results."""
    folder.mkdir()
    for name in _COPIED:
        if (ROOT / name).is_dir():
            no_bytecode = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, folder / name, ignore=no_bytecode)
        else:
            shutil.copy2(ROOT / name, folder / name)
    return Project(folder)


def small_project(folder):
    """Return a copy of the project without results, with the short studies of small.yaml."""
    project = project_copy(folder)
    small = yaml.safe_load((ROOT / "tests/workflow/small.yaml").read_text(encoding="utf-8"))
    # By default, some of these targets are not computed.
    small["targets"] = [name for name in TARGETS if name != "measured"]
    project.configure(lambda settings: _merge(settings, small))
    shutil.copy2(ROOT / "gallery" / small["gearbox"]["file"], folder)
    return project


def keep_dampings(configuration, *dampings):
    """Keep only the given dampings and no scenes in a configuration, which is changed in place."""
    for section in (configuration["dampings"], configuration["figures"]["colours"]):
        for name in section.keys() - {*dampings}:
            del section[name]
    configuration |= {"scenes": {}, "stability_chart": {"damping": dampings[0]}}


def run_recorded(folder):
    """Run `snakemake -j2` in a new small project and return (project, output, job records)."""
    records = folder / "records"
    records.mkdir(parents=True)
    recorder = str(ROOT / "tests/workflow/recorder")
    environment = {
        "PYTHONPATH": os.pathsep.join(filter(None, [recorder, os.getenv("PYTHONPATH")])),
        "GEARLIB_RECORDS": str(records),
    }
    project = small_project(folder / "project")
    output = project.snakemake("-j2", **environment)
    job_records = [json.loads(path.read_text(encoding="utf-8")) for path in records.glob("*.json")]
    return project, output, job_records


def _merge(base, changes):
    """Merge nested changes into a configuration in place, as Snakemake does."""
    for key, value in changes.items():
        if isinstance(value, dict):
            _merge(base.setdefault(key, {}), value)
        else:
            base[key] = value
