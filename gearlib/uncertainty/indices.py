"""`sobol_indices`: which tolerance moves a quantity most, by shares of its variance.

The first index of a parameter is the share of the variance that would be gone if it alone had no
tolerance, on average; the total index what would be left if it alone had one (Saltelli et al.:
Comput. Phys. Comm. 181 (2010) 259-270). Intervals are bootstrapped, so they cover the samples'
chance and nothing else.
"""

from typing import Any

import numpy as np
from scipy.stats import bootstrap, qmc

from gearlib import checks, notebook
from gearlib.data.result import result
from gearlib.uncertainty.design_quantities import QUANTITIES, names_of, search_of
from gearlib.uncertainty.designs import Designs

#: Samples of the bootstrap.
_RESAMPLES = 200


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
    """Return Sobol' indices of quantities by what scatters, with bootstrapped intervals.

    Parameters
    ----------
    model, tolerances, quantities, seed, progress
        As of `gearlib.scatter`, without correlations.
    n : int, default 1024
        A power of 2; of k parameters n (k + 2) designs are computed.
    speed : float, optional
        Of the duty point, rpm.
    confidence : float, default 0.95
        Of the intervals.

    Returns
    -------
    xarray.Dataset
        Over ``quantity`` and ``parameter``: first_index, total_index, and with ``bound`` their
        intervals first_index_interval, total_index_interval; over ``quantity``:
        missing_designs, those without the quantity or that cannot be built, which are
        replaced by others: what is told then holds of the designs that have it.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    n = checks.integer("n", n, 2, 2**24)
    checks.require(n & (n - 1) == 0, "n", n, "a power of 2")
    level = checks.number(
        "confidence", confidence, "a finite number > 0 and < 1", lambda p: 0.0 < p < 1.0
    )
    designs = Designs(model, tolerances, seed)
    if designs.tolerances.correlations:
        raise ValueError(
            "tolerances.correlations is not allowed: shares of the variance are those of "
            "independent parameters"
        )
    quantities = names_of("quantities", quantities, tuple(QUANTITIES))
    search = search_of(designs, quantities, speed)
    tables = _values(designs, search, n, progress)
    indices = [
        _indices(table, level, designs.seed, name)
        for table, name in zip(tables, quantities, strict=True)
    ]
    over, data = ("quantity", "parameter"), {}
    for i, name in enumerate(("first_index", "total_index")):
        data[name] = over, [values[i] for values, _ in indices]
        data[f"{name}_interval"] = (*over, "bound"), [interval[i] for _, interval in indices]
    data["missing_designs"] = "quantity", np.isnan(tables).sum(axis=(1, 2)).astype(np.int32)
    coords = {
        "quantity": list(quantities),
        "parameter": list(designs.names),
        "bound": ["low", "high"],
    }
    attributes = {"tolerances": tolerances, "samples": n, "seed": designs.seed, "confidence": level}
    title = "Sobol' indices of a gear mesh by its tolerances"
    return result(title, designs.nominal, data, coords, method="Saltelli 2010", **attributes)


def _values(designs: Designs, search: Any, n: int, progress: Any) -> np.ndarray:
    """Return the quantities of the designs that are compared, shape (q, k + 2, n)."""
    k = len(designs.names)
    both = qmc.Sobol(2 * k, rng=designs.seed).random(n)
    a, b = both[:, :k], both[:, k:]
    points = np.stack([a, b, *(np.where(np.arange(k) == i, b, a) for i in range(k))])
    rows = designs.tolerances.values(points.reshape(-1, k))
    values = np.full((len(rows), len(search.quantities)), np.nan)
    with notebook.telling("designs", len(rows), progress) as newly:
        for i, row in enumerate(rows):
            try:
                design = designs.model(row)
            except ValueError:
                design = None
            if design is not None:
                values[i] = search(design, designs.at_duty(row))[0]
            newly(1)
    return np.moveaxis(values.reshape(k + 2, n, -1), 2, 0)


def _indices(table: np.ndarray, level: float, seed: int, name: str) -> tuple:
    """Return indices, (2, k), and their intervals, (2, k, 2), of values, shape (k + 2, n)."""
    n, complete = table.shape[1], np.flatnonzero(np.isfinite(table).all(axis=0))
    count = complete.size
    if count < 2:
        raise ValueError(
            f"quantities = {name!r} is not allowed with these tolerances: of {n} samples {count} "
            "have it in all designs that are compared"
        )
    # As many as before, as the balance of the points asks for: each that is missing gives its place
    # to one that is there.
    samples, missing = np.arange(n), np.isnan(table).any(axis=0)
    samples[missing] = complete[np.arange(n - count) * count // max(n - count, 1) % count]
    table = table[:, samples]

    def indices(rows):
        shifted = table[:, rows] - table[:2, rows].mean()
        a, b, ab = shifted[0], shifted[1], shifted[2:]
        shares = (b * (ab - a)).mean(axis=1), 0.5 * ((ab - a) ** 2).mean(axis=1)
        return np.array(shares) / (shifted[:2].var() or np.inf)

    interval = bootstrap(
        (np.arange(n),),
        indices,
        n_resamples=_RESAMPLES,
        vectorized=False,
        confidence_level=level,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return indices(np.arange(n)), np.stack([interval.low, interval.high], axis=-1)
