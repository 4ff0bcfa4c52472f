"""The datasets among the inputs of a job."""

from gearlib.data import storage


def datasets(files):
    """Return name -> dataset of the named inputs of a job, or a list if a name has several files.

    Lists of sources and stamps of compiled kernels are no netCDF files and are left out.
    """
    return {
        name: storage.read(paths) if isinstance(paths, str) else [*map(storage.read, paths)]
        for name, paths in files.items()
        if "".join(paths).endswith(".nc")
    }
