"""Results of a computation as one dataset: stacked from its runs, described, with its making."""

from itertools import product

import numpy as np
import xarray as xr

from gearlib.data import provenance
from gearlib.data.variables import describe


def stacked(axes, call, *inner):
    """Return name -> (dims, values) of a call for each combination of values.

    axes: dimension -> its values; call: gets one of each, returns name -> number, text or array;
    inner: the dimensions of arrays, of which those with fewer have the last.
    """
    rows = [call(*values) for values in product(*axes.values())]
    shape = tuple(map(len, axes.values()))

    def column(name):
        kind = object if isinstance(rows[0][name], str) else None
        values = np.array([row[name] for row in rows], kind)
        own = inner[len(inner) - values.ndim + 1 :]
        return (*axes, *own), values.reshape(shape + values.shape[1:])

    return {name: column(name) for name in rows[0]}


def result(title, model, data, coords=None, *, method, **parameters):
    """Return a described dataset of a model; its attributes are `provenance.attributes`."""
    dataset = data if isinstance(data, xr.Dataset) else xr.Dataset(data, coords)
    dataset = describe(dataset, model)
    dataset.attrs = provenance.attributes(title, model, method=method, **parameters)
    return dataset


def result_of_many(title, data, coords, by=None, **more):
    """Return a described dataset of no one model, by a method; more: attributes, text or JSON."""
    dataset = describe(xr.Dataset(data, coords))
    dataset.attrs = provenance.origin(title, by) | {
        name: value if isinstance(value, str) else provenance.canonical_json(value)
        for name, value in more.items()
    }
    return dataset
