"""Datasets to and from netCDF: the same bytes for the same data, whole files or none."""

import shutil
from pathlib import Path

import numpy as np
import xarray as xr

from gearlib.data.files import replacing, write_table
from gearlib.data.provenance import source_hash
from gearlib.version import __version__


def write(dataset, path):
    """Write `dataset` to the netCDF file `path`, replacing it in one step; OSError if it cannot be.

    The file appears complete or not at all, and holds nothing that changes between two equal
    calculations.
    """
    # CF asks for a history. It usually tells the time, which would change the bytes.
    history = f"{dataset.attrs.get('title', 'dataset')}: written by gearlib {__version__}"
    # What is gathered keeps the hash of what computed it.
    made = {"source_hash": dataset.attrs.get("source_hash", source_hash()), "history": history}
    dataset = dataset.assign_attrs(made)
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


def write_rows(dataset, over, path):
    """Write what a dataset has over the dimension `over` as CSV, replacing it in one step.

    A column for each variable, and for each of its entries over other dimensions; the first line
    has names and units, ``displacement_max sun 1 [1]``. OSError if it cannot be written.
    """
    heads, columns = [], []
    names = [over] * (over in dataset.coords)
    names += [name for name in dataset.data_vars if over in dataset[name].dims]
    for name in names:
        variable = dataset[name].transpose(over, ...)
        others = variable.dims[1:]
        labels = [variable.coords.get(dim, np.arange(variable.sizes[dim])) for dim in others]
        unit = variable.attrs.get("units")
        for place in np.ndindex(*variable.shape[1:]):
            words = [name, *(str(np.asarray(own)[i]) for own, i in zip(labels, place, strict=True))]
            heads.append(" ".join(words) + (f" [{unit}]" if unit else ""))
            columns.append(variable.values[(slice(None), *place)].tolist())
    write_table([heads, *zip(*columns, strict=True)], path)


def read(path):
    """Return the dataset in the netCDF file `path`, in memory, the file closed.

    FileNotFoundError if there is no such file. OSError if it cannot be read: cut short, damaged, or
    something else than netCDF.
    """
    try:
        return xr.load_dataset(path, engine="netcdf4")
    except FileNotFoundError:
        raise
    except (OSError, RuntimeError) as error:
        raise OSError(f"{path} cannot be read as netCDF ({error}); remove it") from None
