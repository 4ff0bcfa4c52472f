"""Datasets to and from netCDF and CSV: the same bytes for the same data, whole files or none."""

import shutil
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib.data.files import replacing, source_hash, write_table
from gearlib.parameters import WRITTEN_UNITS
from gearlib.version import __version__


def write(dataset, path):
    """Write a dataset to a netCDF file, replacing it in one step; OSError if it cannot be written.

    A dataset that already has a source hash keeps it. The history attribute, which the CF
    conventions require, has no time stamp, so that equal data give equal bytes.
    """
    history = f"{dataset.attrs.get('title', 'dataset')}: written by gearlib {__version__}"
    sources = dataset.attrs.get("source_hash") or source_hash()
    dataset = dataset.assign_attrs(source_hash=sources, history=history)
    # By default xarray writes NaN as fill value of floats, which CF forbids for coordinates.
    encoding = {name: {"_FillValue": None} for name in dataset.variables}
    for name, variable in dataset.variables.items():
        if variable.ndim and variable.dtype.kind in "if":
            encoding[name] |= {"zlib": True, "complevel": 4, "shuffle": True}
    with replacing(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
        except (OSError, RuntimeError) as error:
            # On a full disk the message of netCDF is only "HDF error".
            free = shutil.disk_usage(Path(path).parent).free // 1024
            raise OSError(f"{path} cannot be written ({error}); {free} kB are free there") from None


def write_rows(dataset, dim, path):
    """Write the variables of a dataset that have the dimension `dim` to a CSV file, in one step.

    A variable with other dimensions has a column for each of their entries. The first line has
    names and units, as in ``mesh_force sun 1 [N]``. OSError if it cannot be written.
    """
    columns = {}
    coordinates = [dim] if dim in dataset.coords else []
    for name in coordinates + [*dataset.data_vars]:
        if dim not in dataset[name].dims:
            continue
        variable = dataset[name].transpose(dim, ...)
        unit = variable.attrs.get("units", "1")
        unit = WRITTEN_UNITS.get(unit, unit)
        unit = f" [{unit}]" if unit else ""
        labels = [variable[other].values for other in variable.dims[1:]]
        for index in np.ndindex(*variable.shape[1:]):
            entry = [str(label[i]) for label, i in zip(labels, index, strict=True)]
            columns[" ".join([name, *entry]) + unit] = variable.values[:, *index].tolist()
    write_table([columns, *zip(*columns.values(), strict=True)], path)


def read(path):
    """Return the dataset in the netCDF file `path`, in memory, the file closed.

    FileNotFoundError if there is no such file; OSError if it is damaged or no netCDF.
    """
    try:
        return xr.load_dataset(path, engine="netcdf4")
    except FileNotFoundError:
        raise
    except (OSError, RuntimeError) as error:
        raise OSError(f"{path} cannot be read as netCDF ({error}); remove it") from None
