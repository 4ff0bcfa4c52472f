"""Scripts of jobs: they begin with their log, and hand what a rule says to the library."""

import json
import runpy
import sys
from types import SimpleNamespace

import pytest
import xarray as xr

from gearlib import GearPair, sweep
from gearlib.data import storage
from tests.paper import PAPER
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


@pytest.fixture
def job(run, monkeypatch):
    """Return what runs a script to its end."""
    monkeypatch.setitem(sys.modules, "joblog", SimpleNamespace(redirect_output=print))
    return lambda script, **given: run(script, "__main__", log=["its.log"], **given)


def test_without_flint_nothing_is_proven(job, tmp_path):
    path = tmp_path / "certificates.json"
    # Neither branches nor what is asked of them.
    given = {"params": SimpleNamespace(flint=False, gears="paper's pair")}
    given["output"] = SimpleNamespace(
        json=path, csv=tmp_path / "certificates.csv", page=tmp_path / "certificates.html"
    )
    job("certificates", **given)
    assert json.loads(path.read_text()) == []


def test_a_job_calls_its_function_and_stores_what_it_returns(job, tmp_path):
    pair, paths = PAPER.as_dict(), [tmp_path / "window.nc"]
    settings = {"periods": 6, "record_periods": 2}
    params = {"pair": pair, "window": [0.7, 0.9], "step": 0.1, "run": settings}
    params |= {"damping": "k1", "direction": "up"}
    params["function"] = "gearlib.studies.resonance:window"
    given = SimpleNamespace(**params, items=params.items)
    # Of inputs that are no datasets nothing is read.
    job("compute", params=given, input={"kernels": "kernels.sha256"}, threads=1, output=paths)
    found = storage.read(paths[0])
    expected = sweep(GearPair(**pair), [0.7, 0.8, 0.9], direction="up", **settings)
    assert found.damping == "k1" and found.direction == "up"
    xr.testing.assert_equal(found.displacement_max.drop_vars(["damping", "direction"]),
                            expected.displacement_max)  # fmt: skip
