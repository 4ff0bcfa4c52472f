"""Datasets to and from netCDF: the same bytes for the same data, whole files or none."""

import os
from pathlib import Path

import xarray as xr


def write(dataset, path):
    """Write `dataset` to the netCDF file `path`, replacing it in one step.

    The file appears complete or not at all, and holds nothing that changes between two equal
    calculations.

    Parameters
    ----------
    dataset : xarray.Dataset
    path : str or os.PathLike
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    # xarray would give NaN as fill value to every float, which CF forbids for coordinates.
    encoding = {name: {"_FillValue": None} for name in dataset.variables}
    for name, variable in dataset.variables.items():
        if variable.ndim and variable.dtype.kind in "if":
            encoding[name] |= {"zlib": True, "complevel": 4, "shuffle": True}
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def read(path):
    """Return the dataset in the netCDF file `path`, in memory, the file closed."""
    return xr.load_dataset(path, engine="netcdf4")
