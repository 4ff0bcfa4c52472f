"""Datasets to and from netCDF: the same bytes for the same data, whole files or none."""

import xarray as xr

from gearlib.files import replacing


def write(dataset, path):
    """Write `dataset` to the netCDF file `path`, replacing it in one step.

    The file appears complete or not at all, and holds nothing that changes between two equal
    calculations.

    Parameters
    ----------
    dataset : xarray.Dataset
    path : str or os.PathLike
    """
    # xarray would give NaN as fill value to every float, which CF forbids for coordinates.
    encoding = {name: {"_FillValue": None} for name in dataset.variables}
    for name, variable in dataset.variables.items():
        if variable.ndim and variable.dtype.kind in "if":
            encoding[name] |= {"zlib": True, "complevel": 4, "shuffle": True}
    with replacing(path) as temporary:
        dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)


def read(path):
    """Return the dataset in the netCDF file `path`, in memory, the file closed."""
    return xr.load_dataset(path, engine="netcdf4")
