"""`fit`: parameters of a model from measured sets, by least squares with differences of runs.

Motions are followed, not pixels: run-ups are compared block by block where they are near one orbit,
jumps by the speed at which they happen. Sensor gain, offset and slow waves are eliminated. What the
data cannot tell is said in words and never given a number with an interval.
"""

import math
import warnings
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2
from scipy.stats import t as student

from gearlib import checks
from gearlib.models.model import is_model
from gearlib.rig import identifiability
from gearlib.rig.branch_observations import BranchStatistics
from gearlib.rig.fit_report import Fit, Parameter
from gearlib.rig.observations import observations_of

#: Step of the differences during the iterations, as a share of the range.
_STEP = 1e-5
#: A column of the Jacobian below this share of the largest is rounding: the iterations leave it.
_ROUNDING = 1e-7
#: Residuals over their deviations beyond which a start is hopeless.
_HOPELESS = 1e30
#: -2 ln of the ratio of likelihoods at the ends of an interval of 95 %.
_LEVEL = float(chi2.ppf(0.95, 1))
#: Times the least sum of squares from which another fit cannot come near it.
_FAR = 30.0
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

    def residuals(self, share):
        """Return the residuals, None where a motion could not go on."""
        model, parts = self.at(share), []
        for observation in self.observations:
            part = observation.residuals(model)
            if part is None:
                return None
            parts.append(part)
        return np.concatenate(parts) * self.weights

    def cost(self, share):
        """Return the sum of squares, infinity where a motion could not go on."""
        residuals = self.residuals(share)
        return np.inf if residuals is None else float(residuals @ residuals)

    def without(self, name, value):
        """Return the problem with one parameter held at a value."""
        i = self.names.index(name)
        return self._replace(
            model=self.model.with_values({name: value}),
            names=self.names[:i] + self.names[i + 1 :],
            low=np.delete(self.low, i),
            high=np.delete(self.high, i),
        )

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


def fit(model, data, free):
    """Fit parameters of a model to measured sets.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair, GearTrain, ...
        What is known of the rig. The fit starts from its values of the free parameters.
    data : xarray.Dataset or list of xarray.Dataset
        As of `gearlib.read_measured`. A time course of ``displacement`` with ``known.course``, rows
        of s and rpm, is a run-up; extrema and fractions of time over ``speed`` and ``direction``
        are those of slow sweeps, scalars jump_up, jump_down, onset_of_contact_loss speeds of them.
        So are amplitudes of mesh orders of the displacement, ``order_amplitude_1`` and so on; of a
        train the mesh stands behind, ``order_amplitude_1_sun_2``, ``load_sharing_sun_2``.
    free : mapping
        Name of a parameter, of ``model.settable`` -> (lowest, highest), SI units.

    Returns
    -------
    Fit
        Parameters with value, stderr, interval of 95 %; correlations, redchi, aicc, bic, and
        `unknown`: what the data cannot tell, in words. `str` is a report.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.

    Warns
    -----
    UserWarning
        How many revolutions of a run-up are left out, for they have gaps or too few samples.
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
    names, low, high = _ranges(model, free)
    problem = Problem(model, names, low, high, observations_of(model, data))
    for sentence in filter(None, (getattr(one, "left_out", "") for one in problem.observations)):
        warnings.warn(sentence, stacklevel=2)
    if problem.size < len(names):
        raise ValueError(
            f"data is not allowed: {problem.size} observations for {len(names)} "
            "parameters; they must be as many at least"
        )
    start = (np.array([model.value(name) for name in names]) - low) / (high - low)
    if not problem.cost(start) < _HOPELESS:
        raise ValueError(
            "model is not allowed: a motion with its values, where the fit starts, could not be "
            "run to the end"
        )
    best = _improved(problem, start)
    if not best.status:
        # It has come near, and its evaluations have run out.
        best = _improved(problem, best.x)
    for _ in range(_ROUNDS):
        reweighed = problem.reweighed(best.fun)
        if reweighed is None:
            break
        problem, spent = reweighed, best.nfev
        best = _improved(problem, best.x)
        best.nfev += spent
    derivatives = identifiability.precise_jacobian(problem, best)
    fitted = _judged(problem, best, derivatives)
    if _is_endless(problem, best, fitted, "backlash"):
        return _judged(problem, best, derivatives, ("backlash",))
    return fitted


def _is_endless(problem, best, fitted, name):
    """Return whether the data allow a backlash that is never crossed as well as the best one."""
    if name not in problem.names or not fitted.params[name].identifiable:
        return False
    i, share = problem.names.index(name), best.x.copy()
    share[i] = 1.0
    if not problem.cost(share) <= _FAR * fitted.redchi * fitted.ndata:
        return False
    model = problem.at(share)
    deepest = max((one.deepest(model) for one in problem.observations), default=0.0)
    if deepest >= problem.high[i]:
        return False
    held, cost = problem.without(name, float(problem.high[i])), problem.cost(share)
    if held.names:
        cost = 2.0 * _improved(held, np.delete(best.x, i)).cost
    scale = 1.0 if problem.noise else fitted.redchi
    return (cost - 2.0 * best.cost) / scale < _LEVEL


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


def _improved(problem, start):
    """Return scipy's result of least squares from a start, over shares of the ranges."""
    known: dict = {}

    def residuals(share):
        if share.tobytes() not in known:
            known.clear()
            values = problem.residuals(share)
            known[share.tobytes()] = np.full(problem.size, 1e6) if values is None else values
        return known[share.tobytes()]

    def least(start, **how):
        return least_squares(
            residuals,
            np.clip(start, 1e-6, 1.0 - 1e-6),
            jac=lambda share: _jacobian(problem, share, residuals(share)),
            bounds=(0.0, 1.0),
            x_scale=0.1,
            **how,
        )

    spent = 0
    if any(isinstance(one, BranchStatistics) for one in problem.observations):
        # Points beyond the folds of a model pull nowhere: first the largest residuals count less.
        size = 1.0 if problem.noise else float(np.median(np.abs(residuals(start)))) or 1.0
        rough = least(start, loss="soft_l1", f_scale=size, ftol=1e-4, max_nfev=30)
        start, spent = rough.x, rough.nfev
    best = least(start, ftol=1e-10, xtol=1e-10, gtol=1e-12, max_nfev=40)
    best.nfev += spent
    return best


def _jacobian(problem, share, residuals):
    """Return differences of the residuals by shares, shape (residuals, parameters)."""
    jacobian = np.zeros((problem.size, share.size))
    for i in range(share.size):
        step = _STEP if share[i] < 0.5 else -_STEP
        beside = problem.residuals(identifiability.moved(share, i, share[i] + step))
        if beside is not None:
            jacobian[:, i] = (beside - residuals) / step
    sizes = np.linalg.norm(jacobian, axis=0)
    jacobian[:, sizes < _ROUNDING * max(sizes.max(), 1.0)] = 0.0
    return jacobian


def _judged(problem, best, derivatives, endless=()):
    """Return the `Fit` of the best point; endless: parameters with no highest value."""
    residuals, (jacobian, errors) = best.fun, derivatives
    model, directions = problem.at(best.x), identifiability.unknown_directions(jacobian, errors)
    known = identifiability.identifiable(directions)
    known &= [name not in endless for name in problem.names]
    squares, n, k = float(residuals @ residuals), residuals.size, int(known.sum())
    eliminated = sum(getattr(one, "eliminated", 0) for one in problem.observations)
    freedom = max(n - eliminated - k, 1)
    redchi = squares / freedom
    covariance = _covariance(jacobian, known) * (1.0 if problem.noise else redchi)
    factor = float(student.ppf(0.975, freedom))
    parameters = _parameters(problem, model, covariance, factor, known)
    unknown = []
    for i, parameter in enumerate(parameters):
        if not known[i]:
            struck = parameter.name in endless
            unknown.append(identifiability.reason(problem, model, i, directions, struck))
        elif parameter.half_width > 0.5 * (parameter.max - parameter.min):
            unknown.append(
                f"{parameter.name} is hardly known: its interval of 95 % is as wide as its range, "
                f"{parameter.min:g} to {parameter.max:g}"
            )
    if problem.noise and redchi > DESCRIBED:
        unknown.append(
            f"the model does not describe the data: they are {math.sqrt(redchi):.3g} times as far "
            "from it as their noise explains, and no interval holds"
        )
    if not problem.noise:
        unknown += identifiability.unexplained(problem, model)
        unknown += identifiability.correlated(problem, residuals / problem.weights)
    # The noise is a parameter as well.
    k += 1
    likelihood = n * math.log(max(squares / n, 1e-300))
    likelihood -= 2.0 * float(np.broadcast_to(np.log(problem.weights), n).sum())
    deviation = np.sqrt(np.diag(covariance))
    return Fit(
        model,
        {parameter.name: parameter for parameter in parameters},
        covariance / np.outer(deviation, deviation),
        redchi,
        likelihood + 2.0 * k + 2.0 * k * (k + 1) / max(n - k - 1, 1),
        likelihood + k * math.log(n),
        n,
        int(best.nfev),
        tuple(unknown),
        problem,
    )


def _covariance(jacobian, known):
    """Return the covariance of the shares of known parameters for a variance of 1, else NaN."""
    covariance = np.full((known.size,) * 2, np.nan)
    if known.any():
        columns = jacobian[:, known]
        covariance[np.ix_(known, known)] = np.linalg.pinv(columns.T @ columns)
    return covariance


def _parameters(problem, model, covariance, factor, known):
    """Return a `Parameter` for each name; factor: of Student, from errors to intervals."""
    errors = np.sqrt(np.diag(covariance)) * (problem.high - problem.low)
    return [
        Parameter(
            name,
            float(model.value(name)),
            float(errors[i]),
            factor * float(errors[i]),
            problem.low[i],
            problem.high[i],
            float(problem.model.value(name)),
            known[i],
        )
        for i, name in enumerate(problem.names)
    ]
