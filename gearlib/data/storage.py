"""Reading and writing of datasets as netCDF and CSV; equal data give equal bytes."""

import shutil
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib.data.files import atomic_write, source_hash, write_csv
from gearlib.units import WRITTEN_UNITS
from gearlib.version import __version__


def write(dataset, path):
    """Write a dataset to a netCDF file atomically; raise OSError if it cannot be written.

    The attributes source_hash and history are added; an existing source_hash is kept. The history
    has no time stamp, so that equal data give equal bytes.
    """
    history = f"{dataset.attrs.get('title', 'dataset')}: written by gearlib {__version__}"
    hash_attribute = dataset.attrs.get("source_hash") or source_hash()
    dataset = dataset.assign_attrs(source_hash=hash_attribute, history=history)
    # By default, xarray sets NaN as _FillValue of floats, which CF forbids for coordinates.
    encoding = {name: {"_FillValue": None} for name in dataset.variables}
    for name, variable in dataset.variables.items():
        if variable.ndim and variable.dtype.kind in "if":
            encoding[name] |= {"zlib": True, "complevel": 4, "shuffle": True}
    with atomic_write(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
        except (OSError, RuntimeError) as error:
            # The message states the free space, because netCDF reports a full disk as "HDF error".
            free_kb = shutil.disk_usage(Path(path).parent).free // 1024
            message = f"{path} cannot be written ({error}); {free_kb} kB are free there"
            raise OSError(message) from None


def write_rows(dataset, dim, path):
    """Write the variables with the dimension `dim` to a CSV file atomically, one row per entry.

    A variable has one column for each combination of entries of its other dimensions. Column names
    contain name, entries and unit, as in ``mesh_force sun 1 [N]``. Raise OSError if the file cannot
    be written.
    """
    columns = {}  # column name -> values along `dim`
    coordinates = [dim] if dim in dataset.coords else []
    for name in coordinates + [*dataset.data_vars]:
        if dim not in dataset[name].dims:
            continue
        variable = dataset[name].transpose(dim, ...)
        # The header uses customary notation, such as rpm; dimensionless variables have no unit.
        unit = variable.attrs.get("units", "1")
        unit = WRITTEN_UNITS.get(unit, unit)
        suffix = f" [{unit}]" if unit else ""
        other_coordinates = [variable[other_dim].values for other_dim in variable.dims[1:]]
        for index in np.ndindex(*variable.shape[1:]):
            labels = [str(values[i]) for values, i in zip(other_coordinates, index, strict=True)]
            column_name = " ".join([name, *labels]) + suffix
            columns[column_name] = variable.values[:, *index].tolist()
    write_csv([columns, *zip(*columns.values(), strict=True)], path)


def read(path):
    """Read a netCDF file into memory and return its dataset.

    Raise FileNotFoundError if the file does not exist, and OSError if it cannot be read as netCDF.
    """
    try:
        return xr.load_dataset(path, engine="netcdf4")
    except FileNotFoundError:
        raise
    except (OSError, RuntimeError) as error:
        raise OSError(f"{path} cannot be read as netCDF ({error}); remove it") from None
