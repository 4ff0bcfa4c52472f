"""`sobol_indices`: fractions of the variance of a quantity that each tolerance causes.

The first-order index of a parameter is the fraction of the variance that vanishes on average if
this parameter is fixed; the total index is the fraction that remains on average if all others are
fixed (Saltelli et al.: Comput. Phys. Comm. 181 (2010) 259-270).
"""

from typing import Any

import numpy as np
from scipy.stats import bootstrap, qmc

from gearlib import checks, notebook
from gearlib.data.result import result
from gearlib.uncertainty.design_quantities import QUANTITIES, checked_names, quantity_evaluator
from gearlib.uncertainty.designs import Designs

_BOOTSTRAP_RESAMPLES = 200


def sobol_indices(
    model,
    tolerances,
    quantities=("jump_up", "jump_down"),
    n=1024,
    *,
    speed=None,
    confidence=0.95,
    seed=0,
    progress=None,
):
    """Return Sobol' indices of quantities by tolerances, with bootstrapped sampling errors.

    Parameters
    ----------
    model, tolerances, quantities, seed, progress
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
    n = checks.integer("n", n, 2, 2**24)
    checks.require(n & (n - 1) == 0, "n", n, "a power of 2")
    allowed = "a finite number > 0 and < 1"
    level = checks.number("confidence", confidence, allowed, lambda p: 0.0 < p < 1.0)
    checks.require(progress is None or callable(progress), "progress", progress, "a function")
    designs = Designs(model, tolerances, seed)
    if designs.tolerances.correlations:
        raise ValueError(
            "tolerances.correlations is not allowed: Sobol' indices need independent parameters"
        )
    quantities = checked_names("quantities", quantities, tuple(QUANTITIES))
    checks.require(quantities, "quantities", quantities, "at least one")
    evaluator = quantity_evaluator(designs, quantities, speed)
    tables = _design_tables(designs, evaluator, n, progress)
    indices = [
        _indices_with_intervals(table, level, designs.seed, name)
        for table, name in zip(tables, quantities, strict=True)
    ]
    dims, data = ("quantity", "parameter"), {}
    for i, name in enumerate(("first_index", "total_index")):
        data[name] = dims, [values[i] for values, _ in indices]
        data[f"{name}_interval"] = (*dims, "bound"), [intervals[i] for _, intervals in indices]
    data["missing_designs"] = "quantity", np.isnan(tables).sum(axis=(1, 2)).astype(np.int32)
    coords = {"quantity": [*quantities], "parameter": [*designs.names], "bound": ["low", "high"]}
    attributes = {"tolerances": tolerances, "samples": n, "seed": designs.seed, "confidence": level}
    title = "Sobol' indices of a gear mesh by its tolerances"
    return result(title, designs.nominal, data, coords, method="Saltelli 2010", **attributes)


def _design_tables(designs: Designs, evaluator: Any, n: int, progress: Any) -> np.ndarray:
    """Return the values of each quantity for the designs of Saltelli's method, (q, k + 2, n).

    The k + 2 rows belong to two independent samples A and B of the k parameters, and to k copies of
    A with one parameter of B each. Values are NaN for designs that do not have the quantity.
    """
    k = len(designs.names)
    cube = qmc.Sobol(2 * k, rng=designs.seed).random(n)
    a, b = cube[:, :k], cube[:, k:]
    points = np.stack([a, b, *(np.where(np.arange(k) == i, b, a) for i in range(k))])
    parameters = designs.tolerances.values(points.reshape(-1, k))
    values = np.full((len(parameters), len(evaluator.quantities)), np.nan)
    with notebook.counting_bar("designs", len(parameters), progress) as report:
        for i, row in enumerate(parameters):
            try:
                design = designs.model(row)
            except ValueError:
                pass
            else:
                values[i], _ = evaluator.evaluate(design, designs.duty_model_builder(row))
            report(1)
    return np.moveaxis(values.reshape(k + 2, n, -1), 2, 0)


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
