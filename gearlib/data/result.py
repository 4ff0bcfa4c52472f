"""Datasets of results: variables with units and descriptions, attributes with their origin.

The attributes contain no times, machines or commits, so that equal computations give equal bytes.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import product

import numpy as np
import xarray as xr

from gearlib.data.files import canonical_json
from gearlib.data.variables import add_metadata
from gearlib.version import __version__

_contact_counts: ContextVar[list | None] = ContextVar("_contact_counts", default=None)


@contextmanager
def collect_contact_counts() -> Iterator[list]:
    """Yield a list to which `make_result` appends contact counts while the block is executed.

    For each dataset it appends the number of contact events, or None if they are not recorded, and
    the bounces (losses of contact per mesh period, a number or a nested list) if there are any.
    Two computations with equal lists have the same number of contacts.
    """
    counts: list = []
    token = _contact_counts.set(counts)
    try:
        yield counts
    finally:
        _contact_counts.reset(token)


def evaluate_on_grid(axes, function, *array_dims):
    """Evaluate a function at all points of a grid; return a dict of name -> (dims, values).

    `axes` maps the dimensions of the grid to their values. The function takes one value per
    dimension and returns a dict of variable name -> number, string or array. `array_dims` are the
    dimensions of its arrays; arrays with fewer dimensions have the last of `array_dims`.
    """
    results = [function(*values) for values in product(*axes.values())]
    grid_shape = tuple(len(values) for values in axes.values())

    def stack(name):
        """Return (dims, values) of the variable `name`, with the dimensions of the grid first."""
        dtype = object if isinstance(results[0][name], str) else None
        values = np.array([variables[name] for variables in results], dtype)
        # The first axis of `values` is the index of the grid point.
        dims = array_dims[len(array_dims) - (values.ndim - 1) :]
        return (*axes, *dims), values.reshape(grid_shape + values.shape[1:])

    return {name: stack(name) for name in results[0]}


def make_result(title, model, data, coords=None, *, method, **parameters):
    """Make the dataset that a public function returns, with units, descriptions and its origin.

    `data` is a dataset, or a dict of variables for the coordinates `coords`. In the title, "a gear
    mesh" is replaced by `model.title_noun`. `method` is the name of the computational method. The
    model and `parameters`, the arguments of the public function, are stored as JSON attributes.
    """
    dataset = data if isinstance(data, xr.Dataset) else xr.Dataset(data, coords)
    dataset = add_metadata(dataset, model)
    dataset.attrs = _origin_attributes(title.replace("a gear mesh", model.title_noun), method) | {
        "references": model.references,
        "gear_pair" if model.pair else "model": canonical_json(model.as_dict()),
        "parameters": canonical_json(parameters),
    }
    if model.stiffness_model:
        dataset.attrs["stiffness_model"] = model.stiffness_model
    if model.force_note:
        dataset.attrs["comment"] = model.force_note
    # The list exists only inside a block of `collect_contact_counts`.
    if (counts := _contact_counts.get()) is not None:
        counts.append(dataset.sizes.get("event"))
        if "bounces" in dataset:
            counts.append(dataset.bounces.values.tolist())
    return dataset


def make_study_result(title, data, coords, method=None, /, **attributes):
    """Make the dataset of a study of several models, with units, descriptions and its origin.

    `data` is a dict of variables for the coordinates `coords`; `method` is the name of the
    computational method, or None. Attributes that are not strings are stored as JSON.
    """
    dataset = add_metadata(xr.Dataset(data, coords))
    dataset.attrs = _origin_attributes(title, method) | {
        name: value if isinstance(value, str) else canonical_json(value)
        for name, value in attributes.items()
    }
    return dataset


def _origin_attributes(title, method):
    """Return the attributes of all datasets: version of the CF conventions, title and source.

    The source is the version of the library, with the computational `method` if it is not None.
    """
    source = f"gearlib {__version__}, method {method}" if method else f"gearlib {__version__}"
    return {"Conventions": "CF-1.11", "title": title, "source": source}
