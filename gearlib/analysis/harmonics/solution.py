"""A periodic motion as harmonics: its course, flank crossings, errors, multipliers, as a dataset.

Floquet multipliers are those of Hill's method. Small deviations obey
y'' + a(tau) y' + (h(tau) y)' + b(tau) y = 0, the terms of which are those of
`MeshEquation.variation`. With y = exp(l tau) sum_k y_k exp(i k tau / n), cut at |k| <= K, this is a
quadratic eigenvalue problem in l with 2 (2 K + 1) eigenvalues, of which two mean something: every
exponent l returns as l + i k / n, the worse the farther from the middle. Kept are those whose
eigenvectors are the most symmetric about k = 0 (Lazarus, Thomas, C. R. Mecanique 338 (2010)
510-517), paired so that the product of their multipliers is that of Liouville's formula: at a real
negative multiplier an exponent and its conjugate are equally symmetric, and only the product tells
two multipliers from one that is found twice.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import ArpackNoConvergence, eigs

from gearlib import checks
from gearlib.analysis.harmonics.equation import LEAST_SAMPLES, MeshEquation, default_samples, takes
from gearlib.analysis.orbits.shooting import periodic_orbit
from gearlib.data.numbers_given import floats
from gearlib.data.result import result
from gearlib.engines.pair.motion import contact_of
from gearlib.runs.run_arguments import check_tuning
from gearlib.runs.simulation import simulate

_POLISH = 8
#: Damping forces x' added on the way to a first guess, from a motion that hardly moves down to
#: that of the mesh itself; on harmonics enough to tell contacts.
_ADDED_DAMPING = (1.0, 0.3, 0.1, 0.03, 0.0)
_COARSE = 32
#: Accuracy of the motions on that way.
_ROUGH = 1e-3
#: Phases per mesh period at which courses are compared: at least, and for each harmonic. The
#: error of many harmonics lies within a wavelength of the last from the jumps of the stiffness.
_PHASES, _PER_HARMONIC = 512, 16
#: Harmonics of the variations at most: the matrix costs their number cubed.
MOST = 100
#: Exponents among which the two are sought.
_CANDIDATES = 8
#: Restarts of ARPACK; without strong damping four are enough.
_MAX_RESTARTS = 10
#: Off the middle between the exponents, where a double one would make the matrix singular.
_ASIDE = 1e-3 + 0.7e-3j


@dataclass(frozen=True)
class PeriodicSolution:
    """A periodic motion x = Re sum_k X_k exp(i k tau / period), k >= 1 twice."""

    pair: Any
    tuning: float
    period: int  #: mesh periods
    method: str  #: "harmonic balance" or "schmidt"
    coefficients: np.ndarray  #: X_0 ... X_harmonics, complex, static deflections
    samples: int  #: grid points on which forces were evaluated
    residual: float  #: of the balanced harmonics, over the load
    iterations: int  #: Newton steps, or applications of the kernel
    evaluations: int  #: of the force law, or its derivative along a variation, at one phase
    multipliers: np.ndarray  #: Floquet multipliers of the period by Hill's method

    @property
    def harmonics(self):
        """Highest harmonic, in units of 1 / period."""
        return self.coefficients.size - 1

    @property
    def stable(self):
        """Whether all multipliers lie inside the unit circle."""
        return bool(np.abs(self.multipliers).max() < 1.0)

    @property
    def state(self):
        """Displacement and dx/dtau at tau = 0, shape (2,)."""
        return np.array(self.at([0.0])).ravel()

    def at(self, phase):
        """Return displacement and dx/dtau at phases (rad), each of the shape of `phase`."""
        phase = np.asarray(phase, float)
        orders = self._orders()
        doubled = np.where(orders == 0.0, 1.0, 2.0) * self.coefficients
        waves = np.exp(1j * phase[..., None] * orders)
        return (waves @ doubled).real, (waves @ (1j * orders * doubled)).real

    def courses(self, samples_per_period):
        """Return displacement and dx/dtau at equal steps of phase over the whole period."""
        points = samples_per_period * self.period
        fold = -(-(2 * self.harmonics + 1) // points)
        orders = self._orders()
        return tuple(
            np.fft.irfft(values, fold * points, norm="forward")[::fold]
            for values in (self.coefficients, 1j * orders * self.coefficients)
        )

    def crossings(self):
        """Return the phases of the flank crossings, rad, rising, and contact codes (from, to).

        Found between the points of a grid and polished by Newton's method on the harmonics: two
        crossings within one cell of the grid are not seen.
        """
        points = default_samples(self.harmonics)
        x, _ = self.courses(-(-points // self.period))
        gap = self.pair.backlash_ratio
        length = 2.0 * np.pi * self.period
        phases = np.arange(x.size) * (length / x.size)
        crossings = []
        for line, codes in ((0.0, (1, 0)), (-gap, (0, -1))):
            if not np.isfinite(line):
                continue
            above = x >= line
            for i in np.flatnonzero(above != np.roll(above, -1)):
                a, b = x[i] - line, x[(i + 1) % x.size] - line
                phase = phases[i] + a / (a - b) * length / x.size
                for _ in range(_POLISH):
                    at, speed = self.at(phase)
                    phase -= (at - line) / speed if speed else 0.0
                crossings.append((float(phase) % length, codes if above[i] else codes[::-1]))
        crossings.sort()
        kinds = np.array([codes for _, codes in crossings], np.int8).reshape(-1, 2)
        return np.array([phase for phase, _ in crossings]), kinds

    def dataset(self, samples_per_period=256, orbit=None):
        """Return course, harmonics, multipliers and the facts of the solution as a dataset.

        With an exact `orbit` (`gearlib.periodic_orbit`) the errors against it are added.
        """
        x, v = self.courses(samples_per_period)
        phase = np.arange(x.size) * (2.0 * np.pi / samples_per_period)
        twice = np.where(self._orders() == 0.0, 1.0, 2.0)
        contact = [contact_of(self.pair.backlash_ratio, a, b) for a, b in zip(x, v, strict=True)]
        data = {
            "displacement": ("phase", x),
            "velocity": ("phase", v),
            "contact": ("phase", np.array(contact, np.int8)),
            "cosine": ("harmonic", twice * self.coefficients.real),
            "sine": ("harmonic", -twice * self.coefficients.imag),
            "multiplier_real": ("multiplier", self.multipliers.real),
            "multiplier_imaginary": ("multiplier", self.multipliers.imag),
            "stable": np.int8(self.stable),
            "equation_residual": self.residual,
            "iterations": np.int32(self.iterations),
            "evaluations": np.int64(self.evaluations),
            "period": np.int32(self.period),
            "tuning": self.tuning,
            **self._facts(),
        }
        if orbit is not None:
            differences = errors(self, orbit)
            data |= {f"{name}_error": value for name, value in differences._asdict().items()}
        coords = {"phase": phase, "harmonic": self._orders()}
        return result(
            "Periodic motion of a gear mesh over harmonics",
            self.pair,
            data,
            coords,
            method=self.method,
            tuning=self.tuning,
            harmonics=self.harmonics,
            samples=self.samples,
        )

    def _orders(self):
        return np.arange(self.harmonics + 1) / self.period

    def _facts(self):
        """Return what a method adds to the dataset."""
        return {}


def check_problem(model, tuning, harmonics, samples, period):
    """Return the `MeshEquation` of checked arguments, else ValueError."""
    takes(model)
    tuning = check_tuning("tuning", tuning)
    period = checks.integer("period", period, 1)
    harmonics = checks.integer("harmonics", harmonics, period)
    if samples is not None:
        samples = checks.integer("samples", samples, LEAST_SAMPLES * harmonics + 1)
    return MeshEquation(model, tuning, harmonics, samples, period)


def stages(equation, guess, tolerance):
    """Return the equations that are solved one after the other, each with its tolerance.

    Without a guess these are first, roughly and of few harmonics, those of a strongly damped mesh.
    """
    damped = []
    if guess is None:
        harmonics = min(equation.harmonics, _COARSE * equation.period)
        coarse = MeshEquation(equation.pair, equation.tuning, harmonics, None, equation.period)
        damped = [(coarse.damped(extra), _ROUGH) for extra in _ADDED_DAMPING]
    return [*damped, (equation, tolerance)]


def first_coefficients(equation, guess):
    """Return the harmonics from which a search starts, shape (harmonics + 1,).

    The guess is a `PeriodicSolution` of the same period; displacements at n equal steps of
    phase over the period; or None, the static deflection. A ValueError names it.
    """
    result = np.zeros(equation.harmonics + 1, complex)
    if guess is None:
        result[0] = 1.0
        return result
    if isinstance(guess, PeriodicSolution):
        if guess.period != equation.period:
            raise ValueError(
                f"guess with period = {guess.period} is not allowed: its period must be "
                f"{equation.period}"
            )
        known = guess.coefficients
    else:
        values = floats(guess)
        if values.ndim != 1 or values.size < 3 or not np.isfinite(values).all():
            raise ValueError(
                f"guess = {guess!r} is not allowed: it must be a PeriodicSolution or at least 3 "
                "finite displacements over the period"
            )
        # The highest harmonic of an even number of points has no phase: left out.
        known = np.fft.rfft(values, norm="forward")[: (values.size + 1) // 2]
    return resized(known, equation)


def resized(coefficients, equation):
    """Return harmonics cut, or filled with zeros, to those of an equation."""
    result = np.zeros(equation.harmonics + 1, complex)
    count = min(coefficients.size, result.size)
    result[:count] = coefficients[:count]
    return result


class Errors(NamedTuple):
    """Largest differences from the exact orbit."""

    displacement: float  #: over the period, static deflections
    velocity: float  #: of dx/dtau over the period
    state: float  #: at tau = 0, the larger of displacement and dx/dtau
    event: float  #: of the phases of flank crossings, rad; NaN if there are none, or others
    multiplier: float  #: of the largest |Floquet multiplier|


def errors(solution, orbit=None):
    """Return the `Errors` of a `PeriodicSolution`.

    Against the exact `Orbit`, by default the one that shooting finds from its state, or
    NoOrbit.
    """
    if orbit is None:
        orbit = periodic_orbit(
            solution.pair, solution.tuning, guess=solution.state, period=solution.period
        )
    count = max(_PHASES, _PER_HARMONIC * solution.harmonics // solution.period)
    x, v, phases, kinds = exact_course(orbit, count)
    found_x, found_v = solution.courses(count)
    found_phases, found_kinds = solution.crossings()
    event = np.nan
    if phases.size and found_kinds.shape == kinds.shape and (found_kinds == kinds).all():
        event = float(np.abs(found_phases - phases).max())
    largest = np.abs(orbit.multipliers).max()
    return Errors(
        float(np.abs(found_x - x).max()),
        float(np.abs(found_v - v).max()),
        float(np.abs(solution.state - orbit.state).max()),
        event,
        float(abs(np.abs(solution.multipliers).max() - largest)),
    )


def exact_course(orbit, samples_per_period):
    """Return displacement and dx/dtau over the period of an orbit, its events and their codes."""
    run = simulate(
        orbit.pair,
        orbit.tuning,
        periods=orbit.period,
        record_periods=orbit.period,
        samples_per_period=samples_per_period,
        initial_state=tuple(orbit.state),
    )
    kinds = np.column_stack([run.event_from.values, run.event_to.values])
    return run.displacement.values, run.velocity.values, run.event_phase.values, kinds


def hill_multipliers(equation, coefficients, harmonics=None):
    """Return the two Floquet multipliers of the period, complex, largest first.

    `coefficients`, shape (equation.harmonics + 1,), are those of the motion. `harmonics`, K, is
    as many as the motion has, at most 100, by default.
    """
    most = min(equation.harmonics, MOST) if harmonics is None else harmonics
    k = np.arange(-most, most + 1)
    variation = equation.variation(*equation.motion(coefficients))
    a, h, b = (np.fft.fft(part, norm="forward")[k[:, None] - k] for part in variation)
    # With u = (l + i k) y + h y: linear in l for (y, u).
    rate = np.diag(1j * k / equation.period)
    matrix = np.block([[-rate - h, np.eye(k.size)], [a @ h - b, -rate - a]])
    # Liouville: the two exponents lie on either side of minus half the mean damping, and the
    # copies of either farther from there than itself.
    mean = np.mean(variation[0] + variation[1])
    start = np.exp(-np.abs(np.tile(k, 2))).astype(complex)
    near = -mean / 2.0 + _ASIDE
    count = min(_CANDIDATES, 2 * k.size - 2)
    try:
        exponents, vectors = eigs(matrix, count, sigma=near, v0=start, maxiter=_MAX_RESTARTS)
    except ArpackNoConvergence:
        # The copies of strongly damped exponents are nearly equally far from the middle.
        exponents, vectors = np.linalg.eig(matrix)
    share = np.abs(vectors[: k.size]) ** 2
    skew = np.abs(k @ share) / share.sum(axis=0)
    length = 2.0 * np.pi * equation.period
    candidates = np.exp(length * exponents[np.argsort(skew, kind="stable")])
    pair = np.array(_pair(candidates, np.exp(-length * mean)))
    return pair[np.argsort(-np.abs(pair), kind="stable")]


def _pair(candidates, product):
    """Return the most symmetric multiplier, and the one whose product with it is `product`."""
    scale = max(abs(product), np.finfo(float).tiny)
    miss = np.abs(candidates[0] * candidates[1:] - product) / scale
    return candidates[0], candidates[1 + int(np.argmin(miss))]
