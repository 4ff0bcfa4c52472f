"""How parameters scatter: by mean and deviation, by limits, by a drawing, by a named distribution.

Limits say where a part may lie and nothing of where in between: between them all values are taken
to be as likely, of ``{min, max}`` and of ``{nominal, upper, lower}``.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import special, stats

from gearlib import checks, parameters

#: The keys of the plain kinds.
KINDS = ({"mean", "std"}, {"min", "max"}, {"nominal", "upper", "lower"})
#: The key of the correlations among the tolerances.
CORRELATIONS = "correlations"
_WORDS = (
    "one of {mean, std}, {min, max}, {nominal, upper, lower} with deviations from the nominal "
    "value, or {distribution: a name of scipy.stats, and its parameters}"
)
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


def read(tolerances, known):
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

    Raises
    ------
    ValueError
        Naming the key, its value and the allowed range.
    """
    if not hasattr(tolerances, "items") or not set(tolerances) - {CORRELATIONS}:
        raise checks.refusal("tolerances", tolerances, f"a mapping of parameters to {_WORDS}")
    found = {}
    for name, given in tolerances.items():
        if name != CORRELATIONS:
            checks.one_of("tolerances", name, tuple(known))
            found[name] = _marginal(f"tolerances.{name}", given, known[name])
    return Tolerances(found, _correlations(found, tolerances.get(CORRELATIONS, ())))


def _marginal(key, given, parameter):
    if not hasattr(given, "items"):
        raise checks.refusal(key, given, _WORDS)
    given = dict(given)
    if "distribution" in given:
        one = _named(key, given)
    elif set(given) not in KINDS:
        raise checks.refusal(key, given, _WORDS)
    else:
        numbers = {
            name: checks.number(f"{key}.{name}", value, "finite", math.isfinite)
            for name, value in given.items()
        }
        one = _plain(key, numbers)
    ends = ("{}.min", "{}.max") if "min" in given else ("least {}", "largest {}")
    _check_range(key, one, parameter, ends)
    return one


def _plain(key, given):
    if "std" in given:
        mean, std = given["mean"], given["std"]
        checks.require(std > 0.0, f"{key}.std", std, "a finite number > 0")
        return Marginal(
            lambda u: mean + std * special.ndtri(u), mean, mean, std, (-math.inf, math.inf)
        )
    if "min" in given:
        low, high = given["min"], given["max"]
        checks.require(low < high, f"{key}.max", high, f"> min = {low!r}")
        return _uniform(low, high, (low + high) / 2.0)
    nominal, upper, lower = (given[name] for name in ("nominal", "upper", "lower"))
    checks.require(lower < upper, f"{key}.upper", upper, f"> lower = {lower!r}")
    return _uniform(nominal + lower, nominal + upper, nominal)


def _uniform(low, high, centre):
    width = high - low
    middle = low + width / 2.0
    return Marginal(lambda u: low + width * u, centre, middle, width / math.sqrt(12.0), (low, high))


def _named(key, given):
    name = given.pop("distribution")
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
        numbers[own] = checks.number(f"{key}.{own}", value, "finite", math.isfinite)
    for own in allowed[:-2]:
        if own not in numbers:
            raise ValueError(f"{key}.{own} is missing: {name!r} needs {', '.join(allowed[:-2])}")
    frozen = kind(**numbers)
    middle, mean, std = (float(x) for x in (frozen.median(), frozen.mean(), frozen.std()))
    if not all(map(math.isfinite, (middle, mean, std))) or std <= 0.0:
        words = f"parameters of {name!r} with a finite mean and a finite deviation > 0"
        raise checks.refusal(key, given, words)
    return Marginal(frozen.ppf, middle, mean, std, tuple(map(float, frozen.support())))


def _check_range(key, one, parameter, ends):
    """Refuse what a parameter can never be; the ends of a tail are a matter of each sample."""
    kind = getattr(parameter, "kind", None)
    if isinstance(kind, parameters.Number):
        for name, end in zip(ends, one.ends, strict=True):
            if math.isfinite(end):
                kind.check(name.format(key), end)
        kind.check(key, one.centre)


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
        found.append((a, b, checks.number(key, rho, "> -1 and < 1", lambda r: -1.0 < r < 1.0)))
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
