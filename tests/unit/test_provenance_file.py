"""results/provenance.json: written where a job is newer, with the times of all jobs."""

import json
import os

from workflow.provenance import write


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
