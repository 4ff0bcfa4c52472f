"""Harmonic balance: all harmonics at once by Newton's method, forces by alternating domains.

The residual of x'' + f(tau, x, x') = e on the harmonics is brought to zero. Forces are taken on a
grid (`gearlib.analysis.harmonics.equation`); their derivative by the harmonics follows from the
FFT of f_x and f_v, a Toeplitz matrix, so that nothing is differenced.

Cameron, Griffin, J. Appl. Mech. 56 (1989) 149-154 (alternating frequency/time); the stability is
that of Hill's method.
"""

import numpy as np

from gearlib.analysis.harmonics import solution
from gearlib.analysis.orbits.shooting import NoOrbit

#: Residual over the load that counts as none; times the size of the inertia terms if larger.
RESIDUAL = 1e-11
_MAX_NEWTON, _MAX_HALVINGS = 60, 12


def harmonic_balance(pair, tuning, *, harmonics=64, samples=None, guess=None, period=1):
    """Find a periodic motion by harmonic balance.

    Parameters
    ----------
    pair : GearPair or OneDegreePair
    tuning : float
        nu.
    harmonics : int, default 64
        Highest harmonic, in units of 1 / period. With rectangular mesh stiffness x'' jumps, the
        coefficients fall as their third power, and the error of x as the second (Gibbs).
    samples : int, optional
        Grid points over the period, more than 4 per harmonic; a power of two, at least 16 per
        harmonic, by default.
    guess : PeriodicSolution or array_like of float, optional
        A solution nearby, of any number of harmonics, or displacements (static deflections) at
        equal steps of phase over the period; by default the motion of the strongly damped mesh,
        followed as the added damping goes.
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
        If Newton's method found none near the guess; the message says what to try.
    """
    equation = solution.check_problem(pair, tuning, harmonics, samples, period)
    coefficients = solution.first_coefficients(equation, guess)
    steps, evaluations = 0, 0
    for stage, tolerance in solution.stages(equation, guess, RESIDUAL):
        first = solution.resized(coefficients, stage)
        coefficients, size, *cost = _newton(stage, first, tolerance)
        steps, evaluations = steps + cost[0], evaluations + cost[1]
    if not size <= _least(equation, coefficients, RESIDUAL):
        raise NoOrbit(
            f"harmonic balance found no motion of period {equation.period} near the guess at "
            f"tuning = {equation.tuning!r}, the best residual is {size:.2g}: guess the solution of "
            "a neighbouring tuning or the displacements of a run, or take another period"
        )
    return solution.PeriodicSolution(
        pair,
        equation.tuning,
        equation.period,
        "harmonic balance",
        coefficients,
        equation.samples,
        size,
        steps,
        evaluations,
        solution.hill_multipliers(equation, coefficients),
    )


def _newton(equation, coefficients, tolerance):
    """Return (coefficients, residual, steps, evaluations) where Newton's method ends."""
    residual, force = equation.residual(coefficients)
    size, steps, evaluations = equation.size(residual), 0, equation.samples
    while steps < _MAX_NEWTON and size > _least(equation, coefficients, tolerance):
        try:
            step = -_complex(np.linalg.solve(jacobian(equation, force), _real(residual)))
        except np.linalg.LinAlgError:
            break
        steps += 1
        for _ in range(_MAX_HALVINGS):
            new_residual, new_force = equation.residual(coefficients + step)
            new_size = equation.size(new_residual)
            evaluations += equation.samples
            if new_size < size:
                break
            step *= 0.5
        else:
            break
        coefficients, residual, force, size = coefficients + step, new_residual, new_force, new_size
    return coefficients, size, steps, evaluations


def _least(equation, coefficients, tolerance):
    """Return the residual that counts as none."""
    inertia = np.abs(equation.orders**2 * coefficients).sum() / equation.unit
    return tolerance * max(1.0, inertia)


def jacobian(equation, force):
    """Return the derivative of the residual by the harmonics, real, square.

    Unknowns and equations are X_0, then the real parts, then the imaginary parts of X_1 ... X_h.
    """
    k = np.arange(equation.harmonics + 1)
    b = np.fft.fft(force.by_displacement, norm="forward")
    a = np.fft.fft(force.by_velocity, norm="forward")
    rate = 1j * equation.orders
    plus, minus = k[:, None] - k, k[:, None] + k
    direct = b[plus] + a[plus] * rate - np.diag(equation.orders**2)
    mirrored = b[minus] - a[minus] * rate
    by_real, by_imaginary = direct + mirrored, 1j * (direct - mirrored)
    by_real[:, 0] = direct[:, 0]
    return np.block(
        [
            [by_real.real, by_imaginary[:, 1:].real],
            [by_real[1:].imag, by_imaginary[1:, 1:].imag],
        ]
    )


def _real(coefficients):
    return np.concatenate([coefficients.real, coefficients[1:].imag])


def _complex(values):
    half = values.size // 2 + 1
    result = values[:half].astype(complex)
    result[1:] += 1j * values[half:]
    return result
