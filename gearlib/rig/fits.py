"""`fit`: parameters of a model from measured sets, by least squares with exact derivatives.

Motions are followed, not pixels: run-ups are compared block by block where they are near one orbit,
jumps by the speed at which they happen. Sensor gain, offset and slow waves are eliminated. What the
data cannot tell is said in words and never given a number with an interval.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2, qmc
from scipy.stats import t as student

from gearlib import checks
from gearlib.models.model import is_model
from gearlib.models.propagators.courses import propagator_of
from gearlib.rig import opening
from gearlib.rig.branch_observations import BranchStatistics
from gearlib.rig.fit_report import Fit, Parameter
from gearlib.rig.fitted_curves import left_over
from gearlib.rig.observations import observations_of
from gearlib.rig.speed_observations import Speeds

#: A derivative below this share of the largest, over the ranges of the parameters, is none.
_NOTHING = 1e-9
#: Residuals over their deviations beyond which a start is hopeless.
_HOPELESS = 1e30
#: Starts that are improved, of those that are tried: until one describes the data as well as their
#: noise allows; where it is unknown, the first few.
_MOST, _FEW = 8, 3
#: -2 ln of the ratio of likelihoods at the ends of an interval of 95 %.
_LEVEL = float(chi2.ppf(0.95, 1))
#: Times the least sum of squares from which another fit cannot come near it.
_FAR = 30.0
#: Share of the variance of data that is left where a model tells hardly anything of them.
_LEFT = 0.5
#: Residuals over parameters from which on they tell their own noise, the least share of the range
#: that it is taken for, and how often it is taken anew.
_ENOUGH, _EXACT, _ROUNDS = 3, 1e-6, 3
#: Reduced chi-square up to which a model describes the data.
DESCRIBED = 2.0


class Problem(NamedTuple):
    """Residuals of all observations over the free parameters, these over their ranges."""

    model: Any
    names: tuple
    low: np.ndarray
    high: np.ndarray
    observations: list
    differences: bool  #: derivatives by differences, for comparison
    weights: Any = 1.0  #: of the residuals, where the noise of several sets is not known

    @property
    def noise(self):
        """Whether the noise of all data is known."""
        return all(one.noise for one in self.observations)

    def at(self, share):
        """Return the model with free parameters at shares of their ranges."""
        values = self.low + np.asarray(share) * (self.high - self.low)
        return self.model.with_values(dict(zip(self.names, map(float, values), strict=True)))

    @property
    def size(self):
        """How many residuals there are."""
        return sum(one.size for one in self.observations)

    def residuals(self, share, exact=True):
        """Return (residuals, derivatives by shares)."""
        names = self.names if exact and not self.differences else ()
        model, parts = self.at(share), []
        for one in self.observations:
            found = one.residuals(model, names)
            if found is None:
                return None
            parts.append(found)
        rest = np.concatenate([one[0] for one in parts])
        moved = np.vstack([one[1] for one in parts]) * (self.high - self.low if names else 1.0)
        return rest * self.weights, moved * np.reshape(self.weights, (-1, 1))

    def reweighed(self, rest):
        """Return the problem with what is left of each set of unknown noise as its deviation.

        One common scale would let the set that is described worst hide all others, and jumps with
        a known noise would weigh nothing beside them. None where there is nothing to weigh.
        """
        parts = [part for one in self.observations for part in one.blocks_of_noise]
        if len(parts) < 2 or all(known for _, known in parts):
            return None
        weights, end = np.ones(rest.size), 0
        for size, known in parts:
            part = slice(end, end + size)
            end += size
            if not known and size > _ENOUGH * len(self.names):
                left = (rest / self.weights)[part]
                weights[part] = 1.0 / max(float(np.sqrt(np.mean(left**2))), _EXACT)
        return self._replace(weights=weights)


def fit(model, data, free, *, starts=12, seed=0, derivatives="exact"):
    """Fit parameters of a model to measured sets.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair or GearTrain
        What is known of the rig; free parameters are replaced. Run-ups have derivatives where they
        go by closed forms.
    data : xarray.Dataset or list of xarray.Dataset
        As of `gearlib.read_measured`. A time course of ``displacement`` with ``known.course``, rows
        of s and rpm, is a run-up; extrema and fractions of time over ``speed`` and ``direction``
        are those of slow sweeps, scalars jump_up, jump_down, onset_of_contact_loss speeds of them.
        So are amplitudes of mesh orders of the displacement, ``order_amplitude_1`` and so on; of a
        train the mesh stands behind, ``order_amplitude_1_sun_2``, ``load_sharing_sun_2``.
    free : mapping
        Name of a parameter, of ``model.settable`` -> (lowest, highest), SI units.
    starts : int, default 12
        Points of a Latin hypercube that are tried beside the model itself. The best are improved,
        one after the other until one describes the data as well as their noise, where it is known.
    seed : int
    derivatives : {"exact", "differences"}
        The second is there to be compared with.

    Returns
    -------
    Fit
        Parameters with value, stderr, interval of 95 %; correlations, redchi, aicc, bic, the costs
        of all starts, and `unknown`: what the data cannot tell, in words. `str` is a report.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    if not is_model(model):
        raise ValueError(f"model = {model!r} is not allowed: it must be one such as GearPair")
    if model.speed is None:
        raise ValueError(
            f"model of type {type(model).__name__} is not allowed: nothing turns in it"
        )
    if model.mesh_names and model.reference_frequency is None:
        # At a speed in rpm nothing hangs on what tunings are counted in.
        hertz = float(model.mesh_frequency(1.0)) / math.tau
        model = model.replace(reference_frequency=hertz)
    checks.one_of("derivatives", derivatives, ("exact", "differences"))
    starts = checks.integer("starts", starts, 0, 10_000)
    seed = checks.integer("seed", seed, 0)
    names, low, high = _ranges(model, free)
    observations = observations_of(model, data)
    problem = Problem(model, names, low, high, observations, derivatives == "differences")
    _check(problem)
    first = (np.array([model.value(name) for name in names]) - low) / (high - low)
    tried = [first, *qmc.LatinHypercube(len(names), rng=seed).random(starts)]
    tried += opening.starts(problem, tried, seed, _improved) if starts else []
    costs = [_cost(problem, share) for share in tried]
    if not min(costs) < _HOPELESS:
        raise ValueError("free is not allowed: no start within its ranges could be run to the end")
    found: list = []
    for i in np.argsort(costs)[: _MOST if problem.noise else _FEW]:
        found.append(_improved(problem, tried[i]))
        if problem.noise and 2.0 * found[-1].cost < DESCRIBED * found[-1].fun.size:
            break
    best = min(found, key=lambda one: one.cost)
    if not best.status:
        # It has come near, and its evaluations have run out.
        found.append(_improved(problem, best.x))
        best = min(found, key=lambda one: one.cost)
    waterfall = sorted(2.0 * one.cost for one in found)
    for _ in range(_ROUNDS):
        weighed = problem.reweighed(best.fun)
        if weighed is None:
            break
        problem, spent = weighed, best.nfev
        best = _improved(problem, best.x)
        best.nfev += spent
    found = _judged(problem, best, waterfall, costs)
    endless = tuple(name for name in ("backlash",) if _is_endless(found, name))
    return _judged(problem, best, waterfall, costs, endless) if endless else found


def _check(problem):
    """Refuse fewer data than parameters, and a model without the derivatives that are needed."""
    if problem.size < len(problem.names):
        raise ValueError(
            f"data is not allowed: {problem.size} observations for {len(problem.names)} "
            "parameters; they must be as many at least"
        )
    model = problem.model
    name, allowed = type(model).__name__, "a GearPair, OneDegreePair, SixDegreePair or GearTrain"
    on_the_way = [one.kind == "run-up" for one in problem.observations]
    if any(on_the_way) and not problem.differences and _by_steps(model):
        raise ValueError(
            f"model of type {name} is not allowed in a fit to a run-up: it must be {allowed} "
            "whose motion between events has closed forms; or derivatives = 'differences'"
        )
    if model.kind().differentiate is None and not all(on_the_way):
        raise ValueError(
            f"model of type {name} is not allowed: its orbits have no derivatives; it must be "
            f"{allowed}"
        )


def _by_steps(model):
    """Return whether a model has no exact derivatives of run-ups."""
    return model.gyroscopic or propagator_of(model).words != "closed forms"


def goes_by_steps(model, data):
    """Return whether run-ups among the data have no exact derivatives for a model."""
    every = observations_of(model, data)
    return any(one.kind == "run-up" for one in every) and _by_steps(model)


def _is_endless(found, name):
    """Return whether the data allow a backlash that is never crossed as well as the best one."""
    problem, names = found._problem, found._problem.names
    if name not in names or not found.params[name].identifiable:
        return False
    i, share = names.index(name), found._share.copy()
    share[i] = 1.0
    model = problem.at(share)
    rest = problem.residuals(share, exact=False)
    if rest is None or rest[0] @ rest[0] > _FAR * found.redchi * found.ndata:
        return False
    deepest = max((one.deepest(model) for one in problem.observations), default=0.0)
    return deepest < problem.high[i] and found.profile(name, [problem.high[i]])[0] < _LEVEL


def _ranges(model, free):
    if not hasattr(free, "items") or not free:
        raise checks.refusal("free", free, "a mapping of parameters to (lowest, highest)")
    known = model.settable
    rows = []
    for name, ends in free.items():
        checks.one_of("free", name, known)
        a, b = checks.numbers(f"free[{name!r}]", ends, 2)
        value = model.value(name)
        checks.require(
            a < b and math.isfinite(a) and math.isfinite(b), f"free[{name!r}]", ends, "rising"
        )
        checks.require(
            a <= value <= b,
            f"free[{name!r}]",
            ends,
            f"a range that holds {name} = {value:g} of the model",
        )
        for end in (a, b):
            model.with_values({name: end})
        rows.append((name, a, b))
    names, low, high = zip(*rows, strict=True)
    return names, np.array(low), np.array(high)


def _cost(problem, share):
    found = problem.residuals(share, exact=False)
    return _HOPELESS if found is None else float(found[0] @ found[0])


def _improved(problem, start):
    last: dict = {}

    def both(share):
        key = share.tobytes()
        if key not in last:
            last.clear()
            found = problem.residuals(share)
            if found is None:
                found = np.full(problem.size, 1e6), np.zeros((problem.size, len(problem.names)))
            last[key] = found
        return last[key]

    def least(start, **how):
        for one in problem.observations:
            if isinstance(one, Speeds):
                one.forget()
        last.clear()
        return least_squares(
            lambda share: both(share)[0],
            np.clip(start, 1e-6, 1.0 - 1e-6),
            jac="2-point" if problem.differences else lambda share: both(share)[1],
            bounds=(0.0, 1.0),
            x_scale=0.1,
            **how,
        )

    spent = 0
    if any(isinstance(one, BranchStatistics) for one in problem.observations):
        # Points beyond the folds of a model pull nowhere: first the largest residuals count less.
        size = 1.0 if problem.noise else float(np.median(np.abs(both(start)[0]))) or 1.0
        rough = least(start, loss="soft_l1", f_scale=size, ftol=1e-4, max_nfev=30)
        start, spent = rough.x, rough.nfev
    found = least(start, ftol=1e-10, xtol=1e-10, gtol=1e-12, max_nfev=40)
    found.nfev += spent
    return found


def _judged(problem, best, waterfall, costs, endless=()):
    """Return the `Fit` of the best point; endless: parameters with no highest value."""
    rest, moved = best.fun, np.atleast_2d(best.jac)
    size = np.sqrt((moved**2).sum(axis=0))
    felt = size > _NOTHING * max(size.max(), 1.0)
    felt &= [name not in endless for name in problem.names]
    taken = sum(getattr(one, "eliminated", 0) for one in problem.observations)
    count = max(rest.size - taken - int(felt.sum()), 1)
    redchi = float(rest @ rest) / count
    scale = 1.0 if problem.noise else redchi
    width, values = problem.high - problem.low, problem.at(best.x)
    covariance = np.full((len(width),) * 2, np.nan)
    if felt.any():
        own = moved[:, felt]
        covariance[np.ix_(felt, felt)] = scale * np.linalg.pinv(own.T @ own)
    factor = float(student.ppf(0.975, count))
    unknown, parameters = [], []
    for i, name in enumerate(problem.names):
        value = float(values.value(name))
        error = float(np.sqrt(covariance[i, i])) * width[i]
        said = ""
        if not felt[i]:
            ends = problem.low[i], problem.high[i]
            said = _why(problem, values, name, *ends, struck=name in endless)
        elif error * factor > 0.5 * width[i]:
            said = (
                f"{name} is hardly known: its interval of 95 % is as wide as its range, "
                f"{problem.low[i]:g} to {problem.high[i]:g}"
            )
        if said:
            unknown.append(said)
        parameters.append(
            Parameter(
                name,
                value,
                error,
                factor * error,
                problem.low[i],
                problem.high[i],
                float(problem.model.value(name)),
                felt[i],
            )
        )
    if problem.noise and redchi > DESCRIBED:
        unknown.append(
            f"the model does not describe the data: they are {math.sqrt(redchi):.3g} times as far "
            "from it as their noise explains, and no interval holds"
        )
    unknown += [] if problem.noise else _unexplained(problem, values)
    k, n = int(felt.sum()) + 1, rest.size
    likelihood = n * math.log(max(float(rest @ rest) / n, 1e-300))
    likelihood -= 2.0 * float(np.broadcast_to(np.log(problem.weights), n).sum())
    deviation = np.sqrt(np.diag(covariance))
    return Fit(
        values,
        {one.name: one for one in parameters},
        covariance / np.outer(deviation, deviation),
        redchi,
        likelihood + 2.0 * k + 2.0 * k * (k + 1) / max(n - k - 1, 1),
        likelihood + k * math.log(n),
        n,
        int(best.nfev),
        np.array(waterfall),
        np.array(costs),
        tuple(unknown),
        problem,
        best.x,
    )


def _unexplained(problem, model):
    """Return sentences on data of unknown noise that a model leaves mostly as they are."""
    found = []
    for one in problem.observations:
        share = 0.0 if one.kind == "speeds" else left_over(one.curves(model))
        if share > _LEFT:
            found.append(
                f"the model does not describe the data: it leaves {100.0 * share:.0f} % of what "
                f"varies in the {one.kind}, whose noise is not known"
            )
    return found


def _why(problem, model, name, low, high, struck=False):
    """Return why nothing in the data hangs on a parameter."""
    if name != "backlash":
        return f"{name} is not identifiable: nothing in the data hangs on it"
    value, model = model.value(name), model.with_values({name: high})
    deepest = max((one.deepest(model) for one in problem.observations), default=0.0)
    # Where a little less describes the data as well, no more than that is known.
    bound = min(deepest, value) if struck else deepest
    how = "the far flank is never struck" if deepest > 0.0 else "contact is never lost"
    more = f"it is at least {bound:.4g} m, the largest way into the backlash there, and "
    more = f"{more}nothing tells how much more" if bound > low else "nothing tells how large it is"
    return f"backlash is not identifiable: {how} in what is compared; {more}"
