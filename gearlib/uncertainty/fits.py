"""Fit parameters of a model to measured data by least squares (`fit`).

Derivatives are difference quotients of runs of the model. The result has values, confidence
intervals and messages about parameters that the data do not determine.
"""

import math
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import binom, chi2
from scipy.stats import t as student

from gearlib import checks, parameters
from gearlib.analysis.sensitivities import richardson_derivative
from gearlib.data.result import make_result
from gearlib.models.model import is_model
from gearlib.parameters import Limits
from gearlib.uncertainty.observation import START_ERROR
from gearlib.uncertainty.observations import make_observations

#: Step of the difference quotients during the iterations, relative to the range of a parameter.
_DIFFERENCE_STEP = 1e-5
#: Columns of the Jacobian matrix with a smaller norm, relative to the largest norm, are set to
#: zero.
_MIN_RELATIVE_COLUMN_NORM = 1e-7
#: Largest and smallest step of the difference quotients at the optimum, relative to the range.
_MAX_OPTIMUM_STEP, _MIN_OPTIMUM_STEP = 0.1, 1e-5
#: Residual of a failed run, and sum of squares at which an initial guess is rejected.
_FAILED_RESIDUAL, _MAX_START_COST = 1e6, 1e30
#: A channel of unknown noise is weighted by its residuals if it has more residuals per parameter
#: than this.
_MIN_RESIDUALS_PER_PARAMETER = 3
#: Lower bound of the RMS from which a weight is computed, and largest number of reweightings.
_MIN_NOISE, _MAX_WEIGHTINGS = 1e-6, 3
#: Smaller singular values of the Jacobian matrix, relative to the largest one, count as zero.
_MIN_RELATIVE_SINGULAR_VALUE = 1e-9
#: A parameter with a larger component in an undetermined direction is not identifiable.
_MAX_UNDETERMINED_COMPONENT = 0.01
#: Fraction of the variance of the data that a model may leave unexplained.
_MAX_UNEXPLAINED_FRACTION = 0.5
#: Probability of a false alarm of the tests for chi-square and for correlated residuals, and
#: smallest residual, in standard deviations, whose sign counts.
_FALSE_ALARM_PROBABILITY, _MIN_SIGNED_RESIDUAL = 1e-3, 1e-6


@dataclass(frozen=True)
class Parameter:
    """A fitted parameter with its uncertainty, in SI units."""

    name: str
    value: float
    stderr: float  #: standard error, NaN if the parameter is not identifiable
    half_width: float  #: half the width of the 95 % confidence interval
    min: float
    max: float
    init: float
    identifiable: bool

    @property
    def interval(self) -> tuple[float, float]:
        """Return the limits of the 95 % confidence interval."""
        return self.value - self.half_width, self.value + self.half_width


@dataclass(frozen=True)
class Fit:
    """The result of a fit: the fitted model, its parameters and statistics; `str` is a report."""

    model: Any  #: the fitted model
    params: dict  #: name -> `Parameter`
    correlations: np.ndarray  #: shape (k, k), in the order of `params`
    redchi: float  #: sum of squares over their variances, per degree of freedom
    aicc: float  #: Akaike's criterion, corrected for the number of data
    bic: float
    ndata: int
    nfev: int
    unknown: tuple  #: messages about undetermined parameters and data that the model cannot fit
    noise: bool  #: whether the noise of all data is known
    _observations: list

    def __str__(self):
        """Return a report of the fit: its statistics, parameters, correlations and messages."""
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
        for parameter in self.params.values():
            value, stderr = parameter.value, parameter.stderr
            error = "not known"
            if parameter.identifiable:
                percent = abs(100.0 * stderr / value) if value else np.inf
                error = f"+/- {stderr:.4g} ({percent:.2f}%)"
            lines.append(f"    {parameter.name}: {value:.8g} {error} (init = {parameter.init:.6g})")
        names = list(self.params)
        rows, columns = np.nonzero(np.triu(np.abs(self.correlations) > 0.1, 1))
        if rows.size:
            lines.append("[[Correlations]] (unreported correlations are < 0.100)")
            values = self.correlations[rows, columns]
            for i in np.argsort(-np.abs(values), kind="stable"):
                lines.append(f"    C({names[rows[i]]}, {names[columns[i]]}) = {values[i]:+.4f}")
        if self.unknown:
            lines.append("[[Not identifiable]]")
            lines += [f"    {message}" for message in self.unknown]
        return "\n".join(lines)

    def curves(self):
        """Return measured and fitted data for a figure, a list of `Curve` and `MeasuredSpeed`.

        Both are classes of `gearlib.uncertainty.observation`.
        """
        curves = []
        for observation in self._observations:
            curves += observation.make_curves(observation.predicted_signals(self.model))
        return curves

    def dataset(self):
        """Return the fit as a dataset over its parameters, in their SI units.

        It has the fitted and initial values, standard errors, 95 % confidence intervals, ranges,
        correlations, and the statistics of the fit.
        """
        parameters = self.params.values()
        names = list(self.params)
        intervals = np.array([p.interval for p in parameters]).reshape(-1, 2)
        columns = {
            "fitted_value": [p.value for p in parameters],
            "stderr": [p.stderr for p in parameters],
            "interval_low": intervals[:, 0],
            "interval_high": intervals[:, 1],
            "range_low": [p.min for p in parameters],
            "range_high": [p.max for p in parameters],
            "initial_value": [p.init for p in parameters],
            "identifiable": np.array([p.identifiable for p in parameters]),
            "parameter_units": [self.model.settable[name][0] for name in names],
        }
        data = {
            **{name: ("parameter", values) for name, values in columns.items()},
            "correlation": (("parameter", "other_parameter"), self.correlations),
            **{name: ((), getattr(self, name)) for name in ("redchi", "aicc", "bic", "ndata")},
        }
        coords = {"parameter": names, "other_parameter": names}
        title, unknown = "Parameters of a gear mesh by a fit", list(self.unknown)
        return make_result(title, self.model, data, coords, method="least squares", unknown=unknown)


class FitProblem(NamedTuple):
    """Least-squares problem of a fit: residuals of observations as functions of free parameters.

    Free parameters are scaled to their ranges: 0 is the lower and 1 the upper limit.
    """

    model: Any
    names: tuple  #: names of the free parameters
    low: np.ndarray  #: their lower limits, SI units
    high: np.ndarray  #: their upper limits
    observations: list
    weights: Any = 1.0  #: factor of each residual, or a common factor

    @property
    def channels(self) -> list:
        """Return the channels of all observations, in the order of the residuals."""
        return [channel for observation in self.observations for channel in observation.channels]

    @property
    def size(self) -> int:
        """Return the number of residuals."""
        return sum(channel.values.size for channel in self.channels)

    @property
    def noise_known(self) -> bool:
        """Return whether the noise of all data is known."""
        return all(channel.noise_known for channel in self.channels)

    def model_at(self, scaled_values: np.ndarray) -> Any:
        """Return the model with the given free parameters, (k,), scaled to their ranges."""
        values = self.low + np.asarray(scaled_values) * (self.high - self.low)
        return self.model.with_values(dict(zip(self.names, map(float, values), strict=True)))

    def residuals(self, scaled_values: np.ndarray) -> np.ndarray | None:
        """Return the weighted residuals of all observations, (n,), or None if a run fails.

        `scaled_values`, (k,), are the free parameters, scaled from their ranges to 0 ... 1.
        """
        model = self.model_at(scaled_values)
        residual_blocks = []
        for observation in self.observations:
            residual_blocks.append(observation.residuals(model))
            if residual_blocks[-1] is None:
                return None
        return np.concatenate(residual_blocks) * self.weights


def fit(model, data, free):
    """Fit parameters of a model to measured data sets by least squares and return a `Fit`.

    Parameters
    ----------
    model : GearPair, OneDegreePair, SixDegreePair, GearTrain, ...
        Model of the rig. The fit starts from its values of the free parameters.
    data : xarray.Dataset or list of xarray.Dataset
        Data sets as `gearlib.read_measured` returns them: time histories of ``displacement`` at
        constant speed or in a run-up, whose speed course, rows (s, rpm), is ``known.course``;
        extrema, fractions of time and amplitudes of mesh orders, ``order_amplitude_1`` and so on,
        over ``speed`` and ``direction`` of slow sweeps; scalar speeds jump_up, jump_down and
        onset_of_contact_loss. Variables of trains end with the mesh, such as
        ``order_amplitude_1_sun_2`` or ``load_sharing_sun_2``.
    free : mapping
        Name of a free parameter, one of ``model.settable`` -> its bounds (lower, upper), SI units.

    Returns
    -------
    Fit
        Parameters with value, stderr and 95 % confidence interval; correlations, redchi, aicc,
        bic; and `unknown`, messages about parameters that the data do not determine and about data
        that the model does not describe. `str` returns a report.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.

    Warns
    -----
    UserWarning
        If revolutions of a run-up are left out because they have gaps or too few samples.
    """
    problem, initial_guess = _set_up_problem(model, data, free)
    for observation in problem.observations:
        if observation.warning:
            warnings.warn(observation.warning, stacklevel=2)
    residuals = problem.residuals(initial_guess)
    if residuals is None or not residuals @ residuals < _MAX_START_COST:
        raise ValueError(START_ERROR)
    problem, optimum = _solve(problem, initial_guess)
    return _summarize_fit(problem, optimum, *_extrapolated_jacobian(problem, optimum))


def _set_up_problem(model: Any, data: Any, free: Any) -> tuple[FitProblem, np.ndarray]:
    """Check the arguments of `fit`; return the `FitProblem` and its initial guess.

    `free` maps names of parameters to (lower, upper) limits in SI units. The guess, (k,), has the
    values of the model, scaled from these limits to 0 ... 1. Raise ValueError if an argument is
    invalid or there are fewer data than parameters.
    """
    checks.require(is_model(model), "model", model, "a model such as GearPair")
    if model.speed is None:
        kind = type(model).__name__
        raise ValueError(f"model of type {kind} is not allowed: it has no rotational speed")
    if model.mesh_names and model.reference_frequency is None:
        # Parameters must not change the reference frequency (mesh frequency at the tuning 1).
        frequency = float(model.mesh_frequency(1.0)) / math.tau  # Hz
        model = model.replace(reference_frequency=frequency)
    if not hasattr(free, "items") or not free:
        raise checks.InputError("free", free, "a mapping of parameters to (lowest, highest)")
    ranges = {}
    for name, limits in free.items():
        checks.check_choice("free", name, model.settable)
        argument = f"free[{name!r}]"
        lower, upper = parameters.check(argument, limits, Limits)
        value = model.value(name)
        checks.require(lower < upper, argument, limits, "increasing")
        allowed = f"a range that contains {name} = {value:g} of the model"
        checks.require(lower <= value <= upper, argument, limits, allowed)
        for limit in (lower, upper):  # the model raises ValueError if it does not allow a limit
            model.with_values({name: limit})
        ranges[name] = lower, upper
    low, high = np.array(list(ranges.values())).T
    problem = FitProblem(model, tuple(ranges), low, high, make_observations(model, data))
    if problem.size < len(ranges):
        raise ValueError(
            f"data is not allowed: it has {problem.size} observations for {len(ranges)} "
            "parameters, and must have at least as many observations as parameters"
        )
    initial_values = np.array([model.value(name) for name in ranges])
    return problem, (initial_values - low) / (high - low)


def _solve(problem: FitProblem, start: np.ndarray) -> tuple[FitProblem, Any]:
    """Solve a least-squares problem; data of unknown noise are reweighted by their residuals.

    `start` is the initial guess of the k free parameters, scaled from their ranges to 0 ... 1. The
    weight of a sensor of unknown noise follows from the residuals of the previous solution. Return
    the problem with its final weights and the result of `scipy.optimize.least_squares`.
    """
    optimum = _least_squares(problem, start)
    if not optimum.status:
        # The maximum number of evaluations was reached, usually near the optimum.
        optimum = _least_squares(problem, optimum.x)
    for _ in range(_MAX_WEIGHTINGS):
        weights = _channel_weights(problem, optimum.fun)
        if weights is None:
            break
        problem = problem._replace(weights=weights)
        earlier_evaluations = optimum.nfev
        optimum = _least_squares(problem, optimum.x)
        optimum.nfev += earlier_evaluations
    return problem, optimum


def _channel_weights(problem: FitProblem, residuals: np.ndarray) -> np.ndarray | None:
    """Return a weight for each residual, (n,), or None if all residuals may have the same weight.

    A channel has the measured values of one sensor; a group is a channel followed by the channels
    that share its weight. If the noise of a group is unknown and it has many residuals, its weight
    is the reciprocal of their root mean square, otherwise 1. `residuals`, (n,), include the current
    weights of the problem.
    """
    channels = problem.channels
    groups = np.cumsum([not channel.shares_weight for channel in channels])
    if groups[-1] < 2 or problem.noise_known:  # a common scale is sufficient
        return None
    residual_groups = np.repeat(groups, [channel.values.size for channel in channels])
    unweighted = residuals / problem.weights
    weights = np.ones(residuals.size)
    for channel, group in zip(channels, groups, strict=True):
        in_group = residual_groups == group
        has_many = in_group.sum() > _MIN_RESIDUALS_PER_PARAMETER * len(problem.names)
        # The first channel of a group determines whether its noise is known.
        if has_many and not channel.shares_weight and not channel.noise_known:
            rms = float(np.sqrt(np.mean(unweighted[in_group] ** 2)))
            weights[in_group] = 1.0 / max(rms, _MIN_NOISE)
    return weights


def _least_squares(problem: FitProblem, start: np.ndarray) -> Any:
    """Minimise the sum of squares of the weighted residuals of a problem.

    `start` is the initial guess of the k free parameters, scaled from their ranges to 0 ... 1.
    Return the result of `scipy.optimize.least_squares`.
    """

    def residuals(scaled_values):
        """Return the residuals, (n,), or a large number for each if a run of the model fails."""
        values = problem.residuals(scaled_values)
        return np.full(problem.size, _FAILED_RESIDUAL) if values is None else values

    def jacobian(scaled_values):
        """Return one-sided difference quotients of the residuals, (n, k).

        Columns are zero for parameters without effect on the residuals or if a run fails.
        """
        quotients = np.zeros((problem.size, start.size))
        old_residuals = residuals(scaled_values)
        for i, value in enumerate(scaled_values):
            # The step points away from the nearer limit, 0 or 1.
            step = _DIFFERENCE_STEP if value < 0.5 else -_DIFFERENCE_STEP
            new_residuals = problem.residuals(_replace_value(scaled_values, i, value + step))
            if new_residuals is not None:
                quotients[:, i] = (new_residuals - old_residuals) / step
        norms = np.linalg.norm(quotients, axis=0)
        quotients[:, norms < _MIN_RELATIVE_COLUMN_NORM * max(norms.max(), 1.0)] = 0.0
        return quotients

    def solve(start, **solver_options):
        """Call `scipy.optimize.least_squares` with `solver_options` as keyword arguments.

        The initial guess `start` is moved inside the limits 0 and 1, as the solver requires.
        """
        start = np.clip(start, 1e-6, 1.0 - 1e-6)
        solver_options = {"jac": jacobian, "bounds": (0.0, 1.0), "x_scale": 0.1, **solver_options}
        return least_squares(residuals, start, **solver_options)

    evaluations = 0
    if any(observation.kind == "branches" for observation in problem.observations):
        # Speeds beyond a fold of the model have large residuals without useful derivatives, so a
        # robust loss function is minimised first.
        scale = 1.0 if problem.noise_known else float(np.median(np.abs(residuals(start)))) or 1.0
        robust_solution = solve(start, loss="soft_l1", f_scale=scale, ftol=1e-4, max_nfev=30)
        start = robust_solution.x
        evaluations = robust_solution.nfev
    optimum = solve(start, ftol=1e-10, xtol=1e-10, gtol=1e-12, max_nfev=40)
    optimum.nfev += evaluations
    return optimum


def _replace_value(scaled_values: np.ndarray, i: int, value: float) -> np.ndarray:
    """Return a copy of the scaled parameters, (k,), with a new value of parameter `i`."""
    return np.where(np.arange(scaled_values.size) == i, value, scaled_values)


def _extrapolated_jacobian(problem: FitProblem, optimum: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return an accurate Jacobian matrix of the residuals at the optimum and its errors.

    Difference quotients are extrapolated to step 0. `optimum` is the result of
    `scipy.optimize.least_squares`. Jacobian and errors have the shape (residuals, parameters);
    parameters are scaled from their ranges to 0 ... 1.
    """
    jacobian = np.array(optimum.jac)
    errors = np.zeros(optimum.jac.shape)
    for i, best_value in enumerate(optimum.x):

        def residuals(value, i=i, best_value=best_value):
            """Return the residuals at a value of parameter i, or None if the step is too small.

            Over a tiny step the differences of settled runs are dominated by the settling error.
            """
            if value != best_value and abs(value - best_value) < _MIN_OPTIMUM_STEP:
                return None
            return problem.residuals(_replace_value(optimum.x, i, value))

        derivative, error = richardson_derivative(residuals, best_value, _MAX_OPTIMUM_STEP)
        if np.isfinite(derivative).all():  # otherwise the Jacobian matrix of scipy is kept
            jacobian[:, i], errors[:, i] = derivative, error
    return jacobian, errors


def _summarize_fit(
    problem: FitProblem, optimum: Any, jacobian: np.ndarray, errors: np.ndarray
) -> Fit:
    """Create the `Fit` at an optimum, a result of `scipy.optimize.least_squares`.

    `jacobian` and the `errors` of its elements have the shape (residuals, parameters scaled to 0
    ... 1). Confidence intervals of the identifiable parameters follow from the linearised model.
    """
    residuals = optimum.fun
    model = problem.model_at(optimum.x)
    # The residuals do not change along directions whose singular values are zero or smaller than
    # the errors of the Jacobian matrix.
    _, singular_values, directions = np.linalg.svd(jacobian, full_matrices=False)
    direction_errors = np.linalg.norm(errors @ np.abs(directions.T), axis=0)
    min_singular_value = _MIN_RELATIVE_SINGULAR_VALUE * max(singular_values.max(), 1.0)
    directions = directions[singular_values <= np.maximum(direction_errors, min_singular_value)]
    identifiable = (np.abs(directions) < _MAX_UNDETERMINED_COMPONENT).all(axis=0)
    n = residuals.size
    k = int(identifiable.sum())  # number of identifiable parameters
    eliminated_count = sum(channel.eliminated for channel in problem.channels)
    degrees_of_freedom = max(n - eliminated_count - k, 1)
    sum_of_squares = float(residuals @ residuals)
    redchi = sum_of_squares / degrees_of_freedom
    covariance = np.full((identifiable.size,) * 2, np.nan)
    if identifiable.any():
        columns = jacobian[:, identifiable]
        covariance[np.ix_(identifiable, identifiable)] = np.linalg.pinv(columns.T @ columns)
    covariance *= 1.0 if problem.noise_known else redchi
    scaled_errors = np.sqrt(np.diag(covariance))
    stderr = scaled_errors * (problem.high - problem.low)
    half_widths = stderr * float(student.ppf(0.975, degrees_of_freedom))
    values = [float(model.value(name)) for name in problem.names]
    initial_values = [float(problem.model.value(name)) for name in problem.names]
    params = {}
    for i, name in enumerate(problem.names):
        # The numbers are in the order of the fields of `Parameter`.
        numbers = values[i], stderr[i], half_widths[i], problem.low[i], problem.high[i]
        params[name] = Parameter(name, *numbers, initial_values[i], identifiable[i])
    messages = _parameter_messages(problem, model, params, directions)
    messages += _residual_messages(problem, model, residuals, k)
    # The information criteria count the variance of the noise as a parameter.
    k += 1
    deviance = n * math.log(max(sum_of_squares / n, 1e-300))
    deviance -= 2.0 * float(np.broadcast_to(np.log(problem.weights), n).sum())
    return Fit(
        model=model,
        params=params,
        correlations=covariance / np.outer(scaled_errors, scaled_errors),
        redchi=redchi,
        aicc=deviance + 2.0 * k + 2.0 * k * (k + 1) / max(n - k - 1, 1),
        bic=deviance + k * math.log(n),
        ndata=n,
        nfev=int(optimum.nfev),
        unknown=tuple(messages),
        noise=problem.noise_known,
        _observations=problem.observations,
    )


def _parameter_messages(problem, model, params, directions) -> list[str]:
    """Return messages about the parameters of a fitted model that the data do not determine.

    `problem` is the `FitProblem`, and `params` maps names to fitted `Parameter`s.
    `directions`, (m, k), are unit vectors in the space of the k scaled parameters along which the
    residuals do not change. If the backlash is undetermined, a lower bound is the largest
    displacement into the backlash in the motions of the model.
    """
    messages = []
    for i, (name, parameter) in enumerate(params.items()):
        if parameter.identifiable:
            if parameter.half_width > 0.5 * (parameter.max - parameter.min):
                messages.append(
                    f"{name} is poorly determined: its 95 % interval is as wide as its range, "
                    f"{parameter.min:g} to {parameter.max:g}"
                )
        elif name == "backlash":
            # At the largest backlash, coast-side contact restricts the excursion least.
            model = model.with_values({"backlash": problem.high[i]})
            predictions = [observation.predict(model) for observation in problem.observations]
            excursion = max(prediction.backlash_excursion for prediction in predictions)  # m
            reason = "the coast side is never in contact" if excursion else "contact is never lost"
            bound = "its size remains unknown"
            if excursion > problem.low[i]:
                bound = (
                    f"it is at least {excursion:.4g} m, the largest excursion into the backlash, "
                    "and no upper limit is known"
                )
            messages.append(f"backlash is not identifiable: {reason} in the compared data; {bound}")
        else:
            # Parameters are coupled if an undetermined direction involves both of them.
            is_involved = np.abs(directions) >= _MAX_UNDETERMINED_COMPONENT
            is_coupled = is_involved[is_involved[:, i]].any(axis=0)
            coupled = [other for j, other in enumerate(problem.names) if is_coupled[j] and j != i]
            reason = "nothing in the data depends on it"
            if coupled:
                reason = f"the data determine only a combination of it and {' and '.join(coupled)}"
            messages.append(f"{name} is not identifiable: {reason}")
    return messages


def _residual_messages(
    problem: FitProblem, model: Any, residuals: Any, free_count: int
) -> list[str]:
    """Return messages about data that the fitted model does not describe.

    Data of known noise must pass a chi-square test; for other data the model must explain half of
    the variance; and residuals must not be correlated. `residuals`, (n,), are the weighted
    residuals of the `problem`, and `free_count` is the number of identifiable parameters.
    """
    messages = []
    channels = problem.channels
    known_channels = [channel for channel in channels if channel.noise_known]
    sizes = [channel.values.size for channel in channels]
    has_known_noise = np.repeat([channel.noise_known for channel in channels], sizes)
    eliminated_count = sum(channel.eliminated for channel in known_channels)
    degrees_of_freedom = int(has_known_noise.sum()) - eliminated_count
    if problem.noise_known:  # otherwise other data may have determined the parameters
        degrees_of_freedom = max(degrees_of_freedom - free_count, 1)
    chi_square = float((residuals[has_known_noise] ** 2).sum())
    if known_channels and chi2.sf(chi_square, degrees_of_freedom) < _FALSE_ALARM_PROBABILITY:
        ratio = math.sqrt(chi_square / degrees_of_freedom)
        messages.append(
            f"the model does not describe the data: the residuals are {ratio:.3g} times as large "
            f"as the noise; a chi-square of {chi_square:.4g} with {degrees_of_freedom} degrees of "
            f"freedom has a probability below {_FALSE_ALARM_PROBABILITY:g}, and the confidence "
            "intervals are not valid"
        )
    for observation in problem.observations:
        if all(channel.noise_known for channel in observation.channels):
            continue
        signals = observation.predicted_signals(model)
        # The variance of a few jump speeds is meaningless, so only sequences are compared.
        fractions = [
            np.mean((signal - channel.values) ** 2) / np.var(channel.values)
            for channel, signal in zip(observation.channels, signals, strict=True)
            if channel.sequence_indices is not None and np.ptp(channel.values) > 0.0
        ]
        fraction = float(max(fractions, default=0.0))
        if fraction > _MAX_UNEXPLAINED_FRACTION:
            messages.append(
                f"the model does not describe the data: it leaves {100.0 * fraction:.0f} % of the "
                f"variance of the {observation.kind}, whose noise is not known, unexplained, and "
                "the confidence intervals are not valid"
            )
    return messages + residual_correlation_messages(channels, residuals / problem.weights)


def residual_correlation_messages(channels: list, residuals: np.ndarray) -> list[str]:
    """Return messages about sensors whose residuals change sign too rarely to be random.

    `channels` are `Channel`s, the measured values of one sensor each; `residuals`, (n,), are the
    unweighted residuals of all channels in this order. Successive independent residuals differ in
    sign with a probability of one half (Geary, Biometrika 57 (1970) 123-127).
    """
    ends = np.cumsum([channel.values.size for channel in channels])[:-1]
    sequences: dict = {}
    for channel, values in zip(channels, np.split(residuals, ends), strict=True):
        if channel.sequence_indices is not None:
            sequences.setdefault(channel.name, []).append(values[channel.sequence_indices])
    messages = []
    for name, blocks in sequences.items():
        # Sign changes and pairs of successive residuals in all sequences of this channel.
        changes = steps = 0
        for sequence in np.concatenate(blocks, axis=1):
            is_positive = sequence[np.abs(sequence) > _MIN_SIGNED_RESIDUAL] > 0.0
            changes += int((is_positive[1:] != is_positive[:-1]).sum())
            steps += max(is_positive.size - 1, 0)
        if binom.cdf(changes, steps, 0.5) < _FALSE_ALARM_PROBABILITY / len(sequences):
            messages.append(
                f"the residual of the {name.replace('_', ' ')} is not independent noise: it "
                f"changes sign {changes} times in {steps} steps, where {steps / 2:g} sign changes "
                "are expected, and the confidence intervals are not valid"
            )
    return messages
