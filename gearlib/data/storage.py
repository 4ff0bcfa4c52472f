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

    A dataset that was gathered keeps the source hash of what computed it. The history that CF asks
    for names no time, which would change the bytes.
    """
    history = f"{dataset.attrs.get('title', 'dataset')}: written by gearlib {__version__}"
    sources = dataset.attrs.get("source_hash") or source_hash()
    dataset = dataset.assign_attrs(source_hash=sources, history=history)
    # xarray would give NaN as fill value to every float, which CF forbids for coordinates.
    encoding = {name: {"_FillValue": None} for name in dataset.variables}
    for name, variable in dataset.variables.items():
        if variable.ndim and variable.dtype.kind in "if":
            encoding[name] |= {"zlib": True, "complevel": 4, "shuffle": True}
    with replacing(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="netcdf4", format="NETCDF4", encoding=encoding)
        except (OSError, RuntimeError) as error:
            # On a full disk netCDF says no more than "HDF error".
            free = shutil.disk_usage(Path(path).parent).free // 1024
            raise OSError(f"{path} cannot be written ({error}); {free} kB are free there") from None


def write_rows(dataset, dim, path):
    """Write the variables of a dataset over one dimension as CSV, in one step.

    Each variable has a column for each of its entries over other dimensions. The first line has
    names and units, as in ``mesh_force sun 1 [N]``. OSError if it cannot be written.
    """
    columns = {}
    for name in [dim] * (dim in dataset.coords) + [*dataset.data_vars]:
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
