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
    """Collect the numbers of contact events of all datasets of models that are made meanwhile."""
    counts: list = []
    before = _contacts.set(counts)
    try:
        yield counts
    finally:
        _contacts.reset(before)


def stacked(axes, call, *inner):
    """Return name -> (dims, values) of a call for each combination of the values of some axes.

    `axes` has dimension -> values; `call` gets one value of each and returns name -> number, text
    or array; `inner` names the dimensions of arrays, of which smaller arrays have the last ones.
    """
    rows = [call(*values) for values in product(*axes.values())]
    shape = tuple(map(len, axes.values()))

    def column(name):
        kind = object if isinstance(rows[0][name], str) else None
        values = np.array([row[name] for row in rows], kind)
        inner_dims = inner[len(inner) - values.ndim + 1 :]
        return (*axes, *inner_dims), values.reshape(shape + values.shape[1:])

    return {name: column(name) for name in rows[0]}


def result(title, model, data, coords=None, *, method, **parameters):
    """Return the dataset of a model, described, with the parameters of model and call as JSON."""
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
    """Return a described dataset of several models; attributes become text or JSON."""
    dataset = describe(xr.Dataset(data, coords))
    dataset.attrs = _origin(title, method) | {
        name: value if isinstance(value, str) else canonical_json(value)
        for name, value in attributes.items()
    }
    return dataset


def _origin(title, method):
    """Return the attributes that every dataset has."""
    source = f"gearlib {__version__}" + (f", method {method}" if method else "")
    return {"Conventions": "CF-1.11", "title": title, "source": source}
