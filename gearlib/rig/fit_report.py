"""Values and intervals of a fit, and a report in the words of lmfit."""

from dataclasses import dataclass
from typing import Any

import numpy as np

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
    unknown: tuple  #: sentences: what the data cannot tell
    _problem: Any

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
        names, known = list(self.params), self.model.settable
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
            **{name: ((), getattr(self, name)) for name in ("redchi", "aicc", "bic", "ndata")},
        }
        coords = {"parameter": names, "other_parameter": names}
        title = "Parameters of a gear mesh by a fit"
        more = {"unknown": list(self.unknown)}
        return result(title, self.model, data, coords, method="least squares", **more)
