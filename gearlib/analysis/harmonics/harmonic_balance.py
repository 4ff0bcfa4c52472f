"""`harmonic_balance`: all harmonics of a periodic motion at once by Newton's method.

Newton's method solves for zero residual of x'' + f(tau, x, x') = e on the harmonics. Forces are
evaluated on a grid of phases (`gearlib.analysis.harmonics.equation`); their Jacobian matrix follows
from the FFT of f_x and f_v, without finite differences.

Cameron, Griffin, J. Appl. Mech. 56 (1989) 149-154 (alternating frequency/time); the stability
follows from Hill's method.
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
from gearlib.data.motions import float_array
from gearlib.models.model import is_model
from gearlib.parameters import Count, checked
from gearlib.runs.run_arguments import Tuning

#: Largest residual of a solution, relative to the load or the inertia force if that is larger.
_MAX_RESIDUAL = 1e-11
_MAX_NEWTON_STEPS, _MAX_HALVINGS = 60, 12
#: Coefficients of the added damping in the continuation from a strongly damped motion.
_ADDED_DAMPINGS = (1.0, 0.3, 0.1, 0.03, 0.0)
#: Harmonics and tolerance in this continuation: enough to distinguish contact states.
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
        Mesh frequency over mean eigenfrequency, nu.
    harmonics : int, default 64
        Highest harmonic, in units of 1 / period. With rectangular mesh stiffness x'' jumps, the
        coefficients decay with their third power, and the error of x with the second (Gibbs).
    samples : int, optional
        Number of grid points over the period, more than 4 per harmonic. By default a power of two,
        at least 16 per harmonic.
    guess : PeriodicSolution or array_like of float, optional
        A neighbouring solution, with any number of harmonics, or displacements (static deflections)
        at equal steps of phase over the period. By default the motion of a strongly damped mesh is
        continued while the added damping is reduced.
    period : int, default 1
        Mesh periods after which the motion repeats.

    Returns
    -------
    PeriodicSolution

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed range.
    gearlib.analysis.orbits.shooting.NoOrbit
        If Newton's method does not converge; the message says what to try.
    """
    equation = check_problem(model, tuning, harmonics, samples, period)
    coefficients = first_coefficients(equation, guess)
    steps, evaluations = 0, 0
    for stage, tolerance in stages(equation, guess, _MAX_RESIDUAL):
        start = resize_harmonics(coefficients, stage)
        coefficients, residual, new_steps, new_evaluations = _newton(stage, start, tolerance)
        steps, evaluations = steps + new_steps, evaluations + new_evaluations
    if not residual <= _max_residual(equation, coefficients, _MAX_RESIDUAL):
        raise NoOrbit(
            f"harmonic balance found no motion of period {equation.period} near the guess at tuning"
            f" = {equation.tuning!r}, the best residual is {residual:.2g}: guess the solution of a "
            "neighbouring tuning or the displacements of a run, or take another period"
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
    """Solve the mesh equation by Newton's method with step halving, from harmonics 0 ... h.

    Return (complex harmonics of the last iterate, its largest residual, number of steps, number of
    evaluations of the force at a grid point).
    """
    force = equation.force(coefficients)
    residual = equation.residual(coefficients, force)
    size, steps, evaluations = equation.max_residual(residual), 0, equation.samples
    while steps < _MAX_NEWTON_STEPS and size > _max_residual(equation, coefficients, tolerance):
        try:
            step = np.linalg.solve(equation.jacobian(force), -real_vector(residual))
        except np.linalg.LinAlgError:
            break
        step = from_real_vector(step)
        steps += 1
        for _ in range(_MAX_HALVINGS):
            new = coefficients + step
            new_force = equation.force(new)
            new_residual = equation.residual(new, new_force)
            new_size = equation.max_residual(new_residual)
            evaluations += equation.samples
            if new_size < size:
                break
            step *= 0.5
        else:
            break
        coefficients, force, residual, size = new, new_force, new_residual, new_size
    return coefficients, size, steps, evaluations


def _max_residual(equation: MeshEquation, coefficients: np.ndarray, tolerance: float) -> float:
    """Return the residual below which a motion is a solution, for a relative tolerance."""
    inertia = np.abs(equation.orders**2 * coefficients).sum() / equation.mean_stiffness
    return tolerance * max(1.0, inertia)


def check_problem(model: Any, tuning, harmonics, samples, period) -> MeshEquation:
    """Return the `MeshEquation` for checked arguments of `harmonic_balance`."""
    if not (is_model(model) and model.has_pair_equation):
        raise checks.refusal("model", model, "a GearPair or a OneDegreePair, one degree of freedom")
    checks.require(harmonics >= period, "harmonics", harmonics, f"an integer >= {period}")
    least = MIN_SAMPLES * harmonics + 1
    is_enough = samples is None or samples >= least
    checks.require(is_enough, "samples", samples, f"an integer >= {least}")
    return MeshEquation(model, tuning, harmonics, samples, period)


def stages(equation: MeshEquation, guess: Any, tolerance: float) -> list:
    """Return the mesh equations that are solved one after the other, as (equation, tolerance).

    Without a guess, equations with added damping and few harmonics precede the actual one.
    """
    model, tuning, period = equation.model, equation.tuning, equation.period
    harmonics = min(equation.harmonics, _GUESS_HARMONICS * period)
    damped_stages = [
        (MeshEquation(model, tuning, harmonics, None, period, damping), _GUESS_TOLERANCE)
        for damping in (_ADDED_DAMPINGS if guess is None else ())
    ]
    return [*damped_stages, (equation, tolerance)]


def first_coefficients(equation: MeshEquation, guess: Any) -> np.ndarray:
    """Return the complex harmonics of an initial guess, shape (harmonics + 1,).

    The guess is a `PeriodicSolution` of the same period, an array of displacements at equal steps
    of phase over the period, or None for the static deflection.
    """
    if guess is None:
        return resize_harmonics(np.ones(1, complex), equation)
    if isinstance(guess, PeriodicSolution):
        if guess.period != equation.period:
            raise ValueError(
                f"guess with period = {guess.period} is not allowed: its period must be "
                f"{equation.period}"
            )
        return resize_harmonics(guess.coefficients, equation)
    values = float_array(guess)
    allowed = "a PeriodicSolution or at least 3 finite displacements over the period"
    is_valid = values.ndim == 1 and values.size >= 3 and np.isfinite(values).all()
    checks.require(is_valid, "guess", guess, allowed)
    coefficients = np.fft.rfft(values, norm="forward")
    # The highest harmonic of an even number of points has no phase, so it is omitted.
    return resize_harmonics(coefficients[: (values.size + 1) // 2], equation)


def resize_harmonics(coefficients: np.ndarray, equation: MeshEquation) -> np.ndarray:
    """Return harmonics truncated, or padded with zeros, to those of an equation."""
    resized = np.zeros(equation.harmonics + 1, complex)
    count = min(coefficients.size, resized.size)
    resized[:count] = coefficients[:count]
    return resized
