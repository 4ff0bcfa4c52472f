"""`first_order_scatter`: how quantities scatter by their derivatives alone, beside samples of them.

With the exact derivatives g at the nominal design a quantity is q + g (p - p0). Its distribution
follows from that of the parameters without another design. What this misses is measured by designs
that are followed: at both ends of each parameter, and at samples.
"""

from functools import cached_property

import numpy as np
import xarray as xr
from scipy import special

from gearlib import checks, notebook
from gearlib.data.result import result
from gearlib.data.status import flags_of
from gearlib.tolerances.by_mesh import worst
from gearlib.tolerances.designs import MOST, Designs
from gearlib.tolerances.nearby import pieces
from gearlib.tolerances.quantities import QUANTITIES, Followed, names_of, of_designs

QUANTILES = (0.05, 0.5, 0.95)
#: Points of the linear form, whose quantiles are told.
_POINTS = 2**15
#: Both ends of a parameter that are tried, in normal scores.
_ENDS = (-2.0, 2.0)
#: How far the deviation in first order may be off, and what it may miss: shares of the deviation.
_OFF, _MISSED = 0.05, 0.3
#: A deviation below this share of the value is rounding.
_ROUNDING = 1e-12
VERDICTS = ("holds", "bends", "across_a_grazing", "next_to_a_cusp", "none")
HOLDS, BENDS, GRAZING, CUSP, NONE = range(len(VERDICTS))
_SENTENCES = (
    "first order holds, {told}",
    "first order does not hold, {told}: the quantity bends within the tolerances",
    "first order does not hold, {told}: within the tolerances the orbit comes to touch a flank "
    "line, and its contacts change",
    "first order does not hold: next to a cusp, {gone} of {count} designs have no such point",
    "the nominal design has no such point",
)
_TOLD = "its deviation is {ratio:.3f} times that of the designs, of which it misses {missed:.1%}"


def first_order_scatter(
    model,
    tolerances,
    quantities=("jump_up", "jump_down"),
    n=256,
    *,
    speed=None,
    seed=0,
    progress=None,
):
    """Return how quantities scatter in first order, beside samples, and whether that holds.

    Parameters
    ----------
    model, tolerances, quantities, speed, seed, progress
        As of `gearlib.scatter`.
    n : int, default 256
        Samples beside it.

    Returns
    -------
    xarray.Dataset
        For each quantity <q>_nominal, <q>_mean, <q>_deviation, <q>_quantile over ``quantile``, all
        in first order, the same of the samples with the prefix ``sampled_``, and <q>_effect over
        ``parameter``, what a standard deviation of it comes to. Over ``quantity``: deviation_ratio,
        nonlinearity, missing_designs, and first_order_verdict; the attribute ``said`` is a sentence
        for each.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    n = checks.integer("n", n, 2, MOST)
    designs = Designs(model, tolerances, seed)
    quantities = names_of("quantities", quantities, tuple(QUANTITIES))
    follow = Followed(designs.nominal, designs.fields[0], quantities, speed=speed)
    form, k = Linear(quantities, pieces(follow, designs), designs), len(designs.names)
    samples = designs.values(designs.points(0, n))
    ends = np.full((2 * k, k), 0.5)
    for i in range(2 * k):
        ends[i, i // 2] = special.ndtr(_ENDS[i % 2])
    # One parameter off its centre, the others at theirs.
    ends = np.where(ends == 0.5, designs.tolerances.centres, designs.tolerances.values(ends))
    values = np.concatenate([samples, ends])
    with notebook.telling("designs", len(values), progress) as newly:
        found, _, refusals = of_designs(follow, designs, values, newly)
    built = np.array([not text for text in refusals])
    contacts = np.array([
        follow.contacts(designs.model(one)) if there else follow.contacts(designs.nominal)
        for one, there in zip(ends, built[n:], strict=True)
    ])  # fmt: skip
    data, table = {}, []
    for i, name in enumerate(quantities):
        units, words = QUANTITIES[name]
        own, linear = found[:n, i], form.values(values)[:, i]
        own = own[np.isfinite(own)]
        spread = own.std() if own.size > 1 else np.nan
        there = np.isfinite(found[:, i])
        # Of the designs' deviation only what first order misses is left to chance.
        rest, line = (found[:, i] - linear)[there], linear[there]
        sampled = np.flatnonzero(there) < n
        between = np.cov(rest[sampled], line[sampled])
        variance = form.deviations[i] ** 2
        whole = np.sqrt(variance + between[0, 0] + 2.0 * between[0, 1])
        ratio, missed = 1.0, 0.0
        # What no parameter moves scatters by rounding alone.
        if not whole <= _ROUNDING * abs(follow.nominal[i]):
            ratio = float(form.deviations[i] / whole)
            missed = float(np.sqrt(np.mean(rest**2)) / whole)
        gone = int((built & ~there).sum())
        code = _verdict(ratio, missed, gone, contacts[:, i], follow, i)
        table.append((ratio, missed, n - own.size, code, gone))
        drawn = form.drawn[:, i]
        told = {
            "nominal": ((), follow.nominal[i], "of the nominal design"),
            "mean": ((), drawn.mean(), "mean in first order"),
            "deviation": ((), form.deviations[i], "standard deviation in first order"),
            "quantile": ("quantile", np.quantile(drawn, QUANTILES), "quantiles in first order"),
            "effect": ("parameter", form.effects[i], "change by a standard deviation"),
            "sampled_mean": ((), own.mean() if own.size else np.nan, "mean of the samples"),
            "sampled_deviation": ((), spread, "standard deviation of the samples"),
            "sampled_quantile": (
                "quantile",
                np.quantile(own, QUANTILES) if own.size else np.full(3, np.nan),
                "quantiles of the samples",
            ),
        }
        for end, (dims, values_, said) in told.items():
            attributes = {"units": units, "long_name": f"{said}: {words}"}
            data[f"{name}_{end}"] = xr.Variable(dims, values_, attributes)
    ratios, missed, missing, codes, _ = zip(*table, strict=True)
    over = "quantity"
    data |= {
        "deviation_ratio": (over, list(ratios)),
        "nonlinearity": (over, list(missed)),
        "missing_designs": (over, np.array(missing, np.int32)),
        "first_order_verdict": (over, np.array(codes, np.int8), flags_of(VERDICTS)),
    }
    coords = {"quantity": list(quantities), "parameter": list(designs.names)}
    coords["quantile"] = list(QUANTILES)
    said = {"tolerances": tolerances, "samples": n, "seed": designs.seed}
    title = "Scatter of a gear mesh in first order"
    dataset = result(title, designs.nominal, data, coords, method="first order", **said)
    texts = []
    for name, (ratio, missed, _, code, gone) in zip(quantities, table, strict=True):
        told = _TOLD.format(ratio=ratio, missed=missed)
        words = _SENTENCES[code].format(told=told, gone=gone, count=int(built.sum()))
        texts.append(f"{name}: {words}")
    return dataset.assign_attrs(said="; ".join(texts))


class Linear:
    """Quantities as linear forms of what scatters; of several meshes that of the worst.

    `forms` are those of `quantities.pieces`.
    """

    def __init__(self, quantities, forms, designs):
        self.quantities, self.forms = quantities, forms
        self.designs, self.centres = designs, designs.tolerances.centres
        covariance = designs.tolerances.covariance
        k = len(self.centres)
        self.nominal = self.of(np.zeros((1, k)))[0]
        self.deviations = np.array([
            np.sqrt(own[0] @ covariance @ own[0]) if len(own) == 1 else self.drawn[:, i].std()
            for i, (_, own) in enumerate(forms)
        ])  # fmt: skip
        steps = np.diag(np.sqrt(np.diag(covariance)))
        ahead, behind = (self.of(sign * steps).T - self.nominal[:, None] for sign in (1.0, -1.0))
        # Where another mesh becomes the worst both sides differ: the larger one is told.
        self.effects = np.where(np.abs(ahead) >= np.abs(behind), ahead, -behind)
        for i, (_, slopes) in enumerate(forms):
            if len(slopes) == 1:
                self.effects[i] = slopes[0] @ steps

    @cached_property
    def changes(self):
        """Points of what scatters, about the nominal design, shape (p, k)."""
        return self.designs.values(self.designs.points(0, _POINTS)) - self.centres

    @cached_property
    def drawn(self):
        """The quantities at these points, shape (p, q)."""
        return self.of(self.changes)

    def of(self, changes):
        """Return the quantities at changes of what scatters, (n, k), shape (n, q)."""
        found = []
        for name, (values, slopes) in zip(self.quantities, self.forms, strict=True):
            every = values + changes @ slopes.T
            found.append(every[np.arange(len(every)), worst(name, every)])
        return np.transpose(found)

    def values(self, values):
        """Return the quantities at values of what scatters, shape (n, q)."""
        return self.of(values - self.centres)


def _verdict(ratio, missed, gone, contacts, follow, i):
    if not np.isfinite(follow.nominal[i]):
        return NONE
    if gone:
        return CUSP
    if abs(ratio - 1.0) <= _OFF and missed <= _MISSED:
        return HOLDS
    return GRAZING if (contacts != follow.contacts(follow.model)[i]).any() else BENDS
