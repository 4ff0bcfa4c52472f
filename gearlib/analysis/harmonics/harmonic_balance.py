"""`harmonic_balance`: all harmonics of a periodic motion at once by Newton's method.

Newton's method finds the zero of the harmonics of the residual of x'' + f(tau, x, x') = e. Forces
are evaluated on a grid of phases (`gearlib.analysis.harmonics.equation`). The Jacobian matrix
follows from the FFT of the derivatives of f with respect to x and x', without finite differences.
The stability is determined by Hill's method.

Cameron, Griffin, J. Appl. Mech. 56 (1989) 149-154 (alternating frequency/time method).
"""

from typing import Any

import numpy as np

from gearlib import checks
from gearlib.analysis.harmonics.equation import (
    MIN_SAMPLES,
    MeshEquation,
    from_real_vector,
    real_vector,
)
from gearlib.analysis.harmonics.solution import PeriodicSolution, hill_multipliers
from gearlib.analysis.orbits.shooting import NoOrbit
from gearlib.data.motions import as_float_array
from gearlib.models.model import is_model
from gearlib.parameters import Count, checked
from gearlib.runs.run_arguments import Tuning

#: Largest residual of a solution, relative to the load or the inertia force, whichever is larger.
_MAX_RESIDUAL = 1e-11
_MAX_NEWTON_STEPS, _MAX_HALVINGS = 60, 12
#: Added damping coefficients of the continuation from a strongly damped motion to the actual one.
_ADDED_DAMPINGS = (1.0, 0.3, 0.1, 0.03, 0.0)
#: Number of harmonics and tolerance in this continuation, enough to distinguish contact states.
_GUESS_HARMONICS, _GUESS_TOLERANCE = 32, 1e-3


@checked
def harmonic_balance(
    model,
    tuning: Tuning,
    *,
    harmonics: Count = 64,
    samples: Count | None = None,
    guess=None,
    period: Count = 1,
):
    """Find a periodic motion by harmonic balance.

    Parameters
    ----------
    model : GearPair or OneDegreePair
    tuning : float
        Ratio of mesh frequency to mean eigenfrequency, nu.
    harmonics : int, default 64
        Highest harmonic, in units of 1 / period. With rectangular mesh stiffness x'' jumps, so that
        coefficients decay with the third power of the harmonic, and the error of x decreases with
        the second power of the highest harmonic (Gibbs phenomenon).
    samples : int, optional
        Number of grid points over the period, more than 4 per harmonic. By default a power of two
        with at least 16 points per harmonic.
    guess : PeriodicSolution or array_like of float, optional
        A neighbouring solution with any number of harmonics, or displacements (in units of the
        static deflection) at equal phase steps over the period. By default the motion of a strongly
        damped mesh is continued while the added damping is reduced.
    period : int, default 1
        Number of mesh periods after which the motion repeats.

    Returns
    -------
    PeriodicSolution

    Raises
    ------
    ValueError
        If an argument is invalid; the message states its value and what is allowed.
    gearlib.analysis.orbits.shooting.NoOrbit
        If Newton's method does not converge; the message says what to try.
    """
    equation = create_equation(model, tuning, harmonics, samples, period)
    coefficients = initial_coefficients(equation, guess)
    steps, evaluations = 0, 0
    for current_equation, tolerance in continuation_sequence(equation, guess, _MAX_RESIDUAL):
        guess_coefficients = resize_harmonics(coefficients, current_equation)
        solution = _newton(current_equation, guess_coefficients, tolerance)
        coefficients, residual, new_steps, new_evaluations = solution
        steps, evaluations = steps + new_steps, evaluations + new_evaluations
    if not residual <= _max_residual(equation, coefficients, _MAX_RESIDUAL):
        raise NoOrbit(
            f"harmonic balance found no motion of period {equation.period} near the guess at tuning"
            f" = {equation.tuning!r}; the best residual is {residual:.2g}. As the guess, try the "
            "solution at a neighbouring tuning or the displacements of a run, or try another period"
        )
    return PeriodicSolution(
        model,
        equation.tuning,
        equation.period,
        "harmonic balance",
        coefficients,
        equation.samples,
        residual,
        steps,
        evaluations,
        hill_multipliers(equation, coefficients),
    )


def _newton(equation: MeshEquation, coefficients: np.ndarray, tolerance: float) -> tuple:
    """Solve the mesh equation by a damped Newton iteration.

    `coefficients` are the complex harmonics of the initial guess, shape (h + 1,). Each step is
    halved until the residual decreases. The iteration stops when the largest residual, relative to
    the load, is below `tolerance`, or when no step decreases it; the caller must check which.
    Return (harmonics of the last iterate, its largest residual, number of steps, number of force
    evaluations at a grid point).
    """
    force = equation.force(coefficients)
    residual = equation.residual(coefficients, force)
    norm, steps, evaluations = equation.max_residual(residual), 0, equation.samples
    while steps < _MAX_NEWTON_STEPS and norm > _max_residual(equation, coefficients, tolerance):
        try:
            step = np.linalg.solve(equation.jacobian(force), -real_vector(residual))
        except np.linalg.LinAlgError:
            break
        step = from_real_vector(step)
        steps += 1
        for _ in range(_MAX_HALVINGS):
            new_coefficients = coefficients + step
            new_force = equation.force(new_coefficients)
            new_residual = equation.residual(new_coefficients, new_force)
            new_norm = equation.max_residual(new_residual)
            evaluations += equation.samples
            if new_norm < norm:
                break
            step *= 0.5
        else:
            # Not even the shortest step decreases the residual.
            break
        coefficients, force, residual, norm = new_coefficients, new_force, new_residual, new_norm
    return coefficients, norm, steps, evaluations


def _max_residual(equation: MeshEquation, coefficients: np.ndarray, tolerance: float) -> float:
    """Return the residual, relative to the load, below which a motion is accepted as a solution.

    It is `tolerance` times the load or the inertia force, whichever is larger, because rounding
    errors are proportional to the largest term of the equation. `coefficients` are the complex
    harmonics of the motion.
    """
    inertia = np.abs(equation.orders**2 * coefficients).sum() / equation.mean_stiffness
    return tolerance * max(1.0, inertia)


def create_equation(model: Any, tuning, harmonics, samples, period) -> MeshEquation:
    """Check the arguments of `harmonic_balance` and return their `MeshEquation`.

    `tuning` is the ratio of mesh frequency to natural frequency, `harmonics` the highest harmonic,
    `samples` the number of grid points over the period or None for the default, and `period` the
    number of mesh periods after which the motion repeats. Raise ValueError if the model has more
    than one degree of freedom, or if `harmonics` or `samples` is too small.
    """
    if not (is_model(model) and model.has_pair_equation):
        raise checks.InputError(
            "model", model, "a GearPair or a OneDegreePair, one degree of freedom"
        )
    checks.require(harmonics >= period, "harmonics", harmonics, f"an integer >= {period}")
    min_samples = MIN_SAMPLES * harmonics + 1
    is_enough = samples is None or samples >= min_samples
    checks.require(is_enough, "samples", samples, f"an integer >= {min_samples}")
    return MeshEquation(model, tuning, harmonics, samples, period)


def continuation_sequence(equation: MeshEquation, guess: Any, tolerance: float) -> list:
    """Return the mesh equations to be solved in sequence, as a list of (equation, tolerance).

    The solution of each equation is the initial guess for the next one, and the given `equation` is
    the last one. If `guess` is None, it is preceded by equations with fewer harmonics and with
    added damping that decreases to zero, because they converge from a poor guess.
    """
    if guess is not None:
        return [(equation, tolerance)]
    model, tuning, period = equation.model, equation.tuning, equation.period
    harmonics = min(equation.harmonics, _GUESS_HARMONICS * period)
    sequence = []
    for damping in _ADDED_DAMPINGS:
        damped_equation = MeshEquation(model, tuning, harmonics, None, period, damping)
        sequence.append((damped_equation, _GUESS_TOLERANCE))
    return [*sequence, (equation, tolerance)]


def initial_coefficients(equation: MeshEquation, guess: Any) -> np.ndarray:
    """Return the complex harmonics of the initial guess, shape (harmonics + 1,).

    The guess is a `PeriodicSolution` of the same period, an array of displacements at equal phase
    steps over the period, or None for the static deflection. Raise ValueError for anything else.
    """
    if guess is None:
        # Displacements are in units of the static deflection, so the mean is 1.
        return resize_harmonics(np.ones(1, complex), equation)
    if isinstance(guess, PeriodicSolution):
        if guess.period != equation.period:
            raise ValueError(
                f"guess with period = {guess.period} is not allowed: the period must be "
                f"{equation.period}"
            )
        return resize_harmonics(guess.coefficients, equation)
    values = as_float_array(guess)
    allowed = "a PeriodicSolution or at least 3 finite displacements over the period"
    is_valid = values.ndim == 1 and values.size >= 3 and np.isfinite(values).all()
    checks.require(is_valid, "guess", guess, allowed)
    coefficients = np.fft.rfft(values, norm="forward")
    # With an even number of points, the phase of the highest harmonic is unknown, so omit it.
    return resize_harmonics(coefficients[: (values.size + 1) // 2], equation)


def resize_harmonics(coefficients: np.ndarray, equation: MeshEquation) -> np.ndarray:
    """Truncate complex harmonics to those of an equation, or extend them with zeros."""
    resized = np.zeros(equation.harmonics + 1, complex)
    count = min(coefficients.size, resized.size)
    resized[:count] = coefficients[:count]
    return resized
