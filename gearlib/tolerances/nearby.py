"""Derivatives by what scatters, from designs a little ahead of the nominal one and behind it."""

import numpy as np

from gearlib.models import derivatives
from gearlib.models.trains import train_slopes

#: Share of a standard deviation over which differences are taken.
_APART = 1e-3


def fields(designs):
    """Return (names, jacobian): by what the nominal model of designs is differentiated.

    `jacobian`, shape (f, k), are the derivatives of these by the parameters that scatter, central
    differences of the formulas of ratios, drawings and functions. Names of trains of a function are
    directions. None are there where what scatters is none of `Model.derivatives`.
    """
    nominal, none = designs.nominal, ((), np.zeros((0, len(designs.names))))
    try:
        both = list(nearby(designs))
    except ValueError:
        return none
    if nominal.train is nominal:
        found = [train_slopes.between(*one) for one in both]
        if None in found or not all(_differentiable(nominal, one) for one in found):
            return none
        return tuple(found), np.eye(len(designs.names))
    known = set(nominal.derivatives)
    mine = [one for one in derivatives.settable(nominal) if one in known]
    if not all(_alike(nominal, model, mine) for ends in both for model in ends[:2]):
        return none
    change = [
        [(ahead.value(name) - behind.value(name)) / apart for ahead, behind, apart in both]
        for name in mine
    ]
    jacobian = np.nan_to_num(np.array(change))
    moved = np.abs(jacobian).max(axis=1) > 0.0
    return tuple(np.array(mine)[moved].tolist()), jacobian[moved]


def nearby(designs):
    """Yield models a little ahead of the nominal one and behind it, and how far apart.

    Two for each parameter, in its unit; ValueError where one of them cannot be built.
    """
    centres = designs.tolerances.centres
    for i, one in enumerate(designs.tolerances.marginals.values()):
        step = np.zeros(centres.size)
        step[i] = _APART * one.std
        yield designs.model(centres + step), designs.model(centres - step), 2.0 * step[i]


def _differentiable(model, direction):
    try:
        model.complex_step(model.direction(direction))
    except ValueError:
        return False
    return True


def _alike(model, other, names):
    """Return whether two models differ in some of their derivatives and in nothing else."""
    if type(model) is not type(other):
        return False
    try:
        return model.with_values({name: other.value(name) for name in names}) == other
    except ValueError:
        return False


def pieces(follow, designs):
    """Return `Followed.pieces` by what scatters.

    Derivatives are exact where the model has them by what scatters, by the formulas of the drawing
    or of the function; else central differences of designs that are followed.
    """
    fields, jacobian = designs.fields
    if fields:
        return [(values, slopes @ jacobian) for values, slopes in follow.pieces]
    columns: list = [[] for _ in follow.pieces]
    try:
        both = list(nearby(designs))
    except ValueError:  # beside the nominal design there is none
        unknown = np.full((1, len(designs.names)), np.nan)
        return [(values, unknown.repeat(len(values), axis=0)) for values, _ in follow.pieces]
    for ahead, behind, apart in both:
        ends = zip(columns, follow.every(ahead), follow.every(behind), strict=True)
        for column, high, low in ends:
            column.append((high - low) / apart)
    whole = zip(follow.pieces, columns, strict=True)
    return [(values, np.transpose(column)) for (values, _), column in whole]
