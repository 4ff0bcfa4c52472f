"""Where polynomial chaos fails: its errors over the number of runs, at a jump and away from it.

A polynomial in normal scores, fitted to runs by regression, stands for the motion at a speed (Xiu,
Karniadakis: SIAM J. Sci. Comput. 24 (2002) 619-644). Beside it the runs themselves, as many as the
fit takes, and all against a great many exact runs. Needs chaospy, ``pip install
'gearlib[chaos]'``.
"""

import numpy as np
from scipy import special, stats

from gearlib.data.result import result
from gearlib.tolerances import bands
from gearlib.tolerances.designs import Designs

#: Runs for each term of a polynomial.
_RUNS = 2
WAYS = ("polynomial_chaos", "samples")
#: Of the distributions that are told.
_QUANTILES = np.linspace(0.005, 0.995, 199)


def expansion_errors(
    model, tolerances, speeds, orders=(1, 2, 3, 4), n=4096, *, direction="up", periods=200, seed=0
):
    """Return errors of polynomial chaos and of samples over the number of runs.

    Parameters
    ----------
    model, tolerances, seed
        As of `gearlib.scatter`.
    speeds : array_like of float
        In rpm; each is run up (or down) to from the others.
    orders : sequence of int
        Of the polynomials.
    n : int
        Exact runs, the reference.
    direction : {"up", "down", "cold"}
    periods : int

    Returns
    -------
    xarray.Dataset
        Over ``estimate``, ``polynomial_order`` and ``speed``: mean_error and deviation_error of the
        peak-to-peak displacement, over their exact values, and distribution_error, the largest
        difference of the shares of designs below a value; with ``quantile`` too height_quantile,
        of the peak-to-peak displacement, m. Over ``speed`` and ``quantile``: exact_height_quantile;
        over ``polynomial_order``: designs_run. Over ``speed``: loss_probability, the share of
        designs that lose contact.

    Raises
    ------
    ImportError
        Without chaospy.
    """
    try:
        import chaospy
    except ImportError:
        raise ImportError(
            "polynomial chaos needs chaospy, which is not installed: pip install 'gearlib[chaos]'"
        ) from None
    designs = Designs(model, tolerances, seed)
    speeds, k = np.sort(np.asarray(speeds, float)), len(designs.names)
    asked = bands.Asked(speeds, (direction,), periods, 1, ((0.0, 1.0), (0.0, 1.0)))

    def heights(points):
        """Return the peak-to-peak displacements, (n, m), of points of the cube, and losses."""
        full = np.hstack([points, np.full((len(points), 2), 0.5)])
        found, _ = bands.run(designs, full, designs.values(full), asked, 1)
        return found.height[:, 0].astype(float), found.lost[:, 0]

    points = designs.points(0, n)[:, :k]
    exact, lost = heights(points)
    joint = chaospy.Iid(chaospy.Normal(0.0, 1.0), k)
    scores, shape = special.ndtri(points).T, (len(WAYS), len(orders), speeds.size)
    errors = {name: np.empty(shape) for name in ("mean", "deviation", "distribution")}
    told = np.empty((*shape, _QUANTILES.size))
    runs = []
    for i, order in enumerate(orders):
        terms = chaospy.generate_expansion(order, joint)
        runs.append(min(_RUNS * len(terms), n))
        # Points beyond those of the reference, of the same sequence.
        nodes = designs.points(n, n + runs[-1])[:, :k]
        values, _ = heights(nodes)
        fitted = chaospy.fit_regression(terms, special.ndtri(nodes).T, values)
        stand_in = np.asarray(fitted(*scores)).reshape(speeds.size, n)
        for j in range(speeds.size):
            for way, own in enumerate((stand_in[j], values[:, j])):
                mean, spread = exact[:, j].mean(), exact[:, j].std()
                errors["mean"][way, i, j] = abs(own.mean() - mean) / mean
                errors["deviation"][way, i, j] = abs(own.std() - spread) / spread
                distance = stats.ks_2samp(own, exact[:, j], method="asymp").statistic
                errors["distribution"][way, i, j] = distance
                told[way, i, j] = np.quantile(own, _QUANTILES)
    over = ("estimate", "polynomial_order", "speed")
    data: dict = {f"{name}_error": (over, values) for name, values in errors.items()}
    data |= {
        "height_quantile": ((*over, "quantile"), told),
        "exact_height_quantile": (
            ("speed", "quantile"),
            np.quantile(exact, _QUANTILES, axis=0).T,
        ),
        "designs_run": ("polynomial_order", np.array(runs, np.int32)),
        "loss_probability": ("speed", lost.mean(axis=0)),
    }
    coords = {"estimate": list(WAYS), "polynomial_order": list(orders), "speed": speeds}
    coords["quantile"] = _QUANTILES
    said = {"tolerances": tolerances, "samples": n, "seed": designs.seed, "periods": periods}
    title = "Errors of polynomial chaos at a jump and away from it"
    return result(title, designs.nominal, data, coords, method=f"chaospy, {direction}", **said)
