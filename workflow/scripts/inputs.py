"""The datasets among the inputs of a job."""

from gearlib.data import storage


def datasets(files):
    """Return input name -> dataset of a job, or -> list of datasets for several files.

    `files` are the named inputs. Only netCDF files are read, not source lists and stamps.
    """
    return {
        name: storage.read(paths) if isinstance(paths, str) else [*map(storage.read, paths)]
        for name, paths in files.items()
        if "".join(paths).endswith(".nc")
    }
