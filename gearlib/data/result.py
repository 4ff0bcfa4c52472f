"""The dataset of a computation: variables described, its origin in the attributes.

The attributes hold no times, machines or commits: two equal calculations give equal bytes.
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

_contacts: ContextVar[list | None] = ContextVar("_contacts", default=None)


@contextmanager
def counting_contacts() -> Iterator[list]:
    """Yield a list that collects the contact event counts of each dataset made in this context."""
    counts: list = []
    before = _contacts.set(counts)
    try:
        yield counts
    finally:
        _contacts.reset(before)


def stacked(axes, call, *inner):
    """Call a function on a grid of values; return a dict of variable name -> (dims, values).

    `axes` maps dimension names to values. `call` takes one value of each dimension and returns a
    dict of variable name -> number, text or array; `inner` names the dimensions of these arrays,
    and an array of fewer dimensions has the last of them.
    """
    results = [call(*values) for values in product(*axes.values())]
    shape = tuple(map(len, axes.values()))

    def column(name):
        dtype = object if isinstance(results[0][name], str) else None
        values = np.array([variables[name] for variables in results], dtype)
        inner_dims = inner[len(inner) - values.ndim + 1 :]
        return (*axes, *inner_dims), values.reshape(shape + values.shape[1:])

    return {name: column(name) for name in results[0]}


def result(title, model, data, coords=None, *, method, **parameters):
    """Return a dataset with units and descriptions, and with model and parameters as JSON.

    `data` is a dataset or, with `coords`, its variables; `method` names the engine; `parameters`
    are the arguments of the public call.
    """
    dataset = data if isinstance(data, xr.Dataset) else xr.Dataset(data, coords)
    dataset = describe(dataset, model)
    dataset.attrs = _origin(title.replace("a gear mesh", model.title_noun), method) | {
        "references": model.references,
        "gear_pair" if model.mesh else "model": canonical_json(model.as_dict()),
        "parameters": canonical_json(parameters),
        **({"comment": model.force_note} if model.force_note else {}),
    }
    if (counts := _contacts.get()) is not None:
        counts.append(dataset.sizes.get("event"))
        if "bounces" in dataset:
            counts.append(dataset.bounces.values.tolist())
    return dataset


def result_of_many(title, data, coords, method=None, /, **attributes):
    """Return a dataset of several models with units, descriptions and extra attributes.

    Attributes that are no text are stored as JSON; `method` names the engine, if there is one.
    """
    dataset = describe(xr.Dataset(data, coords))
    dataset.attrs = _origin(title, method) | {
        name: value if isinstance(value, str) else canonical_json(value)
        for name, value in attributes.items()
    }
    return dataset


def _origin(title, method):
    """Return the attributes of every dataset: CF version, title, and library version as source."""
    source = f"gearlib {__version__}" + (f", method {method}" if method else "")
    return {"Conventions": "CF-1.11", "title": title, "source": source}
