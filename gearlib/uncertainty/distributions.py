"""Read distributions of parameters: mean and deviation, limits, or a distribution of `scipy.stats`.

Limits do not determine the distribution between them, so ``{min, max}`` and ``{nominal, upper,
lower}`` are read as uniform distributions.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Gt, Lt
from scipy import special, stats

from gearlib import checks, parameters
from gearlib.models import tolerated
from gearlib.parameters import Finite, Unit

#: Key of the correlations in the mapping of tolerances.
CORRELATIONS = "correlations"


class Marginal(NamedTuple):
    """The distribution of one parameter."""

    distribution: Any  #: a frozen distribution of `scipy.stats`
    centre: float  #: nominal value: mean, midpoint of the limits, given nominal value or median
    limits: tuple = (-math.inf, math.inf)  #: least and largest possible value


class Tolerances:
    """Joint distribution of all scattering parameters; correlations form a Gaussian copula."""

    def __init__(self, marginals: dict, correlations: Sequence = ()):
        """Store a `Marginal` (distribution) for each name, and correlations between parameters.

        `correlations` has rows (name, name, coefficient). The coefficients are correlations of
        normally distributed variables, which are transformed to the distributions (Gaussian
        copula). Raise ValueError if their matrix is not positive definite.
        """
        self.marginals = marginals
        self.names = tuple(marginals)
        self.correlations = tuple(map(tuple, correlations))
        matrix = np.eye(len(self.names))
        for name, other_name, coefficient in self.correlations:
            i, j = self.names.index(name), self.names.index(other_name)
            matrix[i, j] = matrix[j, i] = coefficient
        smallest_eigenvalue = float(np.linalg.eigvalsh(matrix)[0])
        if smallest_eigenvalue <= 1e-12:
            rows = [list(row) for row in self.correlations]
            raise ValueError(
                f"tolerances.{CORRELATIONS} = {rows!r} is not allowed: its matrix must be positive "
                f"definite, but the smallest eigenvalue is {smallest_eigenvalue:.3g}"
            )
        self._cholesky_factor = np.linalg.cholesky(matrix)

    @property
    def centres(self) -> np.ndarray:
        """Return the nominal values of the k parameters, shape (k,)."""
        return np.array([marginal.centre for marginal in self.marginals.values()])

    def values(self, points: np.ndarray) -> np.ndarray:
        """Transform points of the open unit cube, (n, k), to values of the k parameters, (n, k).

        The coordinates of a point are probabilities: after correlation by a Gaussian copula, they
        are transformed by the quantile function of each parameter.
        """
        points = np.asarray(points, float)
        if self.correlations:
            normal_scores = special.ndtri(points)
            # The rounding errors of a matrix product would depend on the number of rows of a shard.
            correlated = [(normal_scores * row).sum(axis=1) for row in self._cholesky_factor]
            points = special.ndtr(np.stack(correlated, 1))
        columns = []
        for marginal, probabilities in zip(self.marginals.values(), points.T, strict=True):
            columns.append(marginal.distribution.ppf(probabilities))
        return np.stack(columns, axis=1)


_Correlation = Annotated[float, Gt(-1), Lt(1), Unit("1")]


def read_tolerances(tolerances, allowed_parameters, value_of=lambda name: None) -> Tolerances:
    """Read the tolerances of parameters as a joint distribution, or raise ValueError.

    `tolerances` maps names of parameters to ``{mean, std}``, ``{min, max}``, ``{nominal, upper,
    lower}`` or ``{distribution, ...}``, and "correlations" to rows (name, name, coefficient).
    `allowed_parameters` maps names of parameters to declarations of their range, or to None;
    `value_of` is a function that returns the nominal value of a parameter, or None. In messages a
    parameter is called ``tolerances.<name>``.
    """
    if not hasattr(tolerances, "items") or not set(tolerances) - {CORRELATIONS}:
        allowed = f"a mapping of parameters to {tolerated.ALLOWED_SCATTER}"
        raise checks.InputError("tolerances", tolerances, allowed)
    marginals = {}
    for name, tolerance in tolerances.items():
        if name != CORRELATIONS:
            checks.check_choice("tolerances", name, tuple(allowed_parameters))
            key = f"tolerances.{name}"
            if hasattr(tolerance, "items") and "distribution" in tolerance:
                marginal = _named_distribution(key, tolerance)
            else:
                tolerance = tolerated.complete_scatter(key, tolerance, value_of(name))
                centre, low, high = tolerated.centre_and_limits(tolerance)
                if "std" in tolerance:
                    marginal = Marginal(stats.norm(centre, tolerance["std"]), centre)
                else:
                    marginal = Marginal(stats.uniform(low, high - low), centre, (low, high))
            values = marginal.centre, *marginal.limits
            tolerated.check_range(key, tolerance, allowed_parameters[name], values)
            marginals[name] = marginal
    correlations: dict = {}
    rows = checks.check_sequence(f"tolerances.{CORRELATIONS}", tolerances.get(CORRELATIONS, ()))
    for i, row in enumerate(rows):
        # A pair of parameters may have only one correlation, in either order of the names.
        key = f"tolerances.{CORRELATIONS}[{i}]"
        first_name, second_name, coefficient = checks.check_sequence(key, row, 3)
        for name in (first_name, second_name):
            checks.check_choice(key, name, tuple(marginals))
        checks.require(first_name != second_name, key, row, "two different parameters")
        names = frozenset((first_name, second_name))
        checks.require(
            names not in correlations, key, row, "a pair of parameters that occurs only once"
        )
        coefficient = parameters.check(key, coefficient, _Correlation)
        correlations[names] = first_name, second_name, coefficient
    return Tolerances(marginals, list(correlations.values()))


def _named_distribution(key: str, tolerance: Any) -> Marginal:
    """Return a distribution of `scipy.stats` that is given by its name, as a `Marginal`.

    `tolerance` maps "distribution" to its name, such as "lognorm", and each of its parameters to a
    number; `key` is the name of the tolerance in messages. The nominal value is the median. Raise
    ValueError for an unknown name, wrong parameters, or an infinite mean or standard deviation.
    """
    name = tolerance["distribution"]
    family: Any = getattr(stats, name, None) if isinstance(name, str) else None
    allowed = "the name of a continuous distribution of scipy.stats, such as 'lognorm'"
    checks.require(isinstance(family, stats.rv_continuous), f"{key}.distribution", name, allowed)
    shapes = [shape.strip() for shape in (family.shapes or "").split(",") if shape]
    allowed_names = [*shapes, "loc", "scale"]
    numbers = {}
    for parameter, value in tolerance.items():
        if parameter == "distribution":
            continue
        if parameter not in allowed_names:
            problem = f"is not allowed: the parameters of {name!r} are {', '.join(allowed_names)}"
            raise checks.InputError(f"{key}.{parameter}", problem=problem)
        numbers[parameter] = parameters.check(f"{key}.{parameter}", value, Finite)
    for shape in shapes:
        if shape not in numbers:
            problem = f"is missing: {name!r} needs {', '.join(shapes)}"
            raise checks.InputError(f"{key}.{shape}", problem=problem)
    distribution = family(**numbers)
    with np.errstate(all="ignore"):
        median, mean = float(distribution.median()), float(distribution.mean())
        std = float(distribution.std())
    has_moments = all(map(math.isfinite, (median, mean, std))) and std > 0.0
    allowed = f"parameters of {name!r} with a finite mean and a finite standard deviation > 0"
    checks.require(has_moments, key, tolerance, allowed)
    # The limits remain infinite, because an end of the support, such as 0 for a lognormal
    # distribution, need not be a valid value of the parameter.
    return Marginal(distribution, median)
