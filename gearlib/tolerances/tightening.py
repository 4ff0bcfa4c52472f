"""`tighten`: by how much tolerances must shrink for a quantity to keep its limit.

In first order a quantity is linear in what scatters, so that the share of a tolerance that may stay
is the root of one equation. Designs that are followed correct it, by a few secants, and tell how
many are beyond the limit before and after.
"""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.stats import binomtest

from gearlib import checks, notebook
from gearlib.data.result import result
from gearlib.tolerances.designs import MOST, Designs
from gearlib.tolerances.linear_scatter import Linear
from gearlib.tolerances.nearby import pieces
from gearlib.tolerances.quantities import QUANTITIES, Followed, of_designs

#: Trials of a share, the first of them at most, and how near to the limit the designs then come, as
#: a share of the margin.
_TRIES, _FIRST, _CLOSE = 4, 0.95, 0.05


def tighten(
    model,
    tolerances,
    quantity="contact_margin",
    *,
    limit=0.0,
    keep="above",
    risk=0.01,
    speed=None,
    n=1024,
    seed=0,
    progress=None,
):
    """Say which tolerance must shrink, and by how much, for few designs to be beyond a limit.

    Parameters
    ----------
    model, tolerances, speed, seed, progress
        As of `gearlib.scatter`.
    quantity : str, default "contact_margin"
        Of `gearlib.tolerances.quantities.QUANTITIES`: contact is lost where this one is below 0.
    limit : float, default 0
        In the unit of the quantity.
    keep : {"above", "below"}
        On which side of the limit designs are good.
    risk : float, default 0.01
        Share of the designs that may be beyond it.
    n : int, default 1024
        Samples of each check.

    Returns
    -------
    xarray.Dataset
        Over ``parameter``: effect, tightened_share, the share that may stay if this tolerance
        alone shrinks, NaN where that does not do, and tightened_probability with it; of_all, if
        all shrink alike. probability and probability_interval over ``step``: as given, and with
        all tolerances at of_all; risk, as asked. All these are of designs that are followed, those
        that have no such motion beyond the limit; first_order_share, first_order_of_all and
        first_order_probability are the same in first order, from which they start.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range; or if the nominal design itself is
        beyond the limit.
    """
    n = checks.integer("n", n, 2, MOST)
    risk = checks.number("risk", risk, "a finite number > 0 and < 0.5", lambda p: 0.0 < p < 0.5)
    limit = checks.number("limit", limit, "a finite number", math.isfinite)
    checks.one_of("quantity", quantity, tuple(QUANTITIES))
    sign = 1.0 if checks.one_of("keep", keep, ("above", "below")) == "above" else -1.0
    designs = Designs(model, tolerances, seed)
    follow = Followed(designs.nominal, designs.fields[0], (quantity,), speed=speed)
    form = Linear((quantity,), pieces(follow, designs), designs)
    margin = sign * (follow.nominal[0] - limit)
    if not margin > 0.0:
        raise ValueError(
            f"limit = {limit!r} is not allowed: the nominal design has {follow.nominal[0]:.6g}, "
            "beyond it, and no tolerance changes that"
        )

    def within(shares):
        """Return by how much designs stay within the limit in first order."""
        return sign * (form.of(form.changes * shares)[:, 0] - limit)

    def lost(shares):
        """Return the same of the worst designs of the allowed share."""
        return np.quantile(within(shares), risk)

    k = len(designs.names)
    ways = [lambda s: np.full(k, s), *(lambda s, i=i: _but(k, i, s) for i in range(k))]
    first = np.array([_share(lambda s, way=way: lost(way(s))) for way in ways])
    values, centres = designs.values(designs.points(0, n)), designs.tolerances.centres

    def tried(shares):
        """Return the same of designs that are followed, and how many of them are beyond."""
        found, _, _ = of_designs(follow, designs, centres + shares * (values - centres), newly)
        own = np.where(np.isnan(found[:, 0]), -np.inf, sign * (found[:, 0] - limit))
        return np.quantile(own, risk, method="lower"), int((own < 0.0).sum())

    with notebook.telling("designs", n * (1 + _TRIES * (k + 1)), progress) as newly:
        given = tried(np.ones(k))
        answers = [
            _corrected(one, given, lambda s, way=way: tried(way(s)), margin)
            for one, way in zip(first, ways, strict=True)
        ]
    shares, beyond = (np.array(one, float) for one in zip(*answers, strict=True))
    counts = (given[1], int(beyond[0]))
    intervals = [binomtest(count, n).proportion_ci(0.95, "wilson") for count in counts]
    data = {
        "effect": ("parameter", sign * form.effects[0], {"units": QUANTITIES[quantity][0]}),
        "tightened_share": ("parameter", shares[1:]),
        "tightened_probability": ("parameter", beyond[1:] / n),
        "first_order_share": ("parameter", first[1:]),
        "of_all": shares[0],
        "risk": risk,
        "first_order_of_all": first[0],
        "first_order_probability": float(np.mean(within(1.0) < 0.0)),
        "probability": ("step", np.array(counts) / n),
        "probability_interval": (("step", "bound"), [list(one) for one in intervals]),
    }
    coords = {"parameter": list(designs.names), "step": ["given", "tightened"]}
    coords["bound"] = ["low", "high"]
    said = {"tolerances": tolerances, "quantity": quantity, "limit": limit, "risk": risk}
    said |= {"samples": n, "seed": designs.seed, "keep": keep}
    title = "Tolerances that keep a gear mesh within a limit"
    return result(title, designs.nominal, data, coords, method="first order", **said)


def _but(k, i, share):
    shares = np.ones(k)
    shares[i] = share
    return shares


def _share(lost):
    """Return the largest share, 1 at most, at which nothing is lost; NaN where even 0 loses."""
    if lost(1.0) >= 0.0:
        return 1.0
    return brentq(lost, 0.0, 1.0, xtol=1e-9) if lost(0.0) > 0.0 else np.nan


def _corrected(share, given, tried, margin):
    """Return (share, designs beyond) by secants of designs, from a share in first order on."""
    if given[0] >= 0.0:
        return 1.0, given[1]
    if np.isnan(share):
        return share, np.nan
    last, share = (1.0, given[0]), min(share, _FIRST)
    for left in reversed(range(_TRIES)):
        worst, beyond = tried(share)
        if 0.0 <= worst <= _CLOSE * margin or not left:
            break
        slope = (worst - last[1]) / (share - last[0]) if share != last[0] else 0.0
        last = share, worst
        # Aimed a little inside of the limit; where designs are gone, or nothing changes, halved.
        ahead = share + (0.5 * _CLOSE * margin - worst) / slope if slope < 0.0 else 0.5 * share
        share = min(max(ahead if np.isfinite(ahead) else 0.5 * share, 0.0), 1.0)
    return share, beyond
