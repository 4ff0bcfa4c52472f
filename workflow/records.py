"""Find results that were edited, replaced or copied after a job of this folder wrote them."""

from types import SimpleNamespace

from snakemake.io import IOFile
from snakemake.persistence.file import FilePersistence


def mark_changed(results):
    """Mark results as incomplete if their time differs from the time that Snakemake recorded.

    Snakemake computes incomplete files again, but does not itself compare these times. `results` is
    the folder of the results.
    """
    records = FilePersistence(nolock=True)
    for path in results.rglob("*"):
        if path.is_file() and not {"logs", "benchmarks"} & set(path.parts):
            file = IOFile(str(path))
            record = records.metadata(file)
            if record is None or record.endtime != path.stat().st_mtime:
                records.started(SimpleNamespace(output=[file]))
