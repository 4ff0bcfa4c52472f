"""`fit`: parameters of a model from measured sets, by least squares with differences of runs.

The result has values, intervals, and in words what the data cannot tell.
"""

import math
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import binom
from scipy.stats import t as student

from gearlib import checks
from gearlib.analysis.sensitivities import richardson
from gearlib.data.result import result
from gearlib.models.model import is_model
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

#: A derivative below this share of the largest, over the ranges of the parameters, is none.
_LEAST_DERIVATIVE = 1e-9
#: Share of its range by which a parameter moves along a direction that the data do not determine,
#: from which on the parameter is not known either.
_LEAST_SHARE = 0.01
#: Share of the variance of data that is left where a model tells hardly anything of them.
_MAX_UNEXPLAINED = 0.5
#: Reduced chi-square up to which a model describes the data.
_MAX_REDUCED_CHI_SQUARE = 2.0
#: Probability of a false alarm about residuals that are independent of each other, and the least
#: residual that has a sign, over what counts as a deviation where the noise is not known.
_FALSE_ALARMS, _LEAST_RESIDUAL = 1e-3, 1e-6


@dataclass(frozen=True)
class Parameter:
    """One free parameter, SI units."""

    name: str
    value: float
    stderr: float  #: standard error, NaN where the data do not tell
    half_width: float  #: of the interval of 95 %
    min: float
    max: float
    init: float
    identifiable: bool

    @property
    def interval(self) -> tuple[float, float]:
        """Return the lowest and highest value of the interval of 95 %."""
        return self.value - self.half_width, self.value + self.half_width


@dataclass(frozen=True)
class Fit:
    """A fit; `str` is its report."""

    model: Any  #: the fitted model
    params: dict  #: name -> `Parameter`
    correlations: np.ndarray  #: shape (k, k), in the order of `params`
    redchi: float  #: sum of squares over their variances, per degree of freedom
    aicc: float  #: Akaike's criterion, corrected for the number of data
    bic: float
    ndata: int
    nfev: int
    unknown: tuple  #: sentences: what the data cannot tell
    noise: bool  #: whether the noise of all data is known
    _observations: list

    def __str__(self):
        lines = [
            "[[Fit Statistics]]",
            f"    # data points      = {self.ndata}",
            f"    # variables        = {len(self.params)}",
            f"    # function evals   = {self.nfev}",
            f"    reduced chi-square = {self.redchi:.6g}",
            f"    Akaike info crit   = {self.aicc:.6g} (corrected)",
            f"    Bayesian info crit = {self.bic:.6g}",
            "[[Variables]]",
        ]
        for p in self.params.values():
            share = abs(100.0 * p.stderr / p.value) if p.value else np.inf
            known = f"+/- {p.stderr:.4g} ({share:.2f}%)" if p.identifiable else "not known"
            lines.append(f"    {p.name}: {p.value:.8g} {known} (init = {p.init:.6g})")
        names = list(self.params)
        rows, columns = np.nonzero(np.triu(np.abs(self.correlations) > 0.1, 1))
        if rows.size:
            lines.append("[[Correlations]] (unreported correlations are < 0.100)")
            values = self.correlations[rows, columns]
            for i in np.argsort(-np.abs(values), kind="stable"):
                lines.append(f"    C({names[rows[i]]}, {names[columns[i]]}) = {values[i]:+.4f}")
        if self.unknown:
            lines.append("[[Not identifiable]]")
            lines += [f"    {sentence}" for sentence in self.unknown]
        return "\n".join(lines)

    def curves(self):
        """Return what was compared, a list of `gearlib.uncertainty.observation.Curve` or `Place`.

        The first have measured and fitted values over speed or phase, the second measured speeds.
        """
        return [
            curve for part in self._observations for curve in part.draw(part.sensed(self.model))
        ]

    def dataset(self):
        """Return the fit as a dataset over its parameters, in their SI units."""
        rows = self.params.values()
        names, known = list(self.params), self.model.settable
        ends = np.array([row.interval for row in rows]).reshape(-1, 2)
        data = {
            "fitted_value": ("parameter", [row.value for row in rows]),
            "stderr": ("parameter", [row.stderr for row in rows]),
            "interval_low": ("parameter", ends[:, 0]),
            "interval_high": ("parameter", ends[:, 1]),
            "range_low": ("parameter", [row.min for row in rows]),
            "range_high": ("parameter", [row.max for row in rows]),
            "initial_value": ("parameter", [row.init for row in rows]),
            "identifiable": ("parameter", np.array([row.identifiable for row in rows])),
            "parameter_units": ("parameter", [known[name][0] for name in names]),
            "correlation": (("parameter", "other_parameter"), self.correlations),
            **{name: ((), getattr(self, name)) for name in ("redchi", "aicc", "bic", "ndata")},
        }
        coords = {"parameter": names, "other_parameter": names}
        title = "Parameters of a gear mesh by a fit"
        more = {"unknown": list(self.unknown)}
        return result(title, self.model, data, coords, method="least squares", **more)


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
    return _report(problem, best, *_precise_jacobian(problem, best))


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


def _report(problem: Problem, best: Any, jacobian: np.ndarray, errors: np.ndarray) -> Fit:
    """Return the `Fit` at the best point of a problem.

    `jacobian` and `errors` are the derivatives there and how far off they may be.
    """
    model, directions = problem.at(best.x), _unknown_directions(jacobian, errors)
    known = (np.abs(directions) < _LEAST_SHARE).all(axis=0)
    squares, n, k = float(best.fun @ best.fun), best.fun.size, int(known.sum())
    eliminated = sum(channel.eliminated for channel in problem.channels)
    freedom = max(n - eliminated - k, 1)
    redchi = squares / freedom
    covariance = np.full((known.size,) * 2, np.nan)
    if known.any():
        columns = jacobian[:, known]
        covariance[np.ix_(known, known)] = np.linalg.pinv(columns.T @ columns)
    covariance *= 1.0 if problem.noise_known else redchi
    deviations = np.sqrt(np.diag(covariance))
    stderr = deviations * (problem.high - problem.low)
    half_widths = stderr * float(student.ppf(0.975, freedom))
    values, starts = (
        [float(x.value(name)) for name in problem.names] for x in (model, problem.model)
    )
    rows = zip(
        problem.names,
        values,
        stderr,
        half_widths,
        problem.low,
        problem.high,
        starts,
        known,
        strict=True,
    )
    params = {row[0]: Parameter(*row) for row in rows}
    unknown = _about_parameters(problem, model, params, directions)
    unknown += _about_residuals(problem, model, best.fun, redchi)
    # The noise is a parameter as well.
    k += 1
    likelihood = n * math.log(max(squares / n, 1e-300))
    likelihood -= 2.0 * float(np.broadcast_to(np.log(problem.weights), n).sum())
    return Fit(
        model,
        params,
        covariance / np.outer(deviations, deviations),
        redchi,
        likelihood + 2.0 * k + 2.0 * k * (k + 1) / max(n - k - 1, 1),
        likelihood + k * math.log(n),
        n,
        int(best.nfev),
        tuple(unknown),
        problem.noise_known,
        problem.observations,
    )


def _unknown_directions(jacobian: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Return directions of parameters, rows, along which residuals change by rounding at most."""
    _, sizes, directions = np.linalg.svd(jacobian, full_matrices=False)
    noise = np.linalg.norm(errors @ np.abs(directions.T), axis=0)
    return directions[sizes <= np.maximum(noise, _LEAST_DERIVATIVE * max(sizes.max(), 1.0))]


def _about_parameters(problem: Any, model: Any, params: dict, directions: np.ndarray) -> list[str]:
    """Return sentences on parameters that the data do not determine."""
    sentences = []
    for i, (name, parameter) in enumerate(params.items()):
        if parameter.identifiable:
            if parameter.half_width > 0.5 * (parameter.max - parameter.min):
                sentences.append(
                    f"{name} is hardly known: its interval of 95 % is as wide as its range, "
                    f"{parameter.min:g} to {parameter.max:g}"
                )
            continue
        if name == "backlash":
            sentences.append(_about_backlash(problem, model, i))
            continue
        rows = np.abs(directions[np.abs(directions[:, i]) >= _LEAST_SHARE])
        together = (rows >= _LEAST_SHARE).any(axis=0)
        others = [other for j, other in enumerate(problem.names) if together[j] and j != i]
        reason = "nothing in the data hangs on it"
        if others:
            reason = f"the data tell only a combination of it and {' and '.join(others)}"
        sentences.append(f"{name} is not identifiable: {reason}")
    return sentences


def _about_backlash(problem: Any, model: Any, i: int) -> str:
    """Return a sentence on how large the backlash, parameter number i, is at least."""
    model = model.with_values({"backlash": problem.high[i]})
    depth = max(part.predict(model)[1] for part in problem.observations)
    reason = "the far flank is never struck" if depth > 0.0 else "contact is never lost"
    more = "nothing tells how large it is"
    if depth > problem.low[i]:
        more = (
            f"it is at least {depth:.4g} m, the largest way into the backlash there, and nothing "
            "tells how much more"
        )
    return f"backlash is not identifiable: {reason} in what is compared; {more}"


def _about_residuals(problem: Any, model: Any, residuals: np.ndarray, redchi: float) -> list[str]:
    """Return sentences on data that the model does not describe."""
    if problem.noise_known:
        if redchi <= _MAX_REDUCED_CHI_SQUARE:
            return []
        return [
            f"the model does not describe the data: they are {math.sqrt(redchi):.3g} times as far "
            "from it as their noise explains, and no interval holds"
        ]
    sentences = []
    for observation in problem.observations:
        share = _unexplained(observation, model)
        if share > _MAX_UNEXPLAINED:
            sentences.append(
                f"the model does not describe the data: it leaves {100.0 * share:.0f} % of what "
                f"varies in the {observation.kind}, whose noise is not known, and no interval holds"
            )
    return sentences + correlated(problem.channels, residuals / problem.weights)


def _unexplained(observation: Any, model: Any) -> float:
    """Return the share of the variance of measured values that a model leaves, of all channels."""
    shares = [
        np.mean((fitted - channel.values) ** 2) / np.var(channel.values)
        for channel, fitted in zip(observation.channels, observation.sensed(model), strict=True)
        if channel.sequences is not None and np.ptp(channel.values) > 0.0
    ]
    return float(max(shares, default=0.0))


def correlated(channels: list, residuals: np.ndarray) -> list[str]:
    """Return sentences on residuals of unknown noise that do not change their sign often enough.

    Signs of independent residuals change with a probability of one half from each to the next,
    whatever their deviations are (Geary, Biometrika 57 (1970) 123-127).
    """
    ends = np.cumsum([channel.values.size for channel in channels])[:-1]
    sequences: dict = {}
    for channel, part in zip(channels, np.split(residuals, ends), strict=True):
        if channel.sequences is not None and not channel.noise_known:
            sequences.setdefault(channel.name, []).append(part[channel.sequences])
    sentences = []
    for name, parts in sequences.items():
        signs = [row[np.abs(row) > _LEAST_RESIDUAL] > 0.0 for row in np.concatenate(parts, axis=1)]
        changes = sum(int((row[1:] != row[:-1]).sum()) for row in signs)
        steps = sum(max(row.size - 1, 0) for row in signs)
        if binom.cdf(changes, steps, 0.5) < _FALSE_ALARMS / len(sequences):
            sentences.append(
                f"what the model leaves of the {name.replace('_', ' ')} is not independent noise: "
                f"it changes its sign {changes} times in {steps} steps, where {steps / 2:g} times "
                "are expected, and no interval holds"
            )
    return sentences
