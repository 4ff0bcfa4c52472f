"""The paper's analytic method: an integral equation, its kernel split after E. Schmidt.

With the periodic Green's function G of the mean-stiffness oscillator, on harmonics one over its
symbol 1 / nu^2 - k^2 + 2 i beta k / nu, the periodic problem is the equation

    x(tau) = int G(tau - sigma) [e(sigma) - n(sigma, x, x')] dsigma,

n all that this oscillator lacks: the variable part of the mesh stiffness, loss of contact, inverse
mesh, nonlinear damping. G = S + R, S of finite rank on the near-resonant harmonics, R the rest:

* the remainder x_R = R [e - n(x_S + x_R)] by successive approximations, the Neumann series of R;
* the degenerate part x_S from as many algebraic equations as S has terms, by Newton's method,
  whose derivative takes the same Neumann series for the share of x_R that follows x_S.

It converges where R n' contracts, which more degenerate terms bring about. Kernels are applied
by FFT: an iteration costs as little as samples times their logarithm, however many harmonics.

E. Schmidt, Math. Ann. 64 (1907) 161-174; Hortel, Skuderova (2007), references [1-4] there.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gearlib import checks
from gearlib.analysis.harmonics.equation import Force, from_real_parts, real_parts
from gearlib.analysis.harmonics.harmonic_balance import (
    check_problem,
    first_coefficients,
    resized,
    stages,
)
from gearlib.analysis.harmonics.solution import PeriodicSolution, hill_multipliers

#: Bound of the norm of the remainder that the automatic choice of degenerate terms keeps.
_MAX_NORM = 0.5
#: Successive approximations stop for a step of the algebraic system at this share of its residual.
_REMAINDER_SHARE = 0.01
#: Accuracy of the Neumann series in the derivative; more would only spare a step at the end.
_SERIES_TOLERANCE = 1e-6
_MAX_SERIES_TERMS, _MAX_HALVINGS = 200, 8
#: Growth of the motion over the static deflection that counts as divergence.
_DIVERGED = 1e6
#: Powers of the kernel from which its spectral radius is estimated.
_POWERS = 60


@dataclass(frozen=True)
class SchmidtSolution(PeriodicSolution):
    """Result of E. Schmidt's method: a periodic motion, or the last iterate."""

    converged: bool
    degenerate: tuple  #: harmonics of the degenerate part
    norm_bound: float  #: of the norm of the remainder, in mean squares, along the motion
    contraction: float  #: by which each iteration shrinks a deviation: spectral radius of R n'

    @property
    def status(self):
        """ "converged" or "diverged"."""
        return "converged" if self.converged else "diverged"

    @property
    def terms(self):
        """Real terms of the degenerate kernel: one for the mean, two for each harmonic."""
        return sum(1 if k == 0 else 2 for k in self.degenerate)

    def _facts(self):
        return {
            "converged": np.int8(self.converged),
            "degenerate": ("degenerate_harmonic", np.array(self.degenerate, np.int32)),
            "terms": np.int32(self.terms),
            "norm_bound": self.norm_bound,
            "contraction": self.contraction,
        }


def schmidt(
    pair,
    tuning,
    *,
    degenerate="auto",
    harmonics=1024,
    samples=None,
    tolerance=1e-10,
    max_iterations=2000,
    guess=None,
    period=1,
):
    """Find a periodic motion by E. Schmidt's splitting of the integral equation's kernel.

    Parameters
    ----------
    pair : GearPair or OneDegreePair
    tuning : float
        nu.
    degenerate : "auto", int or sequence of int
        Harmonics of the degenerate part, in units of 1 / period: their list; or how many, the
        nearest to resonance (of the largest kernel) first; or as many as keep the bound of the
        remainder's norm along the motion below 0.5.
    harmonics : int, default 1024
        Harmonics of the kernel kept.
    samples : int, optional
        As of `gearlib.harmonic_balance`.
    tolerance : float, default 1e-10
        Last correction, static deflections (root of the mean square over the period).
    max_iterations : int, default 2000
        Applications of the kernel after which the search has diverged.
    guess : PeriodicSolution or array_like of float, optional
        As of `gearlib.harmonic_balance`.
    period : int, default 1
        Mesh periods after which the motion repeats.

    Returns
    -------
    SchmidtSolution
        Its ``status`` says whether the iteration converged; if not, it is the last iterate.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    """
    equation = check_problem(pair, tuning, harmonics, samples, period)
    tolerance = checks.finite_positive("tolerance", tolerance)
    max_iterations = checks.integer("max_iterations", max_iterations, 1)
    terms = degenerate_harmonics(equation, degenerate)
    automatic = isinstance(degenerate, str)
    coefficients = first_coefficients(equation, guess)
    count, evaluations = 0, 0
    for stage, accuracy in stages(equation, guess, tolerance):
        first, left = resized(coefficients, stage), max_iterations - count
        resolved = terms[terms <= stage.harmonics]
        coefficients, more, converged, applications = search(
            stage, first, resolved, automatic, accuracy, left
        )
        terms = np.union1d(terms, more)
        count, evaluations = count + applications, evaluations + applications * stage.samples
    return _solution(equation, coefficients, terms, converged, count, evaluations)


def search(equation, coefficients, degenerate, automatic, tolerance, max_applications):
    """Return (coefficients, degenerate, whether they converged, applications of the kernel).

    If the choice is `automatic`, harmonics become degenerate as the motion asks.
    """
    count, steps = 0, iterate(equation, coefficients, degenerate, tolerance)
    while count < max_applications:
        step = next(steps)
        coefficients, count = step.coefficients, count + step.applications
        if not _norm(coefficients) < _DIVERGED:
            break
        more = _resonant(equation, step.force) if automatic else degenerate
        if np.setdiff1d(more, degenerate).size:
            degenerate = np.union1d(degenerate, more)
            steps = iterate(equation, coefficients, degenerate, tolerance)
        elif step.correction <= tolerance and step.algebraic <= tolerance:
            return coefficients, degenerate, True, count
    return coefficients, degenerate, False, count


class Iterate(NamedTuple):
    """A step of the method."""

    coefficients: np.ndarray  #: after the step
    force: Force  #: before it
    correction: float  #: of the remainder, static deflections
    algebraic: float  #: last step of the degenerate part, static deflections
    applications: int  #: of the kernel in this step


def iterate(equation, coefficients, degenerate, tolerance):
    """Yield the steps of the method from first coefficients, without end; see `Iterate`."""
    gain = _remainder_gain(equation, degenerate)
    algebraic = np.inf if len(degenerate) else 0.0
    # The last step of the degenerate part: from where, and the residual that it left.
    base, step, least, halvings = coefficients, np.zeros_like(coefficients), np.inf, 0
    cost = 0
    while True:
        force = equation.force(coefficients)
        balance = equation.excitation - _missing(equation, coefficients, force.value)
        residual = _norm((equation.symbol * coefficients - balance)[degenerate]) / equation.unit
        new = gain * balance
        new[degenerate] = coefficients[degenerate]
        correction, coefficients = _norm(new - coefficients), new
        yield Iterate(coefficients, force, correction, algebraic, cost + 1)
        cost = 0
        if not len(degenerate) or correction > max(tolerance, _REMAINDER_SHARE * residual):
            continue
        if residual > least and halvings < _MAX_HALVINGS:
            step, halvings = 0.5 * step, halvings + 1
        else:
            base, least, halvings = coefficients, residual, 0
            step, cost = _algebraic_step(equation, base, degenerate, gain)
        coefficients, algebraic = base + step, _norm(step)


def _remainder_gain(equation, degenerate):
    """Return the kernel of the remainder on the harmonics: 0 on the degenerate ones."""
    gain = np.zeros(equation.harmonics + 1, complex)
    remainder = np.delete(np.arange(gain.size), degenerate)
    gain[remainder] = 1.0 / equation.symbol[remainder]
    return gain


def _algebraic_step(equation, coefficients, degenerate, gain):
    """Return Newton's step of the degenerate part with the remainder that follows, and its cost."""
    force = equation.force(coefficients)
    residual = equation.residual(coefficients, force)
    # Unit changes of the real parts, and of the imaginary parts but that of the mean.
    unknowns = np.concatenate([degenerate, equation.harmonics + degenerate[degenerate > 0]])
    units = np.zeros((unknowns.size, 2 * equation.harmonics + 1))
    units[np.arange(unknowns.size), unknowns] = 1.0
    units = from_real_parts(units)
    follow, terms = np.zeros_like(units), 0
    while terms < _MAX_SERIES_TERMS:
        # Neumann's series of (1 + R n')^-1, summed as successive approximations.
        new = -gain * _missing_change(equation, force, units + follow)
        change = np.abs(new - follow).max()
        follow, terms = new, terms + 1
        if not _SERIES_TOLERANCE < change < _DIVERGED:
            break
    whole = units + follow
    effect = equation.symbol * whole + _missing_change(equation, force, whole)
    matrix = real_parts(effect)[:, unknowns].T
    share, *_ = np.linalg.lstsq(matrix, -real_parts(residual)[unknowns], rcond=None)
    return share @ whole, 1 + (terms + 1) * len(units)


def _missing(equation, coefficients, force):
    """Return n, the force that the mean-stiffness oscillator lacks, on the harmonics."""
    linear = (equation.unit + 1j * equation.rate * equation.orders) * coefficients
    return equation.to_harmonics(force) - linear


def _missing_change(equation, force, changes):
    """Return the change of n by changes of the harmonics, shape (m, harmonics + 1)."""
    x, v = equation.motion(changes)
    by_displacement = force.slope + force.impulse
    return _missing(equation, changes, by_displacement * x + force.by_velocity * v)


def contraction(equation, coefficients, degenerate):
    """Return the spectral radius of R n' along a motion: below 1 the method converges there.

    By 60 powers from a fixed start, of which the last 20 count: good to about a percent.
    """
    force, gain = equation.force(coefficients), _remainder_gain(equation, degenerate)
    change = np.where(np.arange(gain.size) % 2, 1.0, 0.7 + 0.4j) * np.abs(gain)
    change[0] = abs(change[0])
    sizes = []
    for _ in range(_POWERS):
        size = _norm(change)
        sizes.append(size)
        if size == 0.0:
            return 0.0
        change = gain * _missing_change(equation, force, change / size)
    return float(np.exp(np.mean(np.log(sizes[-(_POWERS // 3) :]))))


def degenerate_harmonics(equation, degenerate):
    """Return the harmonics that an argument `degenerate` means, rising, else ValueError."""
    if isinstance(degenerate, str):
        checks.one_of("degenerate", degenerate, ("auto",))
        return _resonant(equation, equation.force(first_coefficients(equation, None)))
    if np.ndim(degenerate) == 0:
        count = checks.integer("degenerate", degenerate, 0, equation.harmonics + 1)
        return np.sort(np.argsort(np.abs(equation.symbol), kind="stable")[:count])
    listed = [checks.integer("degenerate", k, 0, equation.harmonics) for k in degenerate]
    return np.unique(np.array(listed, int))


def _resonant(equation, force):
    """Return the harmonics on which the kernel may enlarge a deviation too much."""
    return np.flatnonzero(equation.weights(force) > _MAX_NORM)


def _norm(coefficients):
    """Return the root of the mean square over the period."""
    squares = np.abs(coefficients) ** 2
    return float(np.sqrt(2.0 * squares.sum() - squares[:1].sum()))


def _solution(equation, coefficients, degenerate, converged, iterations, evaluations):
    """Return the `SchmidtSolution` where a search ended; without numbers if it has diverged."""
    force = equation.force(coefficients)
    multipliers, norm_bound, factor = np.full(2, np.nan, complex), np.nan, np.nan
    if _norm(coefficients) < _DIVERGED:
        multipliers = hill_multipliers(equation, coefficients)
        # Below 1 the Neumann series of the remainder converges.
        norm_bound = float(np.delete(equation.weights(force), degenerate).max(initial=0.0))
        factor = contraction(equation, coefficients, degenerate)
    return SchmidtSolution(
        equation.pair,
        equation.tuning,
        equation.period,
        "schmidt",
        coefficients,
        equation.samples,
        equation.size(equation.residual(coefficients, force)),
        iterations,
        evaluations,
        multipliers,
        converged,
        tuple(int(k) for k in degenerate),
        norm_bound,
        factor,
    )
