"""Tell which parameters the data of a fit determine, and say in words why others are not known."""

import numpy as np
from scipy.stats import binom

from gearlib.analysis.sensitivities import richardson
from gearlib.rig.fitted_curves import left_over

#: Widths of the differences at the optimum are shares of this share of the range of a parameter;
#: each costs two runs, and those below the second number are left out.
_SCALE, _LEAST_WIDTH = 0.1, 1e-5
#: A derivative below this share of the largest, over the ranges of the parameters, is none.
_NOTHING = 1e-9
#: Share of its range by which a parameter moves along a direction that the data do not determine,
#: from which on the parameter is not known either.
_TAKES_PART = 0.01
#: Share of the variance of data that is left where a model tells hardly anything of them.
_LEFT = 0.5
#: Probability of a false alarm about residuals that are independent of each other, and the least
#: residual that has a sign, over what counts as a deviation where the noise is not known.
_FALSE_ALARMS, _LEAST_RESIDUAL = 1e-3, 1e-6


def moved(share, i, value):
    """Return shares of which one has another value."""
    changed = share.copy()
    changed[i] = value
    return changed


def precise_jacobian(problem, best):
    """Return (derivatives at the optimum, their errors), shapes (residuals, parameters)."""
    jacobian, errors = np.array(best.jac), np.zeros((problem.size, best.x.size))

    def residuals(i, value):
        if value == best.x[i]:
            return best.fun
        if abs(value - best.x[i]) < _LEAST_WIDTH:
            return None
        return problem.residuals(moved(best.x, i, value))

    for i, share in enumerate(best.x):
        derivative, error = richardson(lambda value, i=i: residuals(i, value), share, _SCALE)
        if np.isfinite(derivative).all():
            jacobian[:, i], errors[:, i] = derivative, error
    return jacobian, errors


def unknown_directions(jacobian, errors):
    """Return directions of parameters, rows, along which residuals change by rounding at most."""
    _, sizes, directions = np.linalg.svd(jacobian, full_matrices=False)
    noise = np.linalg.norm(errors @ np.abs(directions.T), axis=0)
    return directions[sizes <= np.maximum(noise, _NOTHING * max(sizes.max(), 1.0))]


def identifiable(directions):
    """Return which parameters stay nearly where they are along all unknown directions."""
    return (np.abs(directions) < _TAKES_PART).all(axis=0)


def reason(problem, model, i, directions, endless):
    """Return why the data do not determine the parameter with the number i, a sentence."""
    name = problem.names[i]
    if name == "backlash":
        return _about_backlash(problem, model, i, endless)
    rows = np.abs(directions[np.abs(directions[:, i]) >= _TAKES_PART])
    together = (rows >= _TAKES_PART).any(axis=0)
    others = [other for j, other in enumerate(problem.names) if together[j] and j != i]
    if others:
        return (
            f"{name} is not identifiable: the data tell only a combination of it and "
            f"{' and '.join(others)}"
        )
    return f"{name} is not identifiable: nothing in the data hangs on it"


def _about_backlash(problem, model, i, endless):
    """Return how large the backlash is at least."""
    value, model = model.value("backlash"), model.with_values({"backlash": problem.high[i]})
    deepest = max((one.deepest(model) for one in problem.observations), default=0.0)
    # Where a little less describes the data as well, no more than that is known.
    bound = min(deepest, value) if endless else deepest
    how = "the far flank is never struck" if deepest > 0.0 else "contact is never lost"
    more = f"it is at least {bound:.4g} m, the largest way into the backlash there, and "
    known = bound > problem.low[i]
    more = f"{more}nothing tells how much more" if known else "nothing tells how large it is"
    return f"backlash is not identifiable: {how} in what is compared; {more}"


def unexplained(problem, model):
    """Return sentences on data of unknown noise that a model leaves mostly as they are."""
    sentences = []
    for observation in problem.observations:
        share = 0.0 if observation.kind == "speeds" else left_over(observation.curves(model))
        if share > _LEFT:
            sentences.append(
                f"the model does not describe the data: it leaves {100.0 * share:.0f} % of what "
                f"varies in the {observation.kind}, whose noise is not known, and no interval holds"
            )
    return sentences


def correlated(problem, residuals):
    """Return sentences on residuals of unknown noise that do not change their sign often enough.

    Signs of independent residuals change with a probability of one half from each to the next,
    whatever their deviations are (Geary, Biometrika 57 (1970) 123-127).
    """
    ends = np.cumsum([one.size for one in problem.observations])[:-1]
    sequences: dict = {}
    for observation, part in zip(problem.observations, np.split(residuals, ends), strict=True):
        for name, rows in observation.sequences(part).items():
            sequences.setdefault(name, []).append(rows)
    sentences = []
    for name, parts in sequences.items():
        signs = [row[np.abs(row) > _LEAST_RESIDUAL] > 0.0 for row in np.concatenate(parts, axis=1)]
        changes = sum(int((one[1:] != one[:-1]).sum()) for one in signs)
        steps = sum(max(one.size - 1, 0) for one in signs)
        if binom.cdf(changes, steps, 0.5) < _FALSE_ALARMS / len(sequences):
            sentences.append(
                f"what the model leaves of the {name.replace('_', ' ')} is not independent noise: "
                f"it changes its sign {changes} times in {steps} steps, where {steps / 2:g} times "
                "are expected, and no interval holds"
            )
    return sentences
