"""Find results that were edited, replaced or copied after a job of this folder wrote them."""

from types import SimpleNamespace

from snakemake.io import IOFile
from snakemake.persistence.file import FilePersistence


def mark_changed(results):
    """Mark the files in a folder of results as incomplete unless Snakemake has a record of them.

    Snakemake computes incomplete files again. It records the time of each output, but does not
    compare it with the time of the file.
    """
    records = FilePersistence(nolock=True)
    for path in results.rglob("*"):
        if path.is_file() and not {"logs", "benchmarks"} & set(path.parts):
            file = IOFile(str(path))
            record = records.metadata(file)
            if record is None or record.endtime != path.stat().st_mtime:
                records.started(SimpleNamespace(output=[file]))
