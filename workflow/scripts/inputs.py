"""The datasets among the inputs of a job."""

from gearlib.data import storage


def datasets(files):
    """Return input name -> dataset, or list of datasets, of the netCDF files among the inputs.

    `files` are the named inputs of a Snakemake job, paths or lists of paths.
    """
    return {
        name: storage.read(paths) if isinstance(paths, str) else [*map(storage.read, paths)]
        for name, paths in files.items()
        if "".join(paths).endswith(".nc")
    }
