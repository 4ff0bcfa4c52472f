"""A new study is two files and a record, as the page on architecture has it."""

import re

import pytest

from tests.workflow.project import ROOT, small_project

pytestmark = pytest.mark.slow

STUDY = '''"""Height of the orbit over the load."""

import xarray as xr

from gearlib.data.variables import describe
from gearlib.models.pair import GearPair
from gearlib.runs.sweeping import sweep


def compute(pair, run):
    """Return the largest displacement for two loads, from rest."""
    pairs = [GearPair(**pair | {"load": k * pair["load"]}) for k in (1.0, 2.0)]
    highest = [float(sweep(one, [0.75], **run).displacement_max[0]) for one in pairs]
    return describe(xr.Dataset({"displacement_max": ("start", highest)}))


def rows(heights):
    """Yield a row for each load."""
    yield ["displacement_max"]
    yield from heights.displacement_max.values[:, None]
'''
FIGURE = '''"""The height over the load."""

from matplotlib.figure import Figure


def draw(heights):
    """Draw the dataset of the study."""
    figure = Figure()
    figure.subplots().plot(heights.displacement_max)
    return figure
'''
SECTION = '''

from gearlib.config.types import DampingName, Section  # noqa: E402


class LoadStudy(Section):
    """How high the orbit is, over the load."""

    damping: DampingName = "k1"


'''


def test_a_new_study_is_two_files_and_a_record(tmp_path):
    project = small_project(tmp_path / "project")
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    (record,) = re.findall("```py\n(.*?)```", page, re.DOTALL)
    (project / "gearlib/studies/load_study.py").write_text(STUDY, encoding="utf-8")
    figure = project / "gearlib/figures/height_over_load.py"
    figure.write_text(FIGURE, encoding="utf-8")
    with (project / "gearlib/config/studies/explained.py").open("a", encoding="utf-8") as file:
        file.write(SECTION + record)
    project.configure(lambda settings: settings.update(targets=["load_study"]))
    computed = {"compute_load_study": 1, "load_study_table": 1}
    assert project.jobs("-j2") == {"compile_kernels": 1, "draw_load_study": 1, **computed}
    assert len((project / "results/load_study.csv").read_text().splitlines()) == 3
    assert (project / "results/figures/load_study.png").stat().st_size > 1000
    project.snakemake("--report", "report.html")
    shown = (project / "report.html").read_text(encoding="utf-8")
    assert "From rest, with the damping k1." in shown
    figure.write_text(f"{FIGURE}\n# one more line\n", encoding="utf-8")
    assert project.planned() == {"draw_load_study": 1}
    project.configure(lambda settings: settings.update(load_study={"damping": "k1m"}))
    assert project.planned() == {"draw_load_study": 1, **computed}
    project.configure(lambda settings: settings.update(load_study={"damp": "k1"}))
    refusal = project.snakemake("-n", succeed=False)
    assert "load_study.damp = 'k1' is not a known key" in refusal
