"""How parameters scatter: by mean and deviation, by limits, by a drawing, by a named distribution.

Limits say where a part may lie and nothing of where in between: between them all values are taken
to be as likely, of ``{min, max}`` and of ``{nominal, upper, lower}``.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import special, stats

from gearlib import checks
from gearlib.models import tolerated

#: The key of the correlations among the tolerances.
CORRELATIONS = "correlations"


class Marginal(NamedTuple):
    """The distribution of one parameter."""

    law: Any  #: a frozen distribution of `scipy.stats`
    centre: float  #: that of the nominal design: mean, middle of the limits, nominal value, median
    ends: tuple = (-math.inf, math.inf)  #: the least and the largest value that there may be


class Tolerances:
    """Parameters that scatter together, by a Gaussian copula where they are correlated."""

    def __init__(self, marginals: dict, correlations: Sequence = ()):
        self.marginals = marginals  #: name -> `Marginal`
        self.names = tuple(marginals)
        self.correlations = tuple(map(tuple, correlations))
        self._root = _root(self.names, self.correlations)

    @property
    def centres(self) -> np.ndarray:
        """Return the values of the nominal design, shape (k,)."""
        return np.array([marginal.centre for marginal in self.marginals.values()])

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the parameters of points of the open unit cube, both of shape (n, k)."""
        points = np.asarray(points, float)
        if self.correlations:
            # Not by BLAS, whose sums depend on how many rows there are.
            scores = special.ndtri(points)
            points = special.ndtr(np.stack([(scores * row).sum(axis=1) for row in self._root], 1))
        laws = [marginal.law for marginal in self.marginals.values()]
        return np.stack([law.ppf(u) for law, u in zip(laws, points.T, strict=True)], axis=1)


def read(
    tolerances: Any,
    known: Mapping,
    value_of: Callable = lambda name: None,
    keys: Mapping | None = None,
) -> Tolerances:
    """Return the `Tolerances` of a mapping as `gearlib.scatter` takes it, or raise ValueError.

    `known` maps names to their `gearlib.parameters.Parameter` or None, `value_of` returns the value
    that the model has of a name, `keys` maps names to those in refusals, by default
    ``tolerances.<name>``.
    """
    if not hasattr(tolerances, "items") or not set(tolerances) - {CORRELATIONS}:
        raise checks.refusal(
            "tolerances", tolerances, f"a mapping of parameters to {tolerated.WORDS}"
        )
    marginals = {}
    for name, given in tolerances.items():
        if name != CORRELATIONS:
            checks.one_of("tolerances", name, tuple(known))
            key = (keys or {}).get(name, f"tolerances.{name}")
            if hasattr(given, "items") and "distribution" in given:
                marginal = _named(key, given)
            else:
                given = tolerated.complete(key, given, value_of(name))
                marginal = _plain(given)
            tolerated.check_range(key, given, known[name], (marginal.centre, *marginal.ends))
            marginals[name] = marginal
    return Tolerances(marginals, _correlations(marginals, tolerances.get(CORRELATIONS, ())))


def _plain(given: dict) -> Marginal:
    """Return the normal distribution of mean and deviation, the uniform one of limits."""
    centre, low, high = tolerated.extent(given)
    if "std" in given:
        return Marginal(stats.norm(centre, given["std"]), centre)
    return Marginal(stats.uniform(low, high - low), centre, (low, high))


def _named(key: str, given: Any) -> Marginal:
    """Return a distribution of `scipy.stats` by its name and parameters."""
    name = given["distribution"]
    kind: Any = getattr(stats, name, None) if isinstance(name, str) else None
    words = "the name of a continuous distribution of scipy.stats, such as 'lognorm'"
    checks.require(isinstance(kind, stats.rv_continuous), f"{key}.distribution", name, words)
    shapes = [shape.strip() for shape in (kind.shapes or "").split(",") if shape]
    allowed, numbers = [*shapes, "loc", "scale"], {}
    for parameter in [parameter for parameter in given if parameter != "distribution"]:
        if parameter not in allowed:
            raise ValueError(
                f"{key}.{parameter} is not allowed: the parameters of {name!r} are "
                f"{', '.join(allowed)}"
            )
        where, value = f"{key}.{parameter}", given[parameter]
        numbers[parameter] = checks.number(where, value, "a finite number", math.isfinite)
    for shape in shapes:
        if shape not in numbers:
            raise ValueError(f"{key}.{shape} is missing: {name!r} needs {', '.join(shapes)}")
    law = kind(**numbers)
    with np.errstate(all="ignore"):
        middle, mean, std = (float(x) for x in (law.median(), law.mean(), law.std()))
    fits = all(map(math.isfinite, (middle, mean, std))) and std > 0.0
    words = f"parameters of {name!r} with a finite mean and a finite deviation > 0"
    checks.require(fits, key, given, words)
    # Ends of a support need not be met, as 0 of a lognormal one.
    return Marginal(law, middle)


def _correlations(marginals: dict, given: Any) -> list[tuple]:
    """Return the correlations (name, name, rho), checked."""
    correlations: list = []
    for i, row in enumerate(checks.many(f"tolerances.{CORRELATIONS}", given)):
        key = f"tolerances.{CORRELATIONS}[{i}]"
        a, b, rho = checks.many(key, row, 3)
        for name in (a, b):
            checks.one_of(key, name, tuple(marginals))
        checks.require(a != b, key, row, "of two different parameters")
        again = any({a, b} == {c, d} for c, d, _ in correlations)
        checks.require(not again, key, row, "given once")
        rho = checks.number(key, rho, "a number > -1 and < 1", lambda r: -1.0 < r < 1.0)
        correlations.append((a, b, rho))
    return correlations


def _root(names: tuple, correlations: tuple) -> np.ndarray:
    """Return the Cholesky factor of the correlations of normal scores."""
    matrix = np.eye(len(names))
    for a, b, rho in correlations:
        i, j = names.index(a), names.index(b)
        matrix[i, j] = matrix[j, i] = rho
    least = float(np.linalg.eigvalsh(matrix)[0])
    if least <= 1e-12:
        raise ValueError(
            f"tolerances.{CORRELATIONS} = {[list(row) for row in correlations]!r} is not allowed: "
            f"it must be positive definite, and the least eigenvalue is {least:.3g}"
        )
    return np.linalg.cholesky(matrix)
