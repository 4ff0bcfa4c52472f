"""`schmidt`: the paper's analytic method, an integral equation with its kernel split.

With the periodic Green's function G of the mean-stiffness oscillator, on harmonics one over its
symbol 1 / nu^2 - k^2 + 2 i beta k / nu, the periodic problem is the equation

    x(tau) = int G(tau - sigma) [e(sigma) - n(sigma, x, x')] dsigma,

where n is the force that this oscillator lacks: the variable part of the mesh stiffness, loss of
contact, inverse mesh, nonlinear damping. G = S + R, S of finite rank on the near-resonant
harmonics, R the remainder:

* the remainder x_R = R [e - n(x_S + x_R)] by successive approximations, the Neumann series of R;
* the degenerate part x_S from as many algebraic equations as S has terms, by Newton's method,
  whose derivative takes the same Neumann series for the share of x_R that follows x_S.

It converges where R n' contracts, which more degenerate terms bring about. Kernels are applied
by FFT: an iteration costs as little as samples times their logarithm, however many harmonics.

E. Schmidt, Math. Ann. 64 (1907) 161-174; Hortel, Skuderova (2007), references [1-4] there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gearlib import checks
from gearlib.analysis.harmonics.equation import Force, MeshEquation, from_real_parts, real_parts
from gearlib.analysis.harmonics.harmonic_balance import (
    check_problem,
    first_coefficients,
    resized,
    stages,
)
from gearlib.analysis.harmonics.solution import PeriodicSolution, hill_multipliers

#: Largest bound of the norm of the remainder that the automatic choice of harmonics leaves.
_MAX_NORM = 0.5
#: Correction of the remainder, as a share of the algebraic residual, after which the algebraic
#: system takes a step.
_REMAINDER_SHARE = 0.01
#: Accuracy of the Neumann series in the derivative; more would only spare a step at the end.
_SERIES_TOLERANCE = 1e-6
_MAX_SERIES_TERMS, _MAX_HALVINGS = 200, 8
#: Size of the motion, in static deflections, from which on the iteration has diverged.
_MAX_SIZE = 1e6
#: Powers of the kernel from which its spectral radius is estimated.
_POWERS = 60


@dataclass(frozen=True)
class SchmidtSolution(PeriodicSolution):
    """Result of E. Schmidt's method: a periodic motion, or the last iterate."""

    converged: bool
    degenerate: tuple  #: harmonics of the degenerate part
    norm_bound: float  #: bound of the remainder's norm, in mean squares, along the motion
    contraction: float  #: factor of a deviation in each iteration: spectral radius of R n'

    @property
    def status(self) -> str:
        """ "converged" or "diverged"."""
        return "converged" if self.converged else "diverged"

    @property
    def terms(self) -> int:
        """Real terms of the degenerate kernel: one for the mean, two for each harmonic."""
        return sum(1 if k == 0 else 2 for k in self.degenerate)

    def _method_variables(self) -> dict:
        """Return the variables that this method adds to the dataset of a motion."""
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
        Mesh frequency over mean eigenfrequency, nu.
    degenerate : "auto", int or sequence of int
        Harmonics of the degenerate part, in units of 1 / period: their list; or how many, the
        nearest to resonance (of the largest kernel) first; or as many as keep the bound of the
        remainder's norm along the motion below 0.5.
    harmonics : int, default 1024
        Harmonics of the kernel kept.
    samples : int, optional
        Grid points over the period, as in `gearlib.harmonic_balance`.
    tolerance : float, default 1e-10
        Last correction, static deflections (root of the mean square over the period).
    max_iterations : int, default 2000
        Applications of the kernel after which the search has diverged.
    guess : PeriodicSolution or array_like of float, optional
        First iterate, as in `gearlib.harmonic_balance`.
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
    iterations, evaluations = 0, 0
    for stage, accuracy in stages(equation, guess, tolerance):
        coefficients, new_terms, converged, applications = search(
            stage,
            resized(coefficients, stage),
            terms[terms <= stage.harmonics],
            automatic,
            accuracy,
            max_iterations - iterations,
        )
        terms = np.union1d(terms, new_terms)
        iterations += applications
        evaluations += applications * stage.samples
    return _solution(equation, coefficients, terms, converged, iterations, evaluations)


def search(
    equation: MeshEquation,
    coefficients: np.ndarray,
    degenerate: np.ndarray,
    automatic: bool,
    tolerance: float,
    max_applications: int,
) -> tuple:
    """Iterate from complex harmonics 0 ... h until both parts of the motion converge.

    `degenerate` are the numbers of the degenerate harmonics; if their choice is `automatic`,
    further ones are added where the motion needs them. Return (harmonics of the motion, degenerate
    harmonics, whether the iteration converged, applications of the kernel).
    """
    count, steps = 0, iterate(equation, coefficients, degenerate, tolerance)
    while count < max_applications:
        step = next(steps)
        coefficients = step.coefficients
        count += step.applications
        if not _norm(coefficients) < _MAX_SIZE:
            break
        resonant = _resonant(equation, step.force) if automatic else degenerate
        if np.setdiff1d(resonant, degenerate).size:
            degenerate = np.union1d(degenerate, resonant)
            steps = iterate(equation, coefficients, degenerate, tolerance)
        elif step.correction <= tolerance and step.algebraic <= tolerance:
            return coefficients, degenerate, True, count
    return coefficients, degenerate, False, count


class Iterate(NamedTuple):
    """One step of the iteration."""

    coefficients: np.ndarray  #: harmonics after the step
    force: Force  #: force before the step
    correction: float  #: size of the change of the remainder, static deflections
    algebraic: float  #: size of the last step of the degenerate part, static deflections
    applications: int  #: applications of the kernel in this step


def iterate(
    equation: MeshEquation, coefficients: np.ndarray, degenerate: np.ndarray, tolerance: float
) -> Iterator[Iterate]:
    """Yield `Iterate` after `Iterate` from complex harmonics 0 ... h on, without end.

    The remainder is corrected until its change is below `tolerance` or small beside the residual
    of the `degenerate` harmonics; then these take a Newton step, halved if it did not help.
    """
    gain = _remainder_gain(equation, degenerate)
    algebraic = np.inf if len(degenerate) else 0.0
    # Harmonics before the last step of the degenerate part, this step, the residual before it.
    base, step, base_residual = coefficients, np.zeros_like(coefficients), np.inf
    halvings = applications = 0
    while True:
        force = equation.force(coefficients)
        balance = equation.excitation - _lacking_force(equation, coefficients, force.value)
        algebraic_residual = (equation.symbol * coefficients - balance)[degenerate]
        residual = _norm(algebraic_residual) / equation.mean_stiffness
        new = gain * balance
        new[degenerate] = coefficients[degenerate]
        correction, coefficients = _norm(new - coefficients), new
        yield Iterate(coefficients, force, correction, algebraic, applications + 1)
        applications = 0
        if not len(degenerate) or correction > max(tolerance, _REMAINDER_SHARE * residual):
            continue
        if residual > base_residual and halvings < _MAX_HALVINGS:
            step, halvings = 0.5 * step, halvings + 1
        else:
            base, base_residual, halvings = coefficients, residual, 0
            step, applications = _algebraic_step(equation, base, degenerate, gain)
        coefficients, algebraic = base + step, _norm(step)


def _remainder_gain(equation: MeshEquation, degenerate: np.ndarray) -> np.ndarray:
    """Return the kernel of the remainder R on harmonics 0 ... h: 0 on the degenerate ones."""
    gain = np.zeros(equation.harmonics + 1, complex)
    remainder = np.delete(np.arange(gain.size), degenerate)
    gain[remainder] = 1.0 / equation.symbol[remainder]
    return gain


def _algebraic_step(
    equation: MeshEquation, coefficients: np.ndarray, degenerate: np.ndarray, gain: np.ndarray
) -> tuple[np.ndarray, int]:
    """Return (Newton step of harmonics 0 ... h, applications of the kernel).

    The step solves the equations of the `degenerate` harmonics; the others, with the kernel `gain`
    of the remainder, follow their changes.
    """
    force = equation.force(coefficients)
    residual = equation.residual(coefficients, force)
    # Changes of one real or imaginary part each; the mean has no imaginary part.
    unknowns = np.concatenate([degenerate, equation.harmonics + degenerate[degenerate > 0]])
    real_changes = np.zeros((unknowns.size, 2 * equation.harmonics + 1))
    real_changes[np.arange(unknowns.size), unknowns] = 1.0
    degenerate_changes = from_real_parts(real_changes)
    remainder, terms = np.zeros_like(degenerate_changes), 0
    while terms < _MAX_SERIES_TERMS:
        # Neumann series of (1 + R n')^-1, summed as successive approximations.
        new = -gain * _lacking_force_change(equation, force, degenerate_changes + remainder)
        change = np.abs(new - remainder).max()
        remainder, terms = new, terms + 1
        if not _SERIES_TOLERANCE < change < _MAX_SIZE:
            break
    directions = degenerate_changes + remainder
    effect = equation.symbol * directions + _lacking_force_change(equation, force, directions)
    matrix = real_parts(effect)[:, unknowns].T
    step = np.linalg.lstsq(matrix, -real_parts(residual)[unknowns], rcond=None)[0]
    return step @ directions, 1 + (terms + 1) * len(directions)


def _lacking_force(
    equation: MeshEquation, coefficients: np.ndarray, force: np.ndarray
) -> np.ndarray:
    """Return harmonics 0 ... h of n, the force that the mean-stiffness oscillator lacks.

    `force` is the force on the grid of phases, `coefficients` are the harmonics of the motion.
    """
    linear = (equation.mean_stiffness + 1j * equation.damping * equation.orders) * coefficients
    return equation.to_harmonics(force) - linear


def _lacking_force_change(equation: MeshEquation, force: Force, changes: np.ndarray) -> np.ndarray:
    """Return the changes of `_lacking_force` by m changes of the motion, both shape (m, h + 1).

    `force` is the force along the motion with its derivatives.
    """
    x, v = equation.motion(changes)
    by_displacement = force.slope + force.impulse
    return _lacking_force(equation, changes, by_displacement * x + force.by_velocity * v)


def contraction(equation: MeshEquation, coefficients: np.ndarray, degenerate: np.ndarray) -> float:
    """Return the spectral radius of R n' along a motion: below 1 Schmidt's method converges there.

    `coefficients` are the harmonics of the motion, `degenerate` the numbers of the harmonics that
    R leaves out. Power iteration from a fixed start estimates it to about a percent.
    """
    force, gain = equation.force(coefficients), _remainder_gain(equation, degenerate)
    # The start has a share of every harmonic, and a real mean.
    change = np.where(np.arange(gain.size) % 2, 1.0, 0.7 + 0.4j) * np.abs(gain)
    change[0] = abs(change[0])
    sizes = []
    for _ in range(_POWERS):
        size = _norm(change)
        sizes.append(size)
        if size == 0.0:
            return 0.0
        change = gain * _lacking_force_change(equation, force, change / size)
    return float(np.exp(np.mean(np.log(sizes[-(_POWERS // 3) :]))))


def degenerate_harmonics(equation: MeshEquation, degenerate: Any) -> np.ndarray:
    """Return the rising harmonics that the argument `degenerate` of `schmidt` selects.

    They are a list of harmonics, a number of harmonics nearest to resonance, or "auto".
    """
    if isinstance(degenerate, str):
        checks.one_of("degenerate", degenerate, ("auto",))
        return _resonant(equation, equation.force(first_coefficients(equation, None)))
    if np.ndim(degenerate) == 0:
        count = checks.integer("degenerate", degenerate, 0, equation.harmonics + 1)
        return np.sort(np.argsort(np.abs(equation.symbol), kind="stable")[:count])
    harmonics = [checks.integer("degenerate", k, 0, equation.harmonics) for k in degenerate]
    return np.unique(np.array(harmonics, int))


def _resonant(equation: MeshEquation, force: Force) -> np.ndarray:
    """Return the numbers of the harmonics on which the kernel may enlarge a deviation too much."""
    return np.flatnonzero(equation.weights(force) > _MAX_NORM)


def _norm(coefficients: np.ndarray) -> float:
    """Return the root mean square over the period of a motion given by its harmonics."""
    squares = np.abs(coefficients) ** 2
    # Harmonics above the mean stand for their conjugates, too.
    return float(np.sqrt(2.0 * squares.sum() - squares[:1].sum()))


def _solution(
    equation: MeshEquation,
    coefficients: np.ndarray,
    degenerate: np.ndarray,
    converged: bool,
    iterations: int,
    evaluations: int,
) -> SchmidtSolution:
    """Return the `SchmidtSolution` at the end of a search; multipliers are NaN if it diverged."""
    force = equation.force(coefficients)
    multipliers, norm_bound, factor = np.full(2, np.nan, complex), np.nan, np.nan
    if _norm(coefficients) < _MAX_SIZE:
        multipliers = hill_multipliers(equation, coefficients)
        # Below 1 the Neumann series of the remainder converges.
        norm_bound = float(np.delete(equation.weights(force), degenerate).max(initial=0.0))
        factor = contraction(equation, coefficients, degenerate)
    return SchmidtSolution(
        equation.model,
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
