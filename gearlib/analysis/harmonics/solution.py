"""Periodic motions over harmonics: time history, flank crossings, errors, multipliers, dataset.

Floquet multipliers are those of Hill's method. Small deviations obey
y'' + a(tau) y' + (h(tau) y)' + b(tau) y = 0, the terms of which are those of
`MeshEquation.variation`. With y = exp(l tau) sum_k y_k exp(i k tau / n), cut at |k| <= K, this is a
quadratic eigenvalue problem in l with 2 (2 K + 1) eigenvalues, of which two are accurate: every
exponent l returns as l + i k / n, with an error that grows with |k|. The two whose eigenvectors are
the most symmetric about k = 0 are chosen (Lazarus, Thomas, C. R. Mecanique 338 (2010) 510-517),
paired so that the product of their multipliers is that of Liouville's formula: at a real
negative multiplier an exponent and its conjugate are equally symmetric, and only the product
distinguishes two multipliers from one that occurs twice.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.sparse.linalg import ArpackNoConvergence, eigs

from gearlib.analysis.harmonics.equation import MeshEquation, default_samples
from gearlib.analysis.orbits.shooting import periodic_orbit
from gearlib.data.result import result
from gearlib.engines.pair.motion import contact_of
from gearlib.runs.simulation import simulate

#: Newton steps that refine a flank crossing.
_CROSSING_STEPS = 8
#: Phases per mesh period at which time histories are compared: the smallest number, and the number
#: for each harmonic. The error of many harmonics lies within the shortest wave of a stiffness jump.
_MIN_PHASES, _PHASES_PER_HARMONIC = 512, 16
#: Largest number of harmonics of the variations: the cost is their number cubed.
_MAX_VARIATION_HARMONICS = 100
#: Number of exponents that are computed, from which two are chosen.
_CANDIDATES = 8
#: Restarts of ARPACK; without strong damping four are enough.
_MAX_RESTARTS = 10
#: Offset from the middle between the exponents, where a double one would make the matrix singular.
_SHIFT_OFFSET = 1e-3 + 0.7e-3j


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
    def harmonics(self) -> int:
        """Highest harmonic, in units of 1 / period."""
        return self.coefficients.size - 1

    @property
    def orders(self) -> np.ndarray:
        """Orders of the harmonics relative to the mesh phase: k / period."""
        return np.arange(self.harmonics + 1) / self.period

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle."""
        return bool(np.abs(self.multipliers).max() < 1.0)

    @property
    def state(self) -> np.ndarray:
        """Displacement and dx/dtau at tau = 0, shape (2,)."""
        return np.array(self.at(0.0))

    def _real_factors(self) -> tuple:
        """Return the factors of exp(i k tau / period) in x = Re sum, and those in dx/dtau."""
        factors = np.where(self.orders == 0.0, 1.0, 2.0) * self.coefficients
        return factors, 1j * self.orders * factors

    def at(self, phase: ArrayLike) -> tuple:
        """Return (displacement, dx/dtau) at mesh phases (rad), each of the shape of `phase`."""
        waves = np.exp(1j * np.asarray(phase, float)[..., None] * self.orders)
        return tuple((waves @ factors).real for factors in self._real_factors())

    def courses(self, samples_per_period: int) -> tuple:
        """Return (displacement, dx/dtau) at equal steps of phase over the whole period."""
        points = samples_per_period * self.period
        # The inverse FFT needs more than two points for each harmonic.
        refinement = -(-(2 * self.harmonics + 1) // points)
        return tuple(
            np.fft.irfft(values, refinement * points, norm="forward")[::refinement]
            for values in (self.coefficients, 1j * self.orders * self.coefficients)
        )

    def crossings(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (rising phases of the flank crossings, rad; contact codes before and after each).

        They are bracketed on a grid and refined by Newton's method on the harmonics; two crossings
        within one cell of the grid are not detected.
        """
        x, _ = self.courses(-(-default_samples(self.harmonics) // self.period))
        length = 2.0 * np.pi * self.period
        crossings = []
        flank_lines = ((0.0, (1, 0)), (-self.pair.backlash_ratio, (0, -1)))
        for line, downward_codes in flank_lines:
            if not np.isfinite(line):
                continue
            is_above = x >= line
            for i in np.flatnonzero(is_above != np.roll(is_above, -1)):
                before, after = x[i] - line, x[(i + 1) % x.size] - line
                phase = (i + before / (before - after)) * length / x.size
                for _ in range(_CROSSING_STEPS):
                    displacement, velocity = self.at(phase)
                    phase -= (displacement - line) / velocity if velocity else 0.0
                codes = downward_codes if is_above[i] else downward_codes[::-1]
                crossings.append((float(phase) % length, codes))
        crossings.sort()
        all_codes = np.array([codes for _, codes in crossings], np.int8).reshape(-1, 2)
        return np.array([phase for phase, _ in crossings]), all_codes

    def dataset(self, samples_per_period: int = 256, orbit: Any = None) -> xr.Dataset:
        """Return time history, harmonics, multipliers and stability of the motion as a dataset.

        With an exact `orbit` (`gearlib.periodic_orbit`) the errors against it are added.
        """
        x, v = self.courses(samples_per_period)
        contact = [contact_of(self.pair.backlash_ratio, a, b) for a, b in zip(x, v, strict=True)]
        factors, _ = self._real_factors()
        data = {
            "displacement": ("phase", x),
            "velocity": ("phase", v),
            "contact": ("phase", np.array(contact, np.int8)),
            "cosine": ("harmonic", factors.real),
            "sine": ("harmonic", -factors.imag),
            "multiplier_real": ("multiplier", self.multipliers.real),
            "multiplier_imaginary": ("multiplier", self.multipliers.imag),
            "stable": np.int8(self.stable),
            "equation_residual": self.residual,
            "iterations": np.int32(self.iterations),
            "evaluations": np.int64(self.evaluations),
            "period": np.int32(self.period),
            "tuning": self.tuning,
            **self._method_variables(),
        }
        if orbit is not None:
            differences = errors(self, orbit)
            data |= {f"{name}_error": value for name, value in differences._asdict().items()}
        phase = np.arange(x.size) * (2.0 * np.pi / samples_per_period)
        return result(
            "Periodic motion of a gear mesh over harmonics",
            self.pair,
            data,
            {"phase": phase, "harmonic": self.orders},
            method=self.method,
            tuning=self.tuning,
            harmonics=self.harmonics,
            samples=self.samples,
        )

    def _method_variables(self) -> dict:
        """Return the variables that a method adds to the dataset: none in general."""
        return {}


class Errors(NamedTuple):
    """Largest differences of a periodic solution from the exact orbit."""

    displacement: float  #: over the period, static deflections
    velocity: float  #: difference of dx/dtau over the period
    state: float  #: difference at tau = 0, the larger of displacement and dx/dtau
    event: float  #: difference of phases of flank crossings, rad; NaN if contacts differ or none is
    multiplier: float  #: difference of the largest |Floquet multiplier|


def errors(solution: PeriodicSolution, orbit: Any = None) -> Errors:
    """Return the differences of a `PeriodicSolution` from an exact `Orbit`.

    Without an orbit, it is computed by shooting from the state of the solution.
    """
    if orbit is None:
        orbit = periodic_orbit(
            solution.pair, solution.tuning, guess=solution.state, period=solution.period
        )
    count = max(_MIN_PHASES, _PHASES_PER_HARMONIC * solution.harmonics // solution.period)
    exact_x, exact_v, exact_phases, exact_codes = exact_motion(orbit, count)
    x, v = solution.courses(count)
    phases, codes = solution.crossings()
    event = np.nan
    if phases.size and np.array_equal(codes, exact_codes):
        event = float(np.abs(phases - exact_phases).max())
    largest = np.abs(orbit.multipliers).max()
    return Errors(
        float(np.abs(x - exact_x).max()),
        float(np.abs(v - exact_v).max()),
        float(np.abs(solution.state - orbit.state).max()),
        event,
        float(abs(np.abs(solution.multipliers).max() - largest)),
    )


def exact_motion(orbit: Any, samples_per_period: int) -> tuple:
    """Return (displacement, dx/dtau, phases of contact events, codes) of an exact `Orbit`.

    The codes, shape (events, 2), are the contact codes before and after each event.
    """
    run = simulate(
        orbit.pair,
        orbit.tuning,
        periods=orbit.period,
        record_periods=orbit.period,
        samples_per_period=samples_per_period,
        initial_state=tuple(orbit.state),
    )
    codes = np.column_stack([run.event_from.values, run.event_to.values])
    return run.displacement.values, run.velocity.values, run.event_phase.values, codes


def hill_multipliers(
    equation: MeshEquation, coefficients: np.ndarray, harmonics: int = _MAX_VARIATION_HARMONICS
) -> np.ndarray:
    """Return the two Floquet multipliers of a motion by Hill's method, largest first.

    `coefficients` are the harmonics of the motion; deviations have at most `harmonics` harmonics.
    """
    highest = min(equation.harmonics, harmonics)
    k = np.arange(-highest, highest + 1)
    variation = equation.variation(coefficients)
    a, h, b = (np.fft.fft(values, norm="forward")[k[:, None] - k] for values in variation)
    # With u = (l + i k) y + h y the problem is linear in l for (y, u).
    derivative = np.diag(1j * k / equation.period)
    matrix = np.block([[-derivative - h, np.eye(k.size)], [a @ h - b, -derivative - a]])
    # By Liouville's formula the two exponents lie on either side of minus half the mean damping;
    # their copies lie farther away.
    mean_damping = np.mean(variation[0] + variation[1])
    start = np.exp(-np.abs(np.tile(k, 2))).astype(complex)
    shift = -mean_damping / 2.0 + _SHIFT_OFFSET
    count = min(_CANDIDATES, 2 * k.size - 2)
    try:
        exponents, vectors = eigs(matrix, count, sigma=shift, v0=start, maxiter=_MAX_RESTARTS)
    except ArpackNoConvergence:
        # The copies of strongly damped exponents are nearly equally far from the shift.
        exponents, vectors = np.linalg.eig(matrix)
    power = np.abs(vectors[: k.size]) ** 2
    asymmetry = np.abs(k @ power) / power.sum(axis=0)
    length = 2.0 * np.pi * equation.period
    candidates = np.exp(length * exponents[np.argsort(asymmetry, kind="stable")])
    first, others = candidates[0], candidates[1:]
    liouville_product = np.exp(-length * mean_damping)
    differences = np.abs(first * others - liouville_product)
    multipliers = np.array([first, others[int(np.argmin(differences))]])
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]
