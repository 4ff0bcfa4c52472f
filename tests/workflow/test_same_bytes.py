"""The same bytes from another folder, in another order; a file of its own, for a second worker."""

import pytest

from tests.workflow.project import small_project

pytestmark = pytest.mark.slow

# What holds wall times: no two runs give the same bytes.
TIMED = ("results/work_precision/times_", "results/work_precision.csv")
TIMED += ("results/figures/work_precision_time.", "results/tables/work_precision.html")
TIMED += ("results/steady_orbits/times.nc", "results/figures/steady_orbits_time.")


def test_another_folder_gives_the_same_bytes(request, tmp_path):
    other = small_project(tmp_path / "elsewhere")
    other.snakemake("-j1")
    # Only now, so that both are built at the same time.
    first_run = request.getfixturevalue("first_run")
    expected, found = first_run[0].results(), other.results()
    assert expected.keys() == found.keys()
    other_bytes = [path for path in expected if expected[path] != found[path]]
    assert [path for path in other_bytes if not path.startswith(TIMED)] == []
