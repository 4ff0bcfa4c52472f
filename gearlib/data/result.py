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
    """Yield a list of contact counts; equal lists mean that calculations had equal contacts.

    For each dataset `result` appends the number of events, None if it has no events, and then its
    bounces, a number or a nested list, if it has that variable.
    """
    counts: list = []
    token = _contact_counts.set(counts)
    try:
        yield counts
    finally:
        _contact_counts.reset(token)


def stacked(axes, function, *array_dims):
    """Call a function on a grid of values; return a dict of variable name -> (dims, values).

    `axes` maps dimension names to values. The function takes a value of each dimension and returns
    a dict of variable name -> number, text or array; `array_dims` are the dimensions of its arrays;
    an array with fewer dimensions has the last ones of these.
    """
    results = [function(*values) for values in product(*axes.values())]
    grid_shape = tuple(map(len, axes.values()))

    def stack(name):
        """Return (dims, values) of a variable from all results; array_dims come after the grid."""
        dtype = object if isinstance(results[0][name], str) else None
        values = np.array([variables[name] for variables in results], dtype)
        # The first axis of the values is that of the results.
        dims = array_dims[len(array_dims) - (values.ndim - 1) :]
        return (*axes, *dims), values.reshape(grid_shape + values.shape[1:])

    return {name: stack(name) for name in results[0]}


def result(title, model, data, coords=None, *, method, **parameters):
    """Create the dataset that a public function returns, with units, descriptions and its origin.

    `data` is a dataset, or a dict of its variables beside `coords`. The text "a gear mesh" in the
    title is a placeholder for the name of the kind of model, `model.title_noun`. `method` names the
    method of computation; `parameters`, the arguments of the public function, are stored as JSON,
    as is the model.
    """
    dataset = data if isinstance(data, xr.Dataset) else xr.Dataset(data, coords)
    dataset = describe(dataset, model)
    dataset.attrs = _origin(title.replace("a gear mesh", model.title_noun), method) | {
        "references": model.references,
        "gear_pair" if model.pair else "model": canonical_json(model.as_dict()),
        "parameters": canonical_json(parameters),
        **({"stiffness_model": model.stiffness_model} if model.stiffness_model else {}),
        **({"comment": model.force_note} if model.force_note else {}),
    }
    if (counts := _contact_counts.get()) is not None:
        counts.append(dataset.sizes.get("event"))
        if "bounces" in dataset:
            counts.append(dataset.bounces.values.tolist())
    return dataset


def result_of_many(title, data, coords, method=None, /, **attributes):
    """Return a dataset of several models with units, descriptions and extra attributes.

    Attributes other than texts are stored as JSON; `method` names the method of computation.
    """
    dataset = describe(xr.Dataset(data, coords))
    dataset.attrs = _origin(title, method) | {
        name: value if isinstance(value, str) else canonical_json(value)
        for name, value in attributes.items()
    }
    return dataset


def _origin(title, method):
    """Return the attributes of every dataset: CF version, title, and library version and method."""
    source = f"gearlib {__version__}" + (f", method {method}" if method else "")
    return {"Conventions": "CF-1.11", "title": title, "source": source}
