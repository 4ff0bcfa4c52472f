"""`fit`: parameters of a model from measured sets, by least squares with differences of runs."""

import math
import warnings
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from gearlib import checks
from gearlib.analysis.sensitivities import richardson
from gearlib.models.model import is_model
from gearlib.uncertainty.fit_report import report
from gearlib.uncertainty.observation import START_REFUSAL
from gearlib.uncertainty.observations import observations_of

#: Step of the differences during the iterations, as a share of the range.
_STEP = 1e-5
#: A column of the Jacobian below this share of the largest is rounding: the iterations leave it.
_ROUNDING = 1e-7
#: Widths of the differences at the optimum are shares of this share of the range of a parameter;
#: each costs two runs, and those below the second number are left out.
_WIDTH_SCALE, _LEAST_WIDTH = 0.1, 1e-5
#: Residuals where a motion could not go on, and sum of squares beyond which a start is refused.
_FAILED_RESIDUAL, _MAX_START_COST = 1e6, 1e30
#: Residuals over parameters from which on they tell their own noise, the least share of the range
#: that it is taken for, and how often the residuals are weighted anew.
_WEIGHTED_RATIO, _LEAST_NOISE, _MAX_WEIGHTINGS = 3, 1e-6, 3


class Problem(NamedTuple):
    """Residuals of all observations over the free parameters, which are shares of their ranges."""

    model: Any
    names: tuple
    low: np.ndarray
    high: np.ndarray
    observations: list
    weights: Any = 1.0  #: of the residuals, where the noise of several channels is not known

    @property
    def channels(self) -> list:
        """Return the channels of all observations, in the order of the residuals."""
        return [channel for part in self.observations for channel in part.channels]

    @property
    def size(self) -> int:
        """Return the number of residuals."""
        return sum(channel.values.size for channel in self.channels)

    @property
    def noise_known(self) -> bool:
        """Return whether the noise of all data is known."""
        return all(channel.noise_known for channel in self.channels)

    def at(self, shares: np.ndarray) -> Any:
        """Return the model with free parameters at shares of their ranges."""
        values = self.low + np.asarray(shares) * (self.high - self.low)
        return self.model.with_values(dict(zip(self.names, map(float, values), strict=True)))

    def residuals(self, shares: np.ndarray) -> np.ndarray | None:
        """Return the weighted residuals, None where a motion could not go on."""
        model, rows = self.at(shares), []
        for observation in self.observations:
            rows.append(observation.residuals(model))
            if rows[-1] is None:
                return None
        return np.concatenate(rows) * self.weights


def fit(model, data, free):
    """Fit parameters of a model to measured sets.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair, GearTrain, ...
        What is known of the rig. The fit starts from its values of the free parameters.
    data : xarray.Dataset or list of xarray.Dataset
        Measured sets as `gearlib.read_measured` returns them. A time course of ``displacement``
        with ``known.course``, rows of s and rpm, is a run-up; extrema and fractions of time over
        ``speed`` and ``direction`` are those of slow sweeps, scalars jump_up, jump_down,
        onset_of_contact_loss speeds of them. So are amplitudes of mesh orders of the displacement,
        ``order_amplitude_1`` and so on; of a train the mesh stands behind,
        ``order_amplitude_1_sun_2``, ``load_sharing_sun_2``.
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
    model = _checked(model)
    names, low, high = _ranges(model, free)
    problem = Problem(model, names, low, high, observations_of(model, data))
    for observation in problem.observations:
        if observation.warning:
            warnings.warn(observation.warning, stacklevel=2)
    if problem.size < len(names):
        raise ValueError(
            f"data is not allowed: {problem.size} observations for {len(names)} "
            "parameters; they must be as many at least"
        )
    start = (np.array([model.value(name) for name in names]) - low) / (high - low)
    residuals = problem.residuals(start)
    if residuals is None or not residuals @ residuals < _MAX_START_COST:
        raise ValueError(START_REFUSAL)
    problem, best = _optimum(problem, start)
    return report(problem, best, *_precise_jacobian(problem, best))


def _checked(model: Any) -> Any:
    """Return a model in which something turns, with tunings whose unit no parameter changes."""
    if not is_model(model):
        raise ValueError(f"model = {model!r} is not allowed: it must be one such as GearPair")
    if model.speed is None:
        raise ValueError(
            f"model of type {type(model).__name__} is not allowed: nothing turns in it"
        )
    if model.mesh_names and model.reference_frequency is None:
        hertz = float(model.mesh_frequency(1.0)) / math.tau
        return model.replace(reference_frequency=hertz)
    return model


def _ranges(model: Any, free: Any) -> tuple[tuple, np.ndarray, np.ndarray]:
    """Return names, lowest and highest values of the free parameters, checked."""
    if not hasattr(free, "items") or not free:
        raise checks.refusal("free", free, "a mapping of parameters to (lowest, highest)")
    known, rows = model.settable, []
    for name, ends in free.items():
        checks.one_of("free", name, known)
        key = f"free[{name!r}]"
        low, high = checks.numbers(key, ends, 2)
        value = model.value(name)
        finite = math.isfinite(low) and math.isfinite(high)
        checks.require(low < high and finite, key, ends, "rising")
        allowed = f"a range that holds {name} = {value:g} of the model"
        checks.require(low <= value <= high, key, ends, allowed)
        for end in (low, high):
            model.with_values({name: end})
        rows.append((name, low, high))
    names, lows, highs = zip(*rows, strict=True)
    return names, np.array(lows), np.array(highs)


def _optimum(problem: Problem, start: np.ndarray) -> tuple[Problem, Any]:
    """Return the problem with its last weights, and the result of least squares."""
    best = _least_squares(problem, start)
    if not best.status:
        # It has come near, and its evaluations have run out.
        best = _least_squares(problem, best.x)
    for _ in range(_MAX_WEIGHTINGS):
        weights = _weights(problem, best.fun)
        if weights is None:
            break
        problem, evaluations = problem._replace(weights=weights), best.nfev
        best = _least_squares(problem, best.x)
        best.nfev += evaluations
    return problem, best


def _weights(problem: Problem, residuals: np.ndarray) -> np.ndarray | None:
    """Return weights that make what is left of each channel of unknown noise its deviation.

    One common scale would let the channel that is described worst hide all others, and jumps with
    a known noise would weigh nothing beside them. None where there is nothing to weigh.
    """
    blocks: list = []
    for channel in problem.channels:
        if channel.joined:
            blocks[-1][0] += channel.values.size
        else:
            blocks.append([channel.values.size, channel.noise_known])
    if len(blocks) < 2 or problem.noise_known:
        return None
    weights, end = np.ones(residuals.size), 0
    for size, known in blocks:
        part = slice(end, end + size)
        end += size
        if not known and size > _WEIGHTED_RATIO * len(problem.names):
            left = (residuals / problem.weights)[part]
            weights[part] = 1.0 / max(float(np.sqrt(np.mean(left**2))), _LEAST_NOISE)
    return weights


def _least_squares(problem: Problem, start: np.ndarray) -> Any:
    """Return scipy's result of least squares from a start, over shares of the ranges."""

    def residuals(shares):
        values = problem.residuals(shares)
        return np.full(problem.size, _FAILED_RESIDUAL) if values is None else values

    def solve(start, **settings):
        return least_squares(
            residuals,
            np.clip(start, 1e-6, 1.0 - 1e-6),
            jac=lambda shares: _jacobian(problem, shares, residuals(shares)),
            bounds=(0.0, 1.0),
            x_scale=0.1,
            **settings,
        )

    evaluations = 0
    if any(observation.kind == "branches" for observation in problem.observations):
        # Points beyond the folds of a model pull nowhere: first the largest residuals count less.
        size = 1.0 if problem.noise_known else float(np.median(np.abs(residuals(start)))) or 1.0
        rough = solve(start, loss="soft_l1", f_scale=size, ftol=1e-4, max_nfev=30)
        start, evaluations = rough.x, rough.nfev
    best = solve(start, ftol=1e-10, xtol=1e-10, gtol=1e-12, max_nfev=40)
    best.nfev += evaluations
    return best


def _jacobian(problem: Problem, shares: np.ndarray, residuals: np.ndarray) -> np.ndarray:
    """Return differences of the residuals by shares, shape (residuals, parameters)."""
    jacobian = np.zeros((problem.size, shares.size))
    for i in range(shares.size):
        step = _STEP if shares[i] < 0.5 else -_STEP
        beside = problem.residuals(_moved(shares, i, shares[i] + step))
        if beside is not None:
            jacobian[:, i] = (beside - residuals) / step
    sizes = np.linalg.norm(jacobian, axis=0)
    jacobian[:, sizes < _ROUNDING * max(sizes.max(), 1.0)] = 0.0
    return jacobian


def _moved(shares: np.ndarray, i: int, value: float) -> np.ndarray:
    """Return the shares with another value of the parameter with the number i."""
    return np.where(np.arange(shares.size) == i, value, shares)


def _precise_jacobian(problem: Problem, best: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return derivatives at the optimum and their errors, shapes (residuals, parameters)."""
    jacobian, errors = np.array(best.jac), np.zeros(best.jac.shape)
    for i, share in enumerate(best.x):

        def residuals(value, i=i, share=share):
            if value != share and abs(value - share) < _LEAST_WIDTH:
                return None
            return problem.residuals(_moved(best.x, i, value))

        derivative, error = richardson(residuals, share, _WIDTH_SCALE)
        if np.isfinite(derivative).all():
            jacobian[:, i], errors[:, i] = derivative, error
    return jacobian, errors
