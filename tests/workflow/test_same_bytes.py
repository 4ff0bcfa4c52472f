"""The same bytes from another folder and on other processors: a target of each stage, made anew.

`make same-bytes` does so with every target.
"""

import pytest

from gearlib import processor
from tests.workflow import same_bytes

pytestmark = pytest.mark.slow

# compile, compute, gather, draw; a table as CSV and as page; the page of the report. The compiled
# kernels are those of which the rest needs nothing: what needs others would run again.
STAGES = (
    "results/train_kernels.sha256",
    "results/train_chart.nc",
    "results/phase_planes/k1/0.8200.nc",
    "results/phase_planes.nc",
    "results/figures/fig5_phase_planes.png",
    "results/jump_by_method.csv",
    "results/tables/jump_by_method.html",
    "results/claims.md",
    "results/report/index.html",
)
JOBS = {
    "compile_train_kernels": 1,
    "compute_train_chart": 1,
    "phase_plane": 1,
    "gather_phase_planes": 1,
    "draw_phase_planes": 1,
    "jump_by_method_table": 1,
    "compute_claims": 1,
    "draw_report_page": 1,
}

#: Eigenvalues of LAPACK stand on the way to it.
SENSITIVE = "results/train_chart.nc"

needs_settings = pytest.mark.skipif(
    not processor.settings(), reason="this processor has no settings, see gearlib/processor.py"
)


# The kernels of Zen are those of the settings.
@pytest.mark.parametrize("name", sorted(same_bytes.EMULATED.keys() - {"Zen 2"}))
def test_another_folder_and_processor_give_the_same_bytes(name, first_run, project, tmp_path):
    for path in STAGES:
        (project / path).unlink()
    choices = same_bytes.EMULATED[name] if processor.settings() else {}
    with same_bytes.recorded(tmp_path / "records", choices):
        ran = project.jobs("-j2", *STAGES)
    assert ran == JOBS
    assert same_bytes.differing(first_run[0].results(), project.results()) == []
    jobs = same_bytes.read(tmp_path / "records")
    assert sorted(job["rule"] for job in jobs) == sorted(JOBS)
    assert not processor.settings() or same_bytes.others(jobs) == []


@needs_settings
def test_every_job_ran_under_the_settings(records):
    jobs = [record for record in records if record["rule"]]
    assert same_bytes.others(jobs) == []
    libraries = [library for job in jobs for library in job["processor"]]
    assert {"OpenBLAS", "numpy", "numba", "glibc"} <= {library.split()[0] for library in libraries}
    # Not only in jobs that load nothing.
    assert libraries.count("glibc") == len(jobs) and libraries.count("numba") > len(jobs) / 2


@needs_settings
@pytest.mark.parametrize("name", ["unknown"])
def test_without_the_settings_bytes_differ(name, first_run, project, tmp_path):
    (project / SENSITIVE).unlink()
    with same_bytes.recorded(tmp_path / "records", same_bytes.unset()[name], settings=False):
        assert project.jobs("-j1", SENSITIVE) == {"compute_train_chart": 1}
    found = same_bytes.differing(first_run[0].results(), project.results())
    assert found == [SENSITIVE]
    (job,) = same_bytes.read(tmp_path / "records")
    assert {"OpenBLAS", "glibc"} <= {words.split()[1] for words in same_bytes.others([job])}
