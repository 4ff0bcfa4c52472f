"""The result of a fit: values, intervals, and in words what the data cannot tell."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binom
from scipy.stats import t as student

from gearlib.data.result import result

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


def report(problem: Any, best: Any, jacobian: np.ndarray, errors: np.ndarray) -> Fit:
    """Return the `Fit` at the best point of a `gearlib.uncertainty.fits.Problem`.

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
