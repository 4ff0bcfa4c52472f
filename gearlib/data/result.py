"""Datasets of results: variables with units and descriptions, attributes with their origin.

The attributes have no times, machines or commits, so that equal calculations give equal bytes.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import product

import numpy as np
import xarray as xr

from gearlib.data.files import canonical_json
from gearlib.data.variables import describe
from gearlib.version import __version__

_contact_counts: ContextVar[list | None] = ContextVar("_contact_counts", default=None)


@contextmanager
def counting_contacts() -> Iterator[list]:
    """Yield a list to which `result` appends the contact counts of each dataset that it creates.

    In the block, `result` adds the number of contact events of a dataset, or None if it records
    none, and then its bounces (losses of contact per mesh period), a number or a nested list, if it
    has them. Equal lists mean that two calculations had equal contacts.
    """
    counts: list = []
    token = _contact_counts.set(counts)
    try:
        yield counts
    finally:
        _contact_counts.reset(token)


def stacked(axes, function, *array_dims):
    """Call a function at all points of a grid, and return its results as one dict.

    `axes` maps the dimension names of the grid to their values. The function takes one value of
    each dimension and returns a dict of variable name -> number, string or array. `array_dims` are
    the dimensions of its arrays; an array with fewer dimensions has the last of `array_dims`. The
    result maps each variable name to (dims, values).
    """
    results = [function(*values) for values in product(*axes.values())]
    grid_shape = tuple(len(values) for values in axes.values())

    def stack(name):
        """Return (dims, values) of the variable `name`, with the dimensions of the grid first.

        Values that are strings become an array of objects.
        """
        dtype = object if isinstance(results[0][name], str) else None
        values = np.array([variables[name] for variables in results], dtype)
        # The first axis of `values` is the number of the grid point.
        dims = array_dims[len(array_dims) - (values.ndim - 1) :]
        return (*axes, *dims), values.reshape(grid_shape + values.shape[1:])

    return {name: stack(name) for name in results[0]}


def result(title, model, data, coords=None, *, method, **parameters):
    """Return the dataset that a public function returns, with units, descriptions and its origin.

    `data` is a dataset, or a dict of its variables with the coordinates `coords`. The words "a gear
    mesh" in the title are a placeholder for the kind of model, `model.title_noun`. `method` names
    the method of computation. The model and `parameters`, the arguments of the public function, are
    stored as JSON.
    """
    dataset = data if isinstance(data, xr.Dataset) else xr.Dataset(data, coords)
    dataset = describe(dataset, model)
    dataset.attrs = _origin(title.replace("a gear mesh", model.title_noun), method) | {
        "references": model.references,
        "gear_pair" if model.pair else "model": canonical_json(model.as_dict()),
        "parameters": canonical_json(parameters),
    }
    if model.stiffness_model:
        dataset.attrs["stiffness_model"] = model.stiffness_model
    if model.force_note:
        dataset.attrs["comment"] = model.force_note
    # In a block of `counting_contacts` the numbers of contacts are noted.
    if (counts := _contact_counts.get()) is not None:
        counts.append(dataset.sizes.get("event"))
        if "bounces" in dataset:
            counts.append(dataset.bounces.values.tolist())
    return dataset


def result_of_many(title, data, coords, method=None, /, **attributes):
    """Return the dataset of a study of several models, with units, descriptions and attributes.

    `data` is a dict of variables with the coordinates `coords`; `method` names the method of
    computation, or is None. Attributes other than strings are stored as JSON.
    """
    dataset = describe(xr.Dataset(data, coords))
    dataset.attrs = _origin(title, method) | {
        name: value if isinstance(value, str) else canonical_json(value)
        for name, value in attributes.items()
    }
    return dataset


def _origin(title, method):
    """Return the attributes that all datasets have: CF version, `title` and source.

    The source is the version of the library and, if it is not None, `method`, the method of
    computation. CF is a convention for the metadata of netCDF files.
    """
    source = f"gearlib {__version__}, method {method}" if method else f"gearlib {__version__}"
    return {"Conventions": "CF-1.11", "title": title, "source": source}
