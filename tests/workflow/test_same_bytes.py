"""The same bytes from another folder: one target of each stage made anew, from nothing."""

import pytest

pytestmark = pytest.mark.slow

# compile, compute, gather, draw; a table as CSV and as page; the page of the report. The compiled
# kernels are those of which the rest needs nothing: what needs others would run again.
STAGES = (
    "results/train_kernels.sha256",
    "results/phase_planes/k1/0.8200.nc",
    "results/phase_planes.nc",
    "results/figures/fig5_phase_planes.png",
    "results/jump_by_method/exact.nc",
    "results/jump_by_method.csv",
    "results/tables/jump_by_method.html",
    "results/claims.md",
    "results/report/index.html",
)


def test_another_folder_gives_the_same_bytes(first_run, project):
    for path in STAGES:
        (project / path).unlink()
    ran = project.jobs("-j1", *STAGES)
    assert ran == {
        "compile_train_kernels": 1,
        "phase_plane": 1,
        "gather_phase_planes": 1,
        "draw_phase_planes": 1,
        "jump_by_method": 1,
        "jump_by_method_table": 1,
        "claims": 1,
        "draw_report_page": 1,
    }
    expected = first_run[0].results()
    found = project.results()
    assert [path for path in expected if expected[path] != found.get(path)] == []
