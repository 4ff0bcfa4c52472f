"""How parameters scatter: by mean and deviation, by limits, by a drawing, by a named distribution.

Limits say where a part may lie and nothing of where in between: between them all values are taken
to be as likely, of ``{min, max}`` and of ``{nominal, upper, lower}``.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import special, stats

from gearlib import checks
from gearlib.models import tolerated

#: The key of the correlations among the tolerances.
CORRELATIONS = "correlations"
#: Nodes of Gauss and Hermite for covariances of what is not normal.
_NODES = 64


class Marginal(NamedTuple):
    """The distribution of one parameter."""

    ppf: Any  #: value of a probability, arrays too
    centre: float  #: that of the nominal design: mean, middle of the limits, nominal value, median
    mean: float
    std: float
    ends: tuple  #: the least and the largest value that there may be


class Tolerances:
    """Parameters that scatter together, by a Gaussian copula where they are correlated."""

    def __init__(self, marginals, correlations=()):
        self.marginals = marginals  #: name -> `Marginal`
        self.names = tuple(marginals)
        self.correlations = tuple(map(tuple, correlations))
        self._root = _root(self.names, self.correlations)

    @property
    def centres(self):
        """Return the values of the nominal design, shape (k,)."""
        return np.array([one.centre for one in self.marginals.values()])

    def values(self, points):
        """Return the parameters of points of the open unit cube, both of shape (n, k)."""
        points = np.asarray(points, float)
        if self._root is not None:
            normal = special.ndtri(points)
            # Not by BLAS, whose sums depend on how many rows there are.
            mixed = np.zeros_like(normal)
            for i, j in zip(*np.nonzero(self._root), strict=True):
                mixed[:, i] += self._root[i, j] * normal[:, j]
            points = special.ndtr(mixed)
        columns = [one.ppf(u) for one, u in zip(self.marginals.values(), points.T, strict=True)]
        return np.stack(columns, axis=1)

    @property
    def covariance(self):
        """Return the covariances of the parameters, shape (k, k), those of the copula too."""
        rows = list(self.marginals.values())
        found = np.diag([one.std**2 for one in rows])
        z, weights = special.roots_hermitenorm(_NODES)
        weights = weights / weights.sum()

        def share(scores):
            # Farther out there are no numbers below 1, and no weight.
            return np.clip(special.ndtr(scores), 1e-16, 1.0 - 1e-16)

        for a, b, rho in self.correlations:
            i, j = self.names.index(a), self.names.index(b)
            other = rho * z[:, None] + math.sqrt(1.0 - rho**2) * z
            x = rows[i].ppf(share(z)) - rows[i].mean
            y = rows[j].ppf(share(other)) - rows[j].mean
            found[i, j] = found[j, i] = weights @ (x[:, None] * y) @ weights
        return found


def read(tolerances, known, own=lambda name: None, keys=None):
    """Return the `Tolerances` of a mapping.

    Parameters
    ----------
    tolerances : mapping
        Name of a parameter -> ``{mean, std}``, ``{min, max}``, ``{nominal, upper, lower}`` with
        deviations from the nominal value, or ``{distribution, ...}`` with a name of `scipy.stats`
        and its parameters. ``correlations``, a list of [name, name, rho], are those of the normal
        scores.
    known : mapping
        Name -> `gearlib.parameters.Parameter`, or None where nothing is declared of it.
    own : callable, optional
        Returns the value that the model has of a name, for what is left out; None: it has none.
    keys : mapping, optional
        Name -> how refusals call it; by default ``tolerances.<name>``.

    Raises
    ------
    ValueError
        Naming the key, its value and the allowed range.
    """
    if not hasattr(tolerances, "items") or not set(tolerances) - {CORRELATIONS}:
        raise checks.refusal(
            "tolerances", tolerances, f"a mapping of parameters to {tolerated.WORDS}"
        )
    found = {}
    for name, given in tolerances.items():
        if name != CORRELATIONS:
            checks.one_of("tolerances", name, tuple(known))
            key = (keys or {}).get(name, f"tolerances.{name}")
            if hasattr(given, "items") and "distribution" in given:
                one = _named(key, given)
            else:
                whole = tolerated.complete(key, given, own(name))
                one, given = _plain(whole), whole
            tolerated.check_range(key, given, known[name], (one.centre, *one.ends))
            found[name] = one
    return Tolerances(found, _correlations(found, tolerances.get(CORRELATIONS, ())))


def _plain(whole):
    centre, low, high = tolerated.extent(whole)
    if "std" in whole:
        std = whole["std"]
        return Marginal(lambda u: centre + std * special.ndtri(u), centre, centre, std, (low, high))
    width = high - low
    middle, std = low + width / 2.0, width / math.sqrt(12.0)
    return Marginal(lambda u: low + width * u, centre, middle, std, (low, high))


def _named(key, given):
    whole, name = given, given["distribution"]
    given = {own: value for own, value in given.items() if own != "distribution"}
    kind = getattr(stats, name, None) if isinstance(name, str) else None
    if not isinstance(kind, stats.rv_continuous):
        words = "the name of a continuous distribution of scipy.stats, such as 'lognorm'"
        raise checks.refusal(f"{key}.distribution", name, words)
    allowed = [*(kind.shapes or "").replace(" ", "").split(","), "loc", "scale"]
    allowed = [one for one in allowed if one]
    numbers = {}
    for own, value in given.items():
        if own not in allowed:
            raise ValueError(
                f"{key}.{own} is not allowed: the parameters of {name!r} are {', '.join(allowed)}"
            )
        numbers[own] = checks.number(f"{key}.{own}", value, "a finite number", math.isfinite)
    for own in allowed[:-2]:
        if own not in numbers:
            raise ValueError(f"{key}.{own} is missing: {name!r} needs {', '.join(allowed[:-2])}")
    frozen = kind(**numbers)
    with np.errstate(all="ignore"):
        middle, mean, std = (float(x) for x in (frozen.median(), frozen.mean(), frozen.std()))
    if not all(map(math.isfinite, (middle, mean, std))) or std <= 0.0:
        words = f"parameters of {name!r} with a finite mean and a finite deviation > 0"
        raise checks.refusal(key, whole, words)
    # Ends of a support need not be met, as 0 of a lognormal one.
    return Marginal(frozen.ppf, middle, mean, std, (-math.inf, math.inf))


def _correlations(marginals, given):
    found = []
    for i, one in enumerate(checks.sequence(f"tolerances.{CORRELATIONS}", given)):
        key = f"tolerances.{CORRELATIONS}[{i}]"
        a, b, rho = checks.many(key, one, 3)
        for name in (a, b):
            checks.one_of(key, name, tuple(marginals))
        checks.require(a != b, key, one, "of two different parameters")
        again = any({a, b} == {c, d} for c, d, _ in found)
        checks.require(not again, key, one, "given once")
        found.append(
            (a, b, checks.number(key, rho, "a number > -1 and < 1", lambda r: -1.0 < r < 1.0))
        )
    return found


def _root(names, correlations):
    """Return the Cholesky factor of the correlations of normal scores, None without any."""
    if not correlations:
        return None
    matrix = np.eye(len(names))
    for a, b, rho in correlations:
        i, j = names.index(a), names.index(b)
        matrix[i, j] = matrix[j, i] = rho
    least = float(np.linalg.eigvalsh(matrix)[0])
    if least <= 1e-12:
        raise ValueError(
            f"tolerances.{CORRELATIONS} = {[list(one) for one in correlations]!r} is not allowed: "
            f"it must be positive definite, and the least eigenvalue is {least:.3g}"
        )
    return np.linalg.cholesky(matrix)
