"""The datasets among the inputs of a job."""

from gearlib.data import storage

#: Inputs that only say when a job is to run again.
_NO_DATA = ("kernels", "sources")


def datasets(files):
    """Return name -> dataset of the named inputs of a job, a list of them where it has several."""
    named = {name: paths for name, paths in files.items() if name not in _NO_DATA}
    return {
        name: storage.read(paths) if isinstance(paths, str) else [*map(storage.read, paths)]
        for name, paths in named.items()
    }
