"""Read and write datasets as netCDF and CSV; equal data give equal bytes."""

import shutil
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib.data.files import replacing, source_hash, write_table
from gearlib.units import WRITTEN_UNITS
from gearlib.version import __version__


def write(dataset, path):
    """Write a dataset to a netCDF file in one atomic step; raise OSError if that fails.

    The attributes source_hash (hash of the program files) and history are added; an existing
    source_hash is kept. The history, which the CF conventions require, has no time stamp, so that
    equal data give equal bytes.
    """
    history = f"{dataset.attrs.get('title', 'dataset')}: written by gearlib {__version__}"
    sources = dataset.attrs.get("source_hash") or source_hash()
    dataset = dataset.assign_attrs(source_hash=sources, history=history)
    # By default xarray writes NaN as the fill value of floats, which CF forbids for coordinates.
    encoding = {name: {"_FillValue": None} for name in dataset.variables}
    for name, variable in dataset.variables.items():
        # Arrays of integers and floats are compressed.
        if variable.ndim and variable.dtype.kind in "if":
            encoding[name] |= {"zlib": True, "complevel": 4, "shuffle": True}
    with replacing(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
        except (OSError, RuntimeError) as error:
            # The free space is stated, because on a full disk netCDF says only "HDF error".
            free = shutil.disk_usage(Path(path).parent).free // 1024
            raise OSError(f"{path} cannot be written ({error}); {free} kB are free there") from None


def write_rows(dataset, dim, path):
    """Write the variables of a dataset that have the dimension `dim` to a CSV file, atomically.

    The rows follow `dim`. A variable has one column for each entry of its other dimensions. The
    header has names and units, as in ``mesh_force sun 1 [N]``. Raise OSError if the file cannot be
    written.
    """
    columns = {}  # header -> values along `dim`
    coordinates = [dim] if dim in dataset.coords else []
    for name in coordinates + [*dataset.data_vars]:
        if dim not in dataset[name].dims:
            continue
        variable = dataset[name].transpose(dim, ...)
        # Units in the usual notation, such as rpm; dimensionless variables have none.
        unit = variable.attrs.get("units", "1")
        unit = WRITTEN_UNITS.get(unit, unit)
        suffix = f" [{unit}]" if unit else ""
        other_coordinates = [variable[other_dim].values for other_dim in variable.dims[1:]]
        for index in np.ndindex(*variable.shape[1:]):
            labels = [str(values[i]) for values, i in zip(other_coordinates, index, strict=True)]
            header = " ".join([name, *labels]) + suffix
            columns[header] = variable.values[:, *index].tolist()
    write_table([columns, *zip(*columns.values(), strict=True)], path)


def read(path):
    """Read a netCDF file into memory, and return its dataset.

    Raise FileNotFoundError if there is no file at `path`, and OSError if it is damaged or not
    netCDF.
    """
    try:
        return xr.load_dataset(path, engine="netcdf4")
    except FileNotFoundError:
        raise
    except (OSError, RuntimeError) as error:
        raise OSError(f"{path} cannot be read as netCDF ({error}); remove it") from None
