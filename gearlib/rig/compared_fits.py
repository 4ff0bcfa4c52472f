"""`compare_fits`: several models fitted to the same data, and which of them the data tell apart."""

import math
from dataclasses import dataclass

from gearlib import checks
from gearlib.rig.fits import DESCRIBED, fit, goes_by_steps

#: Differences of Akaike's criterion: above the first the data reject a model, below the second they
#: do not tell it from the best one (Burnham, Anderson: Model Selection, 2002, sec. 2.6).
REJECTED, ALIKE = 10.0, 2.0


@dataclass(frozen=True)
class Comparison:
    """Fits of several models to the same data, the best one first; `str` is a table."""

    fits: dict  #: name -> `Fit`
    differences: dict  #: name -> aicc over that of the best one
    weights: dict  #: name -> Akaike weight, sum 1
    verdict: str  #: what the data can tell apart

    def __str__(self):
        width = max(len("model"), *map(len, self.fits))
        head = f"{'model':{width}}  free     redchi       aicc        bic  difference  weight"
        rows = [
            f"{name:{width}} {len(one.params):5d} {one.redchi:10.4g} {one.aicc:10.5g} "
            f"{one.bic:10.5g} {self.differences[name]:11.4g} {self.weights[name]:7.3f}"
            for name, one in self.fits.items()
        ]
        return "\n".join(
            ["[[Models]]", f"    {head}", *(f"    {row}" for row in rows), self.verdict]
        )


def compare_fits(models, data, free, **options):
    """Fit several models to the same data and tell which of them the data can tell apart.

    Parameters
    ----------
    models : mapping
        Name -> model: for instance one degree of freedom with a rectangular stiffness, the same
        with a smooth one, six degrees.
    data : xarray.Dataset or list of xarray.Dataset
        As of `gearlib.fit`.
    free : mapping
        As of `gearlib.fit`, for all models; or name of a model -> such a mapping.
    **options
        Of `gearlib.fit`. Where a model has no exact derivatives of run-ups, they are differences.

    Returns
    -------
    Comparison
        The fits, the smallest aicc first, differences of aicc, Akaike weights and a verdict in
        words: a model whose aicc is larger by more than 10 is rejected, one by less than 2 cannot
        be told from the best one. `str` is a table.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    if not hasattr(models, "items") or len(models) < 2:
        raise checks.refusal("models", models, "a mapping of two names or more to models")
    if not hasattr(free, "items") or not free:
        raise checks.refusal("free", free, "a mapping of parameters to (lowest, highest)")
    own = {name: free.get(name, free) for name in models}
    found = {}
    for name, model in models.items():
        more = dict(options)
        if goes_by_steps(model, data):
            more.setdefault("derivatives", "differences")
        found[name] = fit(model, data, own[name], **more)
    counts = {name: one.ndata for name, one in found.items()}
    if len(set(counts.values())) > 1:
        raise ValueError(
            f"models = {counts!r} is not allowed: numbers of data must be the same, as of models "
            "with the same teeth"
        )
    found = dict(sorted(found.items(), key=lambda item: item[1].aicc))
    best = next(iter(found.values()))
    apart = {name: one.aicc - best.aicc for name, one in found.items()}
    sizes = {name: math.exp(-0.5 * one) for name, one in apart.items()}
    whole = sum(sizes.values())
    weights = {name: one / whole for name, one in sizes.items()}
    return Comparison(found, apart, weights, _verdict(found, apart))


def _verdict(found, apart):
    """Return in words what the data tell."""
    best, *others = apart
    rejected = [name for name in others if apart[name] > REJECTED]
    alike = [name for name in others if apart[name] < ALIKE]
    between = [name for name in others if name not in rejected + alike]
    said = [f"Of these models {best} describes the data best"]
    if rejected:
        said.append(f"the data reject {_listed(rejected)}")
    if between:
        said.append(f"they speak against {_listed(between)}, but do not reject it")
    if alike:
        said.append(f"they cannot tell {_listed(alike)} from it")
    words = "; ".join(said) + "."
    one = found[best]
    if one.noise and one.redchi > DESCRIBED:
        words += " None of them describes the data as well as their noise allows."
    return words


def _listed(names):
    return ", ".join(names[:-1]) + f" and {names[-1]}" if len(names) > 1 else names[0]
