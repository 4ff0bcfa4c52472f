"""Results of a computation as one dataset: stacked from its runs, described, with its making."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from itertools import product

import numpy as np
import xarray as xr

from gearlib.data import provenance
from gearlib.data.variables import describe

_contacts: ContextVar[list | None] = ContextVar("_contacts", default=None)


@contextmanager
def counting_contacts() -> Iterator[list]:
    """Collect how many contact events the datasets of models have that are made meanwhile."""
    counts: list = []
    before = _contacts.set(counts)
    try:
        yield counts
    finally:
        _contacts.reset(before)


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


@lru_cache(maxsize=256)
def _index(dimension, names):
    """Return a coordinate of names; datasets copy its attributes, and share its index."""
    return xr.IndexVariable(dimension, list(names))


def _indexed(coords):
    """Return coordinates with those made already in place of lists of names."""
    return {
        name: _index(name, tuple(values))
        if isinstance(values, list) and all(type(one) is str for one in values)
        else values
        for name, values in (coords or {}).items()
    }


def result(title, model, data, coords=None, *, method, **parameters):
    """Return a described dataset of a model; its attributes are `provenance.attributes`."""
    dataset = data if isinstance(data, xr.Dataset) else xr.Dataset(data, _indexed(coords))
    dataset = describe(dataset, model)
    dataset.attrs = provenance.attributes(title, model, method=method, **parameters)
    if (counts := _contacts.get()) is not None:
        counts.append(dataset.sizes.get("event"))
        if "bounces" in dataset:
            counts.append(dataset.bounces.values.tolist())
    return dataset


def result_of_many(title, data, coords, by=None, **more):
    """Return a described dataset of no one model, by a method; more: attributes, text or JSON."""
    dataset = describe(xr.Dataset(data, coords))
    dataset.attrs = provenance.origin(title, by) | {
        name: value if isinstance(value, str) else provenance.canonical_json(value)
        for name, value in more.items()
    }
    return dataset
