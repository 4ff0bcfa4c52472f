"""Files: whole or none, what is kept of them, who wrote them and when."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from gearlib.data import storage
from gearlib.data.files import remove_leftovers, replacing, write_table_page
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
    assert path.read_text() == "first" and list(path.parent.iterdir()) == [path]
    # What a killed process left is removed.
    for name in (".123.result.nc", ".hidden"):
        (path.parent / name).touch()
    remove_leftovers(path.parent)
    assert {entry.name for entry in path.parent.iterdir()} == {".hidden", path.name}


def test_numbers_are_compressed_without_loss(tmp_path):
    for values in (np.full(20_000, 0.1), np.arange(20_000)):
        storage.write(xr.Dataset({"x": ("time", values)}), tmp_path / "x.nc")
        assert (tmp_path / "x.nc").stat().st_size < 0.3 * values.nbytes
        assert storage.read(tmp_path / "x.nc").x.values.tobytes() == values.tobytes()


@pytest.mark.parametrize("cell", ["a, b", "x < 1 & y", "line\nbreak"])
def test_a_table_shows_what_the_csv_holds(tmp_path, cell):
    source, path = tmp_path / "some_table.csv", tmp_path / "some_table.html"
    source.write_text(f'first_column,second\n"{cell}",2\n', encoding="utf-8")
    write_table_page(source, path)
    text = path.read_text(encoding="utf-8")
    escaped = cell.replace("&", "&amp;").replace("<", "&lt;")
    assert f"<td>{escaped}</td><td>2</td>" in text and "<th>first column</th>" in text


@pytest.fixture
def result(tmp_path, monkeypatch):
    """A result in the folder `results`, with the log of its job."""
    monkeypatch.chdir(tmp_path)
    log, path = Path("results/case/logs/a/b.log"), Path("results/case/some result.nc")
    log.parent.mkdir(parents=True)
    path.write_bytes(b"0123456789")
    log.write_text(f"a warning\n{record(log, [path, Path('none')])}", encoding="utf-8")
    return path


def test_a_replaced_result_is_noticed_a_touched_missing_or_unrecorded_one_is_not(result):
    results = Path("results")
    os.utime(result)
    assert replaced(results) == []
    for content in (b"01234", b"", b"text\n", b"0123456780"):
        result.write_bytes(content)
        # Old, as after `cp -p`: Snakemake would not look at it at all.
        os.utime(result, (1.0, 1.0))
        assert replaced(results) == [result]
    (results / "case/logs/a/b.log").write_bytes(b"\xff\0wrote sha256 12")
    assert replaced(results) == []
    result.unlink()
    assert replaced(results) == replaced(results / "none") == []


def test_results_of_another_folder_are_noticed(result):
    results = Path("results")
    assert foreign(results) == []
    shutil.rmtree(".snakemake")
    assert foreign(results) == [result]
    # The record of another job under the same name is none.
    second = Path("results/other.nc")
    second.write_bytes(b"other")
    record(Path("results/case/logs/a/b.log"), [second])
    assert foreign(results) == [result]
    # Of several jobs as well, whichever log is read last.
    log = Path("results/case/logs/0.log")
    log.write_text(record(log, [second]), encoding="utf-8")
    shutil.rmtree(".snakemake")
    assert foreign(results) == sorted([second, result])


def test_provenance_is_written_where_a_job_is_newer(tmp_path):
    results = tmp_path / "results"
    job, target = results / "benchmarks/cold/k1.tsv", results / "provenance.json"
    job.parent.mkdir(parents=True)
    job.write_text("s\tmax_rss\n1.5\t-\n")
    # A table of results is no job.
    (results / "table.tsv").write_text("nu\n0.5\n")
    assert write(results, tmp_path)
    entries = json.loads(target.read_text())
    assert entries["jobs"] == [{"job": "cold/k1", "seconds": 1.5, "megabytes": None}]
    assert {"gearlib", "numpy", "scipy", "snakemake", "xarray"} <= set(entries["versions"])
    written = target.stat().st_mtime
    for later, again in ((-1.0, False), (0.0, False), (1.0, True)):
        os.utime(target, (written, written))
        os.utime(job, (written + later, written + later))
        assert write(results, tmp_path) == again
