"""Checksums in the logs of jobs tell replaced results from those that the jobs wrote."""

import os
import shutil
from pathlib import Path

import pytest

from workflow.checksums import foreign, record, replaced


@pytest.fixture
def results(tmp_path, monkeypatch):
    """A folder with one result and the log of its job, seen from the working folder."""
    monkeypatch.chdir(tmp_path)
    log = Path("results/case/logs/a/b.log")
    log.parent.mkdir(parents=True)
    result = Path("results/case/some result.nc")
    result.write_bytes(b"0123456789")
    log.write_text(f"a warning\n{record(log, [result, Path('none')])}", encoding="utf-8")
    return Path("results")


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


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf", "html"])
def test_drawings_are_not_watched(results, suffix):
    log, drawing = Path("results/case/logs/draw.log"), Path(f"results/a.{suffix}")
    drawing.write_bytes(b"drawn")
    log.write_text(record(log, [drawing]), encoding="utf-8")
    drawing.write_bytes(b"by hand")
    assert replaced(results) == []
    shutil.rmtree(".snakemake")
    assert drawing not in foreign(results)


def test_missing_files_and_cut_logs_are_left_to_snakemake(results):
    path = results / "case/some result.nc"
    path.unlink()
    assert replaced(results) == []
    path.write_bytes(b"new")
    (results / "case/logs/a/b.log").write_bytes(b"\xff\0wrote sha256 12")
    assert replaced(results) == []
    assert replaced(results / "none") == []


def test_results_of_another_folder_are_noticed(results):
    path = results / "case/some result.nc"
    assert foreign(results) == []
    shutil.copytree(".snakemake", "kept")
    shutil.rmtree(".snakemake")
    assert foreign(results) == [path]
    # The record of another job under the same name is none.
    other = Path("results/other.nc")
    other.write_bytes(b"other")
    record(Path("results/case/logs/a/b.log"), [other])
    assert foreign(results) == [path]
    shutil.rmtree(".snakemake")
    shutil.move("kept", ".snakemake")
    assert foreign(results) == []
    shutil.rmtree(".snakemake")
    # Of several jobs as well, whichever log is read last.
    more = [Path(f"results/case/{i}.nc") for i in range(3)]
    for i, other in enumerate(more):
        other.write_bytes(b"other")
        log = Path(f"results/case/logs/{i}.log")
        log.write_text(record(log, [other]), encoding="utf-8")
    shutil.rmtree(".snakemake")
    assert foreign(results) == sorted([*more, path])
    path.unlink()
    assert foreign(results) == more
