"""The datasets among the inputs of a job."""

from gearlib.data import storage


def datasets(files):
    """Return name -> dataset of the named inputs of a job, a list of them where it has several.

    Sources, and the stamps of compiled kernels, only say when a job is to run again.
    """
    return {
        name: storage.read(paths) if isinstance(paths, str) else [*map(storage.read, paths)]
        for name, paths in files.items()
        if "".join(paths).endswith(".nc")
    }
