"""kill -9 at random moments: the next runs end with the bytes of an undisturbed one."""

import os

import pytest

from tests.robustness.disturbed import data, disturb, tiny_project

pytestmark = pytest.mark.slow

# `make torture` asks for more.
KILLS = int(os.environ.get("GEARLIB_KILLS", "3"))


def test_nothing_is_lost_by_kills(undisturbed, tmp_path, capsys):
    def check(project):
        found = data(project)
        assert found.keys() == undisturbed.data.keys()
        assert [path for path in found if found[path] != undisturbed.data[path]] == []

    happened = disturb(
        tiny_project(tmp_path / "project"),
        KILLS,
        # The later part of a run is reached by what earlier, killed runs have left.
        duration=undisturbed.seconds / 3,
        seed=20070414,
        check=check,
    )
    with capsys.disabled():
        print(f"\n{KILLS} kills:", dict(happened))
