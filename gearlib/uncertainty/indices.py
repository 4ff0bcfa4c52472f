"""`sobol_indices`: fractions of the variance of a quantity that each tolerance causes.

The first-order index of a parameter is the fraction of the variance that vanishes on average if
this parameter is fixed; the total index is the fraction that remains on average if all others are
fixed (Saltelli et al.: Comput. Phys. Comm. 181 (2010) 259-270).
"""

import itertools
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from scipy.stats import bootstrap, qmc

from gearlib import checks
from gearlib.data.result import result
from gearlib.parameters import INTEGER, Speed, Unit, WholeNumber, checked
from gearlib.progress import Limit, with_bar
from gearlib.runs.run_arguments import MaxSeconds
from gearlib.uncertainty.design_quantities import QUANTITIES, checked_names, quantity_evaluator
from gearlib.uncertainty.designs import Designs

_BOOTSTRAP_RESAMPLES = 200


@checked
def sobol_indices(
    model,
    tolerances,
    quantities=("jump_up", "jump_down"),
    n: Annotated[int, Ge(2), Le(2**24), INTEGER] = 1024,
    *,
    speed: Speed | None = None,
    confidence: Annotated[float, Gt(0), Lt(1), Unit("1")] = 0.95,
    seed: WholeNumber = 0,
    progress=None,
    max_seconds: MaxSeconds = None,
):
    """Return Sobol' indices of quantities by tolerances, with bootstrapped sampling errors.

    Parameters
    ----------
    model, tolerances, quantities, seed, progress, max_seconds
        The same arguments as those of `gearlib.scatter`; correlations are not allowed.
    n : int, default 1024
        Number of samples, a power of 2; n (k + 2) designs are computed for k parameters.
    speed : float, optional
        Speed of the duty point, rpm, for quantities of the duty point.
    confidence : float, default 0.95
        Confidence level of the intervals.

    Returns
    -------
    xarray.Dataset
        Over ``quantity`` and ``parameter``: first_index, total_index, and with ``bound`` their
        intervals first_index_interval, total_index_interval. Over ``quantity``: missing_designs,
        the number of designs that cannot be built or do not have the quantity. They are replaced
        by other designs, so the indices hold for designs that have the quantity.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    checks.require(n & (n - 1) == 0, "n", n, "a power of 2")
    checks.require(progress is None or callable(progress), "progress", progress, "a function")
    designs = Designs(model, tolerances, seed)
    if designs.tolerances.correlations:
        raise ValueError(
            "tolerances.correlations is not allowed: Sobol' indices need independent parameters"
        )
    quantities = checked_names("quantities", quantities, tuple(QUANTITIES))
    checks.require(quantities, "quantities", quantities, "at least one")
    evaluator = quantity_evaluator(designs, quantities, speed)
    limit = Limit(max_seconds)
    tables = _design_tables(designs, evaluator, n, progress, limit)
    indices = [
        _indices_with_intervals(table, confidence, seed, name)
        for table, name in zip(tables, quantities, strict=True)
    ]
    dims, data = ("quantity", "parameter"), {}
    for i, name in enumerate(("first_index", "total_index")):
        data[name] = dims, [values[i] for values, _ in indices]
        data[f"{name}_interval"] = (*dims, "bound"), [intervals[i] for _, intervals in indices]
    data["missing_designs"] = "quantity", np.isnan(tables).sum(axis=(1, 2)).astype(np.int32)
    coords = {"quantity": [*quantities], "parameter": [*designs.names], "bound": ["low", "high"]}
    attributes = {"tolerances": tolerances, "samples": n, "seed": seed, "confidence": confidence}
    title = "Sobol' indices of a gear mesh by its tolerances"
    dataset = result(title, designs.nominal, data, coords, method="Saltelli 2010", **attributes)
    return limit.mark(dataset, list(range(tables.shape[2], n)))


def _design_tables(designs: Designs, evaluator: Any, n: int, progress: Any, limit: Limit) -> Any:
    """Return the values of each quantity for the designs of Saltelli's method, (q, k + 2, n).

    If the time of the `Limit` ends, only the first of the n samples are returned.

    The k + 2 rows belong to two independent samples A and B of the k parameters, and to k copies of
    A with one parameter of B each. Values are NaN for designs that do not have the quantity.
    """
    k = len(designs.names)
    cube = qmc.Sobol(2 * k, rng=designs.seed).random(n)
    a, b = cube[:, :k], cube[:, k:]
    points = np.stack([a, b, *(np.where(np.arange(k) == i, b, a) for i in range(k))])
    parameters = designs.tolerances.values(points.reshape(-1, k)).reshape(k + 2, n, -1)
    values = np.full((k + 2, n, len(evaluator.quantities)), np.nan)
    # There are no indices of a single sample.
    for i in limit.each(with_bar("pairs of samples", range(0, n, 2), n // 2)):
        for place in itertools.product(range(k + 2), (i, i + 1)):
            row = parameters[place]
            try:
                design = designs.model(row)
            except ValueError:
                pass
            else:
                values[place], _ = evaluator.evaluate(design, designs.duty_model_builder(row))
            if progress:
                progress(1)
    return np.moveaxis(values[:, : i + 2], 2, 0)


def _indices_with_intervals(table: np.ndarray, level: float, seed: int, name: str) -> tuple:
    """Return first and total indices of a quantity, (2, k), and their intervals, (2, k, 2)."""
    n, complete = table.shape[1], np.flatnonzero(np.isfinite(table).all(axis=0))
    count = complete.size
    if count < 2:
        raise ValueError(
            f"quantities = {name!r} is not allowed with these tolerances: only {count} of {n} "
            "samples have it in all designs that are compared"
        )
    # Incomplete samples are replaced by complete ones at equal distances, because Sobol' points
    # need all n samples.
    samples, missing_count = np.arange(n), n - count
    replacements = np.arange(missing_count) * count // max(missing_count, 1) % count
    samples[np.isnan(table).any(axis=0)] = complete[replacements]
    table = table[:, samples]

    def indices(columns):
        """Return the indices, (2, k), by the estimators of Saltelli (2010) and Jansen (1999)."""
        centred = table[:, columns] - table[:2, columns].mean()
        a, b, mixed = centred[0], centred[1], centred[2:]
        variances = (b * (mixed - a)).mean(axis=1), 0.5 * ((mixed - a) ** 2).mean(axis=1)
        return np.array(variances) / (centred[:2].var() or np.inf)

    interval = bootstrap(
        (np.arange(n),),
        indices,
        n_resamples=_BOOTSTRAP_RESAMPLES,
        vectorized=False,
        confidence_level=level,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return indices(np.arange(n)), np.stack([interval.low, interval.high], axis=-1)
