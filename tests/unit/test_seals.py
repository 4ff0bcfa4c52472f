"""Checksums in the logs of jobs tell replaced results from those that the jobs wrote."""

import os

import pytest

from workflow.seals import replaced, seal


@pytest.fixture
def results(tmp_path):
    """A folder with one result and the log of its job."""
    (tmp_path / "case/logs/a").mkdir(parents=True)
    result = tmp_path / "case/some result.nc"
    result.write_bytes(b"0123456789")
    text = f"a warning\n{seal(result)}\n"
    (tmp_path / "case/logs/a/b.log").write_text(text, encoding="utf-8")
    return tmp_path


def test_what_jobs_wrote_is_not_replaced(results):
    assert replaced(results) == []
    os.utime(results / "case/some result.nc")
    assert replaced(results) == []


@pytest.mark.parametrize("content", [b"01234", b"", b"text\n", b"0123456780"])
def test_other_content_is_noticed(results, content):
    path = results / "case/some result.nc"
    path.write_bytes(content)
    # Old, as after `cp -p`: Snakemake would not look at it at all.
    os.utime(path, (1.0, 1.0))
    assert replaced(results) == [path]


def test_missing_files_and_cut_logs_are_left_to_snakemake(results):
    path = results / "case/some result.nc"
    path.unlink()
    assert replaced(results) == []
    path.write_bytes(b"new")
    (results / "case/logs/a/b.log").write_bytes(b"\xff\0wrote sha256 12")
    assert replaced(results) == []
    assert replaced(results / "none") == []
