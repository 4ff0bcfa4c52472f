"""The same bytes from another folder: one target of each stage made anew, from nothing."""

import pytest

pytestmark = pytest.mark.slow

# compile, compute, gather, draw; a table as CSV and as page; the page of the report.
STAGES = (
    "results/kernels.sha256",
    "results/phase_planes/k1/0.8200.nc",
    "results/phase_planes.nc",
    "results/figures/fig5_phase_planes.png",
    "results/figures/fig5_phase_planes.pdf",
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
    assert {"compile_kernels", "phase_plane", "claims", "draw_report_page"} <= ran.keys()
    expected = first_run[0].results()
    found = project.results()
    assert [path for path in expected if expected[path] != found.get(path)] == []
