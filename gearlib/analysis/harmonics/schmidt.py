"""`schmidt`: the paper's analytic method, which splits the kernel of an integral equation.

Let G be the periodic Green's function of the oscillator with the mean stiffness. Its Fourier
coefficients are 1 / (1 / nu^2 - k^2 + 2 i beta k / nu), and periodic motions obey

    x(tau) = int G(tau - sigma) [e(sigma) - n(sigma, x, x')] dsigma.

The excess force n is the mesh force minus the force of the oscillator. It results from the variable
part of the mesh stiffness, loss of contact, coast-side contact and nonlinear damping. The kernel is
split into G = S + R, with the degenerate kernel S on the near-resonant harmonics and the remainder
R:

* the remainder of the motion, x_R = R [e - n(x_S + x_R)], is found by successive approximations,
  the Neumann series of R;
* the degenerate part x_S is found from as many algebraic equations as S has terms, by Newton's
  method. Their Jacobian matrix uses the same Neumann series for the dependence of x_R on x_S.

The method converges if R n' is a contraction, which more degenerate harmonics can achieve.
Kernels are applied by FFT, so that an iteration takes O(samples log samples) operations.

E. Schmidt, Math. Ann. 64 (1907) 161-174; Hortel, Skuderova (2007), references [1-4] there.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Real
from typing import Annotated, Any, NamedTuple

import numpy as np

from gearlib import checks, parameters
from gearlib.analysis.harmonics.equation import Force, MeshEquation, from_real_vector, real_vector
from gearlib.analysis.harmonics.harmonic_balance import (
    continuation_sequence,
    create_equation,
    initial_coefficients,
    resize_harmonics,
)
from gearlib.analysis.harmonics.solution import PeriodicSolution, hill_multipliers
from gearlib.parameters import Count, Positive, Values, WholeNumber, checked
from gearlib.runs.run_arguments import Tuning

#: With degenerate = "auto", harmonics with a larger amplification bound become degenerate.
_MAX_NORM = 0.5
#: A Newton step is taken when the correction of the remainder, relative to the residual of the
#: algebraic equations, is below this.
_REMAINDER_TOLERANCE = 0.01
#: Relative accuracy of the Neumann series in the Jacobian matrix.
_SERIES_TOLERANCE = 1e-6
_MAX_SERIES_TERMS, _MAX_HALVINGS = 200, 8
#: The iteration has diverged if the root mean square of the motion, in units of the static
#: deflection, exceeds this.
_MAX_RMS = 1e6
#: Number of steps of the power iteration for the spectral radius.
_POWER_STEPS = 60


@dataclass(frozen=True)
class SchmidtSolution(PeriodicSolution):
    """Result of E. Schmidt's method: a periodic motion, or the last iterate after divergence."""

    converged: bool
    degenerate: tuple  #: numbers of the harmonics of the degenerate part
    norm_bound: float  #: upper bound of the norm (mean square) of R n' along the motion
    contraction: float  #: spectral radius of R n', by which each iteration multiplies the error

    @property
    def status(self) -> str:
        """ "converged" or "diverged"."""
        return "converged" if self.converged else "diverged"

    @property
    def terms(self) -> int:
        """Number of real unknowns of the degenerate part: one for the mean, two per harmonic."""
        return sum(1 if k == 0 else 2 for k in self.degenerate)

    def _method_variables(self) -> dict:
        """Return the dataset variables specific to this method, {name: value or (dims, values)}.

        Degenerate harmonics are found by Newton's method, all others by successive approximations.
        """
        return {
            "converged": np.int8(self.converged),
            "degenerate": ("degenerate_harmonic", np.array(self.degenerate, np.int32)),
            "terms": np.int32(self.terms),
            # An upper bound and an estimate of the factor by which an iteration multiplies errors.
            "norm_bound": self.norm_bound,
            "contraction": self.contraction,
        }


@checked
def schmidt(
    model,
    tuning: Tuning,
    *,
    degenerate="auto",
    harmonics: Count = 1024,
    samples: Count | None = None,
    tolerance: Positive = 1e-10,
    max_iterations: Count = 2000,
    guess=None,
    period: Count = 1,
):
    """Find a periodic motion by E. Schmidt's method, from an integral equation with split kernel.

    Parameters
    ----------
    model : GearPair or OneDegreePair
    tuning : float
        Ratio of mesh frequency to mean eigenfrequency, nu.
    degenerate : "auto", int or sequence of int
        Harmonics of the degenerate kernel, in units of 1 / period: a list; or their number, which
        selects the harmonics nearest to resonance; or "auto" for as many as needed to keep the
        bound of the norm of the remainder along the motion below 0.5.
    harmonics : int, default 1024
        Highest harmonic of the kernel.
    samples : int, optional
        Number of grid points over the period, as in `gearlib.harmonic_balance`.
    tolerance : float, default 1e-10
        Largest correction in the last iteration, in units of the static deflection (root mean
        square over the period).
    max_iterations : int, default 2000
        Number of applications of the kernel after which the iteration is considered divergent.
    guess : PeriodicSolution or array_like of float, optional
        Initial guess, as in `gearlib.harmonic_balance`.
    period : int, default 1
        Number of mesh periods after which the motion repeats.

    Returns
    -------
    SchmidtSolution
        The motion. Its ``status`` states whether the iteration converged; if it did not, the motion
        is the last iterate.

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.
    """
    equation = create_equation(model, tuning, harmonics, samples, period)
    selected = degenerate_harmonics(equation, degenerate)
    coefficients = initial_coefficients(equation, guess)
    iterations, evaluations = 0, 0
    for current_equation, max_correction in continuation_sequence(equation, guess, tolerance):
        coefficients, new_selected, converged, applications = iterate_until_converged(
            current_equation,
            resize_harmonics(coefficients, current_equation),
            selected[selected <= current_equation.harmonics],
            max_correction,
            max_iterations - iterations,
            adapt_degenerate=isinstance(degenerate, str),
        )
        selected = np.union1d(selected, new_selected)
        iterations += applications
        evaluations += applications * current_equation.samples
    return _create_solution(equation, coefficients, selected, converged, iterations, evaluations)


def iterate_until_converged(
    equation, coefficients, degenerate, tolerance, max_applications, *, adapt_degenerate: bool
) -> tuple:
    """Iterate E. Schmidt's method until it converges or diverges.

    `equation` is a `MeshEquation`, and `coefficients` are the complex harmonics of the initial
    guess, shape (h + 1,). The near-resonant harmonics, with numbers in the array `degenerate`, are
    found by Newton's method, all others by successive approximations. With `adapt_degenerate`,
    harmonics for which the approximations may diverge are added to the array. The iteration has
    converged if the last changes of both parts are at most `tolerance` (root mean square in units
    of the static deflection). Return (harmonics of the motion, numbers of the degenerate harmonics,
    whether the iteration converged, number of applications of the integral operator). This number
    may exceed `max_applications` by those of the last step.
    """
    count = 0
    iterates = iterate(equation, coefficients, degenerate, tolerance)
    while count < max_applications:
        latest = next(iterates)
        coefficients = latest.coefficients
        count += latest.applications
        if not _rms_norm(coefficients) < _MAX_RMS:
            break
        resonant = (
            _near_resonant_harmonics(equation, latest.force) if adapt_degenerate else degenerate
        )
        # With additional degenerate harmonics, the iteration restarts from the latest motion.
        if np.setdiff1d(resonant, degenerate).size:
            degenerate = np.union1d(degenerate, resonant)
            iterates = iterate(equation, coefficients, degenerate, tolerance)
        elif latest.correction <= tolerance and latest.newton_step <= tolerance:
            return coefficients, degenerate, True, count
    return coefficients, degenerate, False, count


class Iterate(NamedTuple):
    """Result of a step of `iterate`; norms are root mean squares in units of static deflection."""

    coefficients: np.ndarray  #: harmonics of the motion after the step
    force: Force  #: force along the motion before the step
    correction: float  #: norm of the change of the remainder
    newton_step: float  #: norm of the last Newton step of the degenerate part
    applications: int  #: number of applications of the integral operator in this step


def iterate(equation: MeshEquation, coefficients, degenerate, tolerance) -> Iterator[Iterate]:
    """Yield the `Iterate`s of E. Schmidt's method in an infinite loop.

    `coefficients` are the complex harmonics 0 ... h of the initial guess. All harmonics except
    those with numbers in `degenerate` form the remainder. The remainder is corrected by successive
    approximations until its change is below `tolerance`, in units of the static deflection, or
    small compared with the residual of the degenerate harmonics. Then the degenerate harmonics take
    a Newton step. If their residual has increased after the following corrections, the step is
    repeated with half its length.
    """
    receptance = _remainder_receptance(equation, degenerate)
    step_norm = np.inf if len(degenerate) else 0.0
    # `start` and `start_residual` are the harmonics and the residual before the last Newton step.
    # The step needed `applications` of the integral operator and was halved `halvings` times.
    start, step, start_residual = coefficients, np.zeros_like(coefficients), np.inf
    halvings = applications = 0
    while True:
        force = equation.force(coefficients)
        input_force = equation.excitation - _excess_force(equation, coefficients, force.value)
        algebraic_residual = (equation.dynamic_stiffness * coefficients - input_force)[degenerate]
        residual = _rms_norm(algebraic_residual) / equation.mean_stiffness
        corrected = receptance * input_force
        corrected[degenerate] = coefficients[degenerate]
        correction = _rms_norm(corrected - coefficients)
        coefficients = corrected
        yield Iterate(coefficients, force, correction, step_norm, applications + 1)
        applications = 0
        if not len(degenerate) or correction > max(tolerance, _REMAINDER_TOLERANCE * residual):
            continue
        if residual > start_residual and halvings < _MAX_HALVINGS:
            step, halvings = 0.5 * step, halvings + 1
        else:
            start, start_residual, halvings = coefficients, residual, 0
            step, applications = _newton_step(equation, start, degenerate, receptance)
        coefficients, step_norm = start + step, _rms_norm(step)


def _remainder_receptance(equation: MeshEquation, degenerate: np.ndarray) -> np.ndarray:
    """Return the receptance (displacement / force) of the harmonics 0 ... h, shape (h + 1,).

    It is 1 / dynamic stiffness of the linear oscillator with the mean stiffness, and zero for the
    harmonics with numbers in `degenerate`, which are found by Newton's method.
    """
    receptance = np.zeros(equation.harmonics + 1, complex)
    remainder = np.delete(np.arange(receptance.size), degenerate)
    receptance[remainder] = 1.0 / equation.dynamic_stiffness[remainder]
    return receptance


def _newton_step(equation: MeshEquation, coefficients, degenerate, receptance) -> tuple:
    """Compute the Newton step for the degenerate harmonics of a motion.

    The unknowns are the harmonics with numbers in `degenerate`. The other harmonics (the remainder)
    depend on them, because they respond to changes of the excess force (total force minus linear
    force) with the `receptance` (displacement / force, zero for the unknowns). `coefficients` are
    all harmonics of the motion. Return (step of all harmonics 0 ... h, number of applications of
    the integral operator).
    """
    force = equation.force(coefficients)
    residual = equation.residual(coefficients, force)
    # Indices in a `real_vector` of the real parts, then of the imaginary parts except of the mean.
    unknowns = np.concatenate([degenerate, equation.harmonics + degenerate[degenerate > 0]])
    # In each row, one unknown changes by 1.
    real_changes = np.zeros((unknowns.size, 2 * equation.harmonics + 1))
    real_changes[np.arange(unknowns.size), unknowns] = 1.0
    degenerate_changes = from_real_vector(real_changes)
    remainder, terms = np.zeros_like(degenerate_changes), 0
    while terms < _MAX_SERIES_TERMS:
        # Each approximation adds a term of the Neumann series for the response of the remainder.
        changes = degenerate_changes + remainder
        new_remainder = -receptance * _excess_force_change(equation, force, changes)
        change = np.abs(new_remainder - remainder).max()
        remainder, terms = new_remainder, terms + 1
        if not _SERIES_TOLERANCE < change < _MAX_RMS:
            break
    directions = degenerate_changes + remainder
    residual_changes = equation.dynamic_stiffness * directions
    residual_changes += _excess_force_change(equation, force, directions)
    jacobian = real_vector(residual_changes)[:, unknowns].T
    # A least-squares solution exists even if the matrix is singular.
    step = np.linalg.lstsq(jacobian, -real_vector(residual)[unknowns], rcond=None)[0]
    # The residual needs one application, and each unknown one per term and one for its column.
    return step @ directions, 1 + (terms + 1) * len(directions)


def _excess_force(equation: MeshEquation, coefficients: np.ndarray, force: np.ndarray) -> Any:
    """Return the harmonics 0 ... h of the excess force, the total force minus the linear force.

    The linear force is the spring and damping force of the oscillator with the mean stiffness for a
    motion with the harmonics `coefficients`. `force` is the total force at the grid points, shape
    (..., samples).
    """
    linear = (equation.mean_stiffness + 1j * equation.damping * equation.orders) * coefficients
    return equation.to_harmonics(force) - linear


def _excess_force_change(equation: MeshEquation, force: Force, changes: np.ndarray) -> np.ndarray:
    """Return the linearised changes of the excess force for small `changes` of the motion.

    The excess force is the total force minus the force of the linear oscillator with the mean
    stiffness. Both changes are harmonics, of shape (m, h + 1) for m changes or (h + 1,) for one.
    `force` is the force along the motion with its derivatives.
    """
    x, v = equation.motion(changes)
    stiffness = force.stiffness + force.impulse
    return _excess_force(equation, changes, stiffness * x + force.damping * v)


def contraction_factor(equation: MeshEquation, coefficients, degenerate) -> float:
    """Estimate the factor by which each successive approximation multiplies errors.

    The approximations converge if the factor is below 1. It is the spectral radius of the linear
    map from a change of the motion to the response of the remainder to the change of the excess
    force (total force minus linear force). The remainder consists of all harmonics except those
    with numbers in `degenerate`. The power iteration is accurate to about one percent.
    `coefficients` are the complex harmonics of the motion.
    """
    force = equation.force(coefficients)
    receptance = _remainder_receptance(equation, degenerate)
    # The start vector contains all harmonics with two different phases, so that it has no symmetry.
    change = np.where(np.arange(receptance.size) % 2, 1.0, 0.7 + 0.4j) * np.abs(receptance)
    change[0] = abs(change[0])
    factors = []
    for _ in range(_POWER_STEPS):
        factor = _rms_norm(change)
        factors.append(factor)
        if factor == 0.0:
            return 0.0
        change = receptance * _excess_force_change(equation, force, change / factor)
    # After the transient, the geometric mean averages out the beats of complex eigenvalues.
    return float(np.exp(np.mean(np.log(factors[-(_POWER_STEPS // 3) :]))))


_Harmonics = Annotated[tuple[WholeNumber, ...], Values()]


def degenerate_harmonics(equation: MeshEquation, degenerate: Any) -> np.ndarray:
    """Return the sorted numbers of the degenerate harmonics, after a check of the argument.

    Degenerate harmonics are found by Newton's method. The argument `degenerate` of `schmidt` is a
    list of their numbers, the number of harmonics nearest to resonance, or "auto" for all harmonics
    for which successive approximations may diverge according to the forces at the static
    deflection. Raise ValueError if it is invalid.
    """
    if isinstance(degenerate, str):
        checks.check_choice("degenerate", degenerate, ("auto",))
        return _near_resonant_harmonics(
            equation, equation.force(initial_coefficients(equation, None))
        )
    if isinstance(degenerate, Real):
        count = parameters.check("degenerate", degenerate, WholeNumber)
        allowed = f"an integer from 0 to {equation.harmonics + 1}"
        checks.require(count <= equation.harmonics + 1, "degenerate", degenerate, allowed)
        return np.sort(np.argsort(np.abs(equation.dynamic_stiffness), kind="stable")[:count])
    harmonics = parameters.check("degenerate", degenerate, _Harmonics)
    allowed = f"integers from 0 to {equation.harmonics}"
    checks.require(
        max(harmonics, default=0) <= equation.harmonics, "degenerate", degenerate, allowed
    )
    return np.unique(np.array(harmonics, int))


def _near_resonant_harmonics(equation: MeshEquation, force: Force) -> np.ndarray:
    """Return the numbers of the harmonics for which successive approximations may diverge.

    For these harmonics, the upper bound of the factor by which an approximation multiplies the
    error exceeds `_MAX_NORM` (0.5). `force` is the force along the motion with its derivatives.
    """
    return np.flatnonzero(equation.amplification_bounds(force) > _MAX_NORM)


def _rms_norm(coefficients: np.ndarray) -> float:
    """Return the root mean square of a motion over its period, from its complex harmonics 0 ... h.

    By Parseval's theorem it is the square root of the sum of their squared magnitudes.
    """
    powers = np.abs(coefficients) ** 2
    # Harmonics other than the mean also represent their complex conjugates.
    return float(np.sqrt(2.0 * powers.sum() - powers[:1].sum()))


def _create_solution(equation, coefficients, degenerate, converged, iterations, evaluations) -> Any:
    """Return the last iterate of E. Schmidt's method as a `SchmidtSolution`.

    `coefficients` are its complex harmonics, `degenerate` the numbers of the harmonics found by
    Newton's method, and `converged` is whether the iteration converged. `iterations` is the number
    of applications of the integral operator, `evaluations` the number of evaluations of the force
    or its derivative at a grid point. Floquet multipliers and convergence bounds are NaN if the
    motion exceeds `_MAX_RMS`, i.e. if the iteration diverged.
    """
    force = equation.force(coefficients)
    multipliers, norm_bound, contraction = np.full(2, np.nan, complex), np.nan, np.nan
    if _rms_norm(coefficients) < _MAX_RMS:
        multipliers = hill_multipliers(equation, coefficients)
        bounds = np.delete(equation.amplification_bounds(force), degenerate)
        norm_bound = float(bounds.max(initial=0.0))
        contraction = contraction_factor(equation, coefficients, degenerate)
    return SchmidtSolution(
        model=equation.model,
        tuning=equation.tuning,
        period=equation.period,
        method="schmidt",
        coefficients=coefficients,
        samples=equation.samples,
        residual=equation.max_residual(equation.residual(coefficients, force)),
        iterations=iterations,
        evaluations=evaluations,
        multipliers=multipliers,
        converged=converged,
        degenerate=tuple(int(k) for k in degenerate),
        norm_bound=norm_bound,
        contraction=contraction,
    )
