"""Scripts of jobs begin with their log, and do nothing where they are only imported."""

import json
import runpy
import sys
from types import SimpleNamespace

import pytest

from tests.workflow.project import ROOT

FOLDER = ROOT / "workflow/scripts"
#: Modules of scripts, which are no job.
MODULES = {"inputs", "joblog", "one_thread"}
SCRIPTS = sorted({path.stem for path in FOLDER.glob("*.py")} - MODULES)


class Begun(Exception):
    """The job has come to its log."""


def begin(path):
    raise Begun(path)


@pytest.fixture
def run(monkeypatch):
    """Return what runs a script whose log goes nowhere."""
    monkeypatch.syspath_prepend(FOLDER)
    # They would change the process that runs the tests.
    monkeypatch.setitem(sys.modules, "joblog", SimpleNamespace(redirect_output=begin))
    monkeypatch.setitem(sys.modules, "one_thread", SimpleNamespace())

    def call(script, name, **given):
        job = {"snakemake": SimpleNamespace(**given)}
        return runpy.run_path(str(FOLDER / f"{script}.py"), job, name)

    return call


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_job_begins_with_its_log(run, script):
    with pytest.raises(Begun, match="^its.log$"):
        run(script, "__main__", log=["its.log"])
    run(script, "imported")


def test_without_flint_nothing_is_proven(run, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "joblog", SimpleNamespace(redirect_output=print))
    path = tmp_path / "certificates.json"
    # Neither branches nor what is asked of them.
    given = {"params": SimpleNamespace(flint=False), "output": SimpleNamespace(json=path)}
    run("certificates", "__main__", log=["its.log"], **given)
    assert json.loads(path.read_text()) == []
