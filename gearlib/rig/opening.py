"""Better starts of a fit: what the opening of a run-up tells, and the rest spread over its range.

Up to its first jump a motion follows its parameters smoothly, and any start leads to those that
count there. What they are is then known well, and only the others have to be tried: backlash
above all, which begins to count where the far flank is struck.
"""

import numpy as np
from scipy.optimize import OptimizeResult
from scipy.stats import qmc

#: Two standard errors, in shares of the range, beyond which the opening does not tell a parameter.
_LOOSE = 0.02
#: Starts on the opening that are improved, values of the others for each start that was asked for.
_IMPROVED, _VALUES = 3, 4
#: Reduced chi-square up to which the opening is described.
_GOOD = 2.0


def starts(problem, tried, seed, improved):
    """Return more starts, each the shares of the ranges; none where there is no opening.

    tried: starts that were drawn; improved: call of a problem and a start -> `OptimizeResult`.
    """
    parts = [one.opening() for one in problem.observations if hasattr(one, "opening")]
    parts = [one for one in parts if one is not None]
    if not parts:
        return []
    part = problem._replace(observations=parts)
    best = _best(part, tried, improved)
    if best is None:
        return []
    loose = _loose(best)
    if not loose.any():
        return [best.x]
    count = _VALUES * len(tried)
    found = np.tile(best.x, (count, 1))
    found[:, loose] = qmc.LatinHypercube(int(loose.sum()), rng=seed).random(count)
    return list(found)


def _best(part, tried, improved) -> OptimizeResult | None:
    """Return the best fit to the opening, None where it hardly tells anything."""
    costs = []
    for share in tried:
        rest = part.residuals(share, exact=False)
        costs.append(np.inf if rest is None else float(rest[0] @ rest[0]))
    best = None
    for i in np.argsort(costs)[:_IMPROVED]:
        if not np.isfinite(costs[i]):
            break
        one = improved(part, tried[i])
        if best is None or one.cost < best.cost:
            best = one
        if part.noise and 2.0 * best.cost < _GOOD * best.fun.size:
            break
    return best


def _loose(best):
    """Return which parameters the opening does not tell."""
    moved = np.atleast_2d(best.jac)
    values, ways = np.linalg.svd(moved, full_matrices=False)[1:]
    scale = max(2.0 * best.cost / best.fun.size, 1.0)
    # A direction that is not felt at all is as wide as its range.
    width = np.sqrt(scale) / np.maximum(values, 1e-9)
    return 2.0 * np.sqrt(((ways.T * width) ** 2).sum(axis=1)) > _LOOSE
