"""Results that are not as a job of this folder left them: edited, replaced or copied in."""

from types import SimpleNamespace

from snakemake.io import IOFile
from snakemake.persistence.file import FilePersistence


def mark_changed(results):
    """Mark the files in a folder of results that Snakemake has no record of as incomplete.

    Snakemake computes incomplete files anew. It records the date of each output, but does not
    compare it itself.
    """
    records = FilePersistence(nolock=True)
    for path in results.rglob("*"):
        if path.is_file() and not {"logs", "benchmarks"} & set(path.parts):
            file = IOFile(str(path))
            record = records.metadata(file)
            if record is None or record.endtime != path.stat().st_mtime:
                records.started(SimpleNamespace(output=[file]))
