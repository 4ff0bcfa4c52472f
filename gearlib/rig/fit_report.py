"""What a fit came to: values, intervals, profiles, and a report in the words of lmfit."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from gearlib import checks
from gearlib.data.result import result


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
    def interval(self):
        """Lowest and highest value of the interval of 95 %."""
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
    waterfall: np.ndarray  #: sums of squares that the improved starts came to, rising
    starts: np.ndarray  #: sums of squares at all starts; the first is that of the model given
    unknown: tuple  #: sentences: what the data cannot tell
    _problem: Any
    _share: Any

    @property
    def noise(self):
        """Whether the noise of all data is known."""
        return self._problem.noise

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
        for one in self.params.values():
            share = abs(100.0 * one.stderr / one.value) if one.value else np.inf
            known = f"+/- {one.stderr:.4g} ({share:.2f}%)" if one.identifiable else "not known"
            lines.append(f"    {one.name}: {one.value:.8g} {known} (init = {one.init:.6g})")
        names, pairs = list(self.params), []
        for i in range(len(names)):
            for j in range(i + 1, len(names)):
                if abs(self.correlations[i, j]) > 0.1:
                    pairs.append((names[i], names[j], self.correlations[i, j]))
        if pairs:
            lines.append("[[Correlations]] (unreported correlations are < 0.100)")
            for a, b, value in sorted(pairs, key=lambda one: -abs(one[2])):
                lines.append(f"    C({a}, {b}) = {value:+.4f}")
        if self.unknown:
            lines.append("[[Not identifiable]]")
            lines += [f"    {one}" for one in self.unknown]
        return "\n".join(lines)

    def curves(self):
        """Return what was compared, each a `Curve` or `Place` of `gearlib.rig.fitted_curves`."""
        return [one for each in self._problem.observations for one in each.curves(self.model)]

    def dataset(self):
        """Return the fit as a dataset over its parameters, in their SI units."""
        rows = self.params.values()
        names, known = list(self.params), self.model.derivatives
        ends = np.array([one.interval for one in rows]).reshape(-1, 2)
        data = {
            "fitted_value": ("parameter", [one.value for one in rows]),
            "stderr": ("parameter", [one.stderr for one in rows]),
            "interval_low": ("parameter", ends[:, 0]),
            "interval_high": ("parameter", ends[:, 1]),
            "range_low": ("parameter", [one.min for one in rows]),
            "range_high": ("parameter", [one.max for one in rows]),
            "initial_value": ("parameter", [one.init for one in rows]),
            "identifiable": ("parameter", np.array([one.identifiable for one in rows])),
            "parameter_units": ("parameter", [known[name][0] for name in names]),
            "correlation": (("parameter", "other_parameter"), self.correlations),
            "start_cost": ("start", self.starts),
            "improved_cost": ("improved", self.waterfall),
            **{name: ((), getattr(self, name)) for name in ("redchi", "aicc", "bic", "ndata")},
        }
        coords = {"parameter": names, "other_parameter": names}
        title = "Parameters of a gear mesh by a fit"
        more = {"unknown": list(self.unknown)}
        return result(title, self.model, data, coords, method="least squares", **more)

    def profile(self, name, values):
        """Return the profile of a parameter: -2 ln of the ratio to the largest likelihood.

        Parameters
        ----------
        name : str
        values : sequence of float
            At which the parameter is held, while all others are fitted again.

        Returns
        -------
        ndarray, shape of values
            Above 3.84 a value lies outside the interval of 95 %; a profile that stays below
            on one side or on both tells nothing there.

        Raises
        ------
        ValueError
            If there is no such parameter, or a value lies outside its range.
        """
        checks.one_of("name", name, tuple(self.params))
        problem, i = self._problem, list(self.params).index(name)
        rest = problem.residuals(self._share)[0]
        least, found = float(rest @ rest), []
        others = [j for j in range(len(self.params)) if j != i]
        for value in checks.finite("values", values):
            share = (value - problem.low[i]) / (problem.high[i] - problem.low[i])
            checks.require(0.0 <= share <= 1.0, "values", value, "within the range of the fit")
            fixed = self._share.copy()
            fixed[i] = share
            found.append(self._refitted(fixed, others) - least)
        return np.array(found) / (1.0 if problem.noise else self.redchi)

    def _refitted(self, fixed, others):
        def residuals(part):
            whole = fixed.copy()
            whole[others] = part
            return self._problem.residuals(whole)

        if not others:
            rest = residuals([])[0]
            return float(rest @ rest)
        best = least_squares(
            lambda part: residuals(part)[0],
            np.clip(fixed[others], 1e-9, 1.0 - 1e-9),
            jac=lambda part: residuals(part)[1][:, others],
            bounds=(0.0, 1.0),
            x_scale=0.1,
            max_nfev=30,
        )
        return 2.0 * float(best.cost)
