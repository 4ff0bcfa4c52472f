"""`tighten`: by how much tolerances must shrink for a quantity to keep its limit.

In first order a quantity is linear in what scatters, so that the share of a tolerance that may stay
is the root of one equation. Whether the answer is right is asked of designs that are
followed, before and after.
"""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.stats import binomtest

from gearlib import checks, notebook
from gearlib.data.result import result
from gearlib.tolerances.designs import MOST, Designs
from gearlib.tolerances.linear_scatter import Linear
from gearlib.tolerances.quantities import QUANTITIES, Followed, gradient, of_designs


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
        Over ``parameter``: effect, tightened_share, NaN where this tolerance alone does not do;
        of_all, if all shrink alike. first_order_probability, and, of designs that are followed,
        probability and probability_interval over ``step``: as given, and with all tolerances at
        of_all; over ``parameter`` tightened_probability, with each at its share. Designs that have
        no such motion count as beyond the limit.

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
    form = Linear(follow.nominal, gradient(follow, designs), designs)
    margin = sign * (follow.nominal[0] - limit)
    if not margin > 0.0:
        raise ValueError(
            f"limit = {limit!r} is not allowed: the nominal design has {follow.nominal[0]:.6g}, "
            "beyond it, and no tolerance changes that"
        )
    parts = sign * form.changes * form.slopes[0]

    def lost(shares):
        """Return by how much the worst designs of the allowed share stay within the limit."""
        return np.quantile(margin + parts @ shares, risk)

    k = len(designs.names)
    shares = np.array([_share(lambda s, i=i: lost(_but(k, i, s))) for i in range(k)])
    of_all = _share(lambda s: lost(np.full(k, s)))
    # As given, all together, each that does.
    tried = [np.ones(k), np.full(k, of_all)]
    tried += [_but(k, i, shares[i]) for i in range(k) if np.isfinite(shares[i])]
    values = designs.values(designs.points(0, n))
    centres = designs.tolerances.centres
    values = np.concatenate([centres + one * (values - centres) for one in tried])
    done, tell = [0], progress or (lambda count: None)

    def newly(count):
        done[0] += count
        tell(count)

    with notebook.bar("designs", len(values), lambda: done[0]):
        found, _, _ = of_designs(follow, designs, values, newly)
    beyond = (~(sign * (found[:, 0].reshape(-1, n) - limit) >= 0.0)).sum(axis=1)
    intervals = [binomtest(int(count), n).proportion_ci(0.95, "wilson") for count in beyond]
    alone = np.full(k, np.nan)
    alone[np.isfinite(shares)] = beyond[2:] / n
    data = {
        "effect": ("parameter", sign * form.effects[0], {"units": QUANTITIES[quantity][0]}),
        "tightened_share": ("parameter", shares),
        "tightened_probability": ("parameter", alone),
        "of_all": of_all,
        "first_order_probability": float(np.mean(margin + parts.sum(axis=1) < 0.0)),
        "probability": ("step", beyond[:2] / n),
        "probability_interval": (("step", "bound"), [list(one) for one in intervals[:2]]),
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
