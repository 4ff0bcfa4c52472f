"""`sobol_indices`: which tolerance moves a quantity most, by shares of its variance.

The first index of a parameter is the share of the variance that would be gone if it alone had no
tolerance, on average; the total index what would be left if it alone had one (Saltelli et al.:
Comput. Phys. Comm. 181 (2010) 259-270). Intervals are bootstrapped, so they cover the samples'
chance and nothing else.
"""

import numpy as np
from scipy import stats
from scipy.stats import qmc

from gearlib import checks, notebook
from gearlib.data.result import result
from gearlib.tolerances.designs import Designs
from gearlib.tolerances.quantities import QUANTITIES, DesignQuantities, names_of, of_designs

#: Between the two draws of which the interval is reported.
_RESAMPLES = 200
_BOUNDS = ("low", "high")


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
    duty = designs.at_duty(designs.tolerances.centres)
    search = DesignQuantities(designs.nominal, quantities, speed=speed, at_duty=duty)
    k = len(designs.names)
    both = qmc.Sobol(2 * k, rng=designs.seed).random(n)
    a, b = both[:, :k], both[:, k:]
    points = np.stack([a, b, *(np.where(np.arange(k) == i, b, a) for i in range(k))])
    values = designs.tolerances.values(points.reshape(-1, k))
    with notebook.telling("designs", len(values), progress) as newly:
        found, _, _ = of_designs(search, designs, values, newly)
    found = np.moveaxis(found.reshape(k + 2, n, len(quantities)), 2, 0)
    tables = [
        _indices(one, level, designs.seed, name)
        for one, name in zip(found, quantities, strict=True)
    ]
    over, data = ("quantity", "parameter"), {}
    for i, name in enumerate(("first_index", "total_index")):
        data[name] = over, [one[0][i] for one in tables]
        data[f"{name}_interval"] = (*over, "bound"), [one[1][i] for one in tables]
    data["missing_designs"] = "quantity", np.isnan(found).sum(axis=(1, 2)).astype(np.int32)
    coords = {
        "quantity": list(quantities),
        "parameter": list(designs.names),
        "bound": list(_BOUNDS),
    }
    said = {"tolerances": tolerances, "samples": n, "seed": designs.seed, "confidence": level}
    title = "Sobol' indices of a gear mesh by its tolerances"
    return result(title, designs.nominal, data, coords, method="Saltelli 2010", **said)


def _indices(table, level, seed, name):
    """Return (indices (2, k), their intervals (2, k, 2)) of values, shape (k + 2, n)."""
    there = np.isfinite(table).all(axis=0)
    if there.sum() < 2:
        raise ValueError(
            f"quantities = {name!r} is not allowed with these tolerances: of {there.size} samples "
            f"{there.sum()} have it in all designs that are compared"
        )
    # As many as before, as the balance of the points asks for: each that is missing gives its place
    # to one that is there.
    rows = np.arange(there.size)
    own = np.flatnonzero(there)
    rows[~there] = own[np.arange((~there).sum()) * own.size // max((~there).sum(), 1) % own.size]
    table = table[:, rows]

    def of(rows):
        # Twice, since of one parameter and one quantity scipy makes no arrays.
        parts = (
            table[[0, 0]][:, rows],
            table[[1, 1]][:, rows],
            table[2:, None][:, [0, 0]][..., rows],
        )
        found = stats.sobol_indices(
            func=dict(zip(("f_A", "f_B", "f_AB"), parts, strict=True)), n=rows.size
        )
        return np.array([found.first_order, found.total_order]).reshape(2, 2, -1)[:, 0]

    every = np.arange(there.size)
    interval = stats.bootstrap(
        (every,),
        of,
        n_resamples=_RESAMPLES,
        vectorized=False,
        confidence_level=level,
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return of(every), np.stack([interval.low, interval.high], axis=-1)
