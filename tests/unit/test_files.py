"""Files: whole or none, what is kept of them, who wrote them and when."""

import json
import os
import shutil
from pathlib import Path

import pytest

from gearlib.data.files import replacing, write_table_page
from workflow.checksums import foreign, record, replaced
from workflow.provenance import write


def test_a_file_appears_whole_or_stays_as_it_was(tmp_path):
    path = tmp_path / "new folder/result.txt"
    with replacing(path) as temporary:
        temporary.write_text("first")
        assert not path.exists() and temporary.suffix == path.suffix
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "first"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("cell", ["a, b", "x < 1 & y", "line\nbreak"])
def test_a_table_shows_what_the_csv_holds(tmp_path, cell):
    source, path = tmp_path / "some_table.csv", tmp_path / "some_table.html"
    source.write_text(f'first_column,second\n"{cell}",2\n', encoding="utf-8")
    write_table_page(source, path)
    text = path.read_text(encoding="utf-8")
    escaped = cell.replace("&", "&amp;").replace("<", "&lt;")
    assert f"<td>{escaped}</td><td>2</td>" in text
    assert "<th>first column</th>" in text


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


def test_it_is_written_where_a_job_is_newer(tmp_path):
    results = tmp_path / "results"
    job, target = results / "benchmarks/cold/k1.tsv", results / "provenance.json"
    job.parent.mkdir(parents=True)
    job.write_text("s\tmax_rss\n1.5\t-\n")
    # A table of results is no job.
    (results / "table.tsv").write_text("nu\n0.5\n")
    assert write(results, tmp_path)
    assert [path.name for path in results.glob("*.json")] == [target.name]
    record = json.loads(target.read_text())
    assert record["jobs"] == [{"job": "cold/k1", "seconds": 1.5, "megabytes": None}]
    assert {"gearlib", "numpy", "scipy", "snakemake", "xarray"} <= set(record["versions"])
    written = target.stat().st_mtime
    for later, again in ((-1.0, False), (0.0, False), (1.0, True)):
        os.utime(target, (written, written))
        os.utime(job, (written + later, written + later))
        assert write(results, tmp_path) == again
