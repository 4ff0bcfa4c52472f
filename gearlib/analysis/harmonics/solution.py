"""Periodic motions as Fourier series: time history, flank crossings, errors, multipliers, dataset.

Floquet multipliers are computed by Hill's method. Small perturbations obey
y'' + a(tau) y' + (h(tau) y)' + b(tau) y = 0 (`MeshEquation.variational_coefficients`). With
y = exp(l tau) sum_k y_k exp(i k tau / n), truncated at |k| <= K, this is a quadratic eigenvalue
problem in l with 2 (2 K + 1) eigenvalues, of which two are accurate: every exponent l has aliases
l + i k / n, with an error that grows with |k|. The two eigenvalues with the most symmetric
eigenvectors about k = 0 are selected (Lazarus, Thomas, C. R. Mecanique 338 (2010) 510-517), such
that the product of their multipliers agrees with Liouville's formula. This condition is needed for
real negative multipliers: an exponent and its conjugate are then equally symmetric, and only the
product distinguishes two multipliers from a double one.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.sparse.linalg import ArpackNoConvergence, eigs

from gearlib.analysis.harmonics.equation import MeshEquation, default_samples
from gearlib.analysis.orbits.shooting import periodic_orbit
from gearlib.data.result import make_result
from gearlib.engines.pair.motion import pair_contact_state
from gearlib.runs.simulation import simulate

#: Number of Newton steps that refine a flank crossing.
_CROSSING_STEPS = 8
#: Number of phases per mesh period at which time histories are compared: its minimum, and the
#: number per harmonic, which resolves the error next to a stiffness jump.
_MIN_PHASES, _PHASES_PER_HARMONIC = 512, 16
#: Highest harmonic of the perturbations; the cost is proportional to its third power.
_MAX_PERTURBATION_HARMONICS = 100
#: Number of computed exponents, from which two are selected.
_EXPONENT_COUNT = 8
#: Largest number of ARPACK restarts; without strong damping four are enough.
_MAX_RESTARTS = 10
#: Offset of the ARPACK shift from the mean exponent, at which a double exponent would make the
#: shifted matrix singular.
_SHIFT_OFFSET = 1e-3 + 0.7e-3j


@dataclass(frozen=True)
class PeriodicSolution:
    """Periodic motion x = X_0 + 2 Re sum_k X_k exp(i k tau / period)."""

    model: Any
    tuning: float  #: mesh frequency / mean eigenfrequency
    period: int  #: mesh periods
    method: str  #: "harmonic balance" or "schmidt"
    coefficients: np.ndarray  #: X_0 ... X_harmonics, complex, static deflections
    samples: int  #: grid points on which forces were evaluated
    residual: float  #: largest residual of the equation of motion, relative to the load
    iterations: int  #: number of Newton steps, or of applications of the kernel
    evaluations: int  #: number of evaluations of the force or its derivative at a grid point
    multipliers: np.ndarray  #: Floquet multipliers over the period by Hill's method

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
        """Whether all Floquet multipliers lie inside the unit circle."""
        return bool(np.abs(self.multipliers).max() < 1.0)

    @property
    def state(self) -> np.ndarray:
        """Displacement and dx/dtau at tau = 0, shape (2,)."""
        return np.array(self.at(0.0))

    def _one_sided_coefficients(self) -> tuple:
        """Return the one-sided Fourier coefficients of displacement and velocity dx/dtau.

        The coefficients C_k, shape (harmonics + 1,), are defined by
        x = Re sum_k C_k exp(i k tau / period) over k >= 0 with the mesh phase tau.
        """
        displacement = np.where(self.orders == 0.0, 1.0, 2.0) * self.coefficients
        return displacement, 1j * self.orders * displacement

    def at(self, phase: ArrayLike) -> tuple:
        """Return (displacement, dx/dtau) at mesh phases (rad), each of the shape of `phase`."""
        waves = np.exp(1j * np.asarray(phase, float)[..., None] * self.orders)
        return tuple((waves @ factors).real for factors in self._one_sided_coefficients())

    def time_history(self, samples_per_period: int) -> tuple:
        """Return (displacement, dx/dtau) at equal phase steps over the period of the motion.

        tau is the mesh phase, and `samples_per_period` is the number of steps per mesh period.
        """
        points = samples_per_period * self.period
        # The inverse FFT needs more than two points per harmonic; additional points are dropped.
        refinement = -(-(2 * self.harmonics + 1) // points)
        return tuple(
            np.fft.irfft(values, refinement * points, norm="forward")[::refinement]
            for values in (self.coefficients, 1j * self.orders * self.coefficients)
        )

    def crossings(self) -> tuple[np.ndarray, np.ndarray]:
        """Find the phases at which contact of the flanks begins or ends.

        At these phases the displacement crosses 0 (drive flank) or minus the backlash (coast
        flank). Return (sorted mesh phases in rad, shape (m,), contact states before and after each
        crossing, shape (m, 2)). The states are 1 for drive-side contact, 0 for no contact and -1
        for coast-side contact. Crossings are bracketed on a grid and refined by Newton's method;
        two crossings within the same grid cell are not detected.
        """
        x, _ = self.time_history(-(-default_samples(self.harmonics) // self.period))
        length = 2.0 * np.pi * self.period
        crossings = []
        # Displacement of each flank, and contact states of a downward crossing.
        flank_positions = ((0.0, (1, 0)), (-self.model.backlash_ratio, (0, -1)))
        for flank_position, downward_states in flank_positions:
            # With infinite backlash there is no coast-side contact.
            if not np.isfinite(flank_position):
                continue
            is_above = x >= flank_position
            for i in np.flatnonzero(is_above != np.roll(is_above, -1)):
                before, after = x[i] - flank_position, x[(i + 1) % x.size] - flank_position
                # Linear interpolation between the grid points is the initial guess.
                phase = (i + before / (before - after)) * length / x.size
                for _ in range(_CROSSING_STEPS):
                    displacement, velocity = self.at(phase)
                    phase -= (displacement - flank_position) / velocity if velocity else 0.0
                states = downward_states if is_above[i] else downward_states[::-1]
                crossings.append((float(phase) % length, states))
        crossings.sort()
        all_states = np.array([states for _, states in crossings], np.int8).reshape(-1, 2)
        return np.array([phase for phase, _ in crossings]), all_states

    def dataset(self, samples_per_period: int = 256, orbit: Any = None) -> xr.Dataset:
        """Return time history, harmonics, multipliers and stability of the motion as a dataset.

        The time history has `samples_per_period` points per mesh period. If an exact `orbit` of
        `gearlib.periodic_orbit` is given, the differences from this orbit are added.
        """
        x, v = self.time_history(samples_per_period)
        contact = [
            pair_contact_state(self.model.backlash_ratio, *state)
            for state in zip(x, v, strict=True)
        ]
        displacement_coefficients, _ = self._one_sided_coefficients()
        data = {
            "displacement": ("phase", x),
            "velocity": ("phase", v),
            "contact": ("phase", np.array(contact, np.int8)),
            "cosine": ("harmonic", displacement_coefficients.real),
            "sine": ("harmonic", -displacement_coefficients.imag),
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
            differences = compare_with_orbit(self, orbit)
            data |= {f"{name}_error": value for name, value in differences._asdict().items()}
        phase = np.arange(x.size) * (2.0 * np.pi / samples_per_period)
        return make_result(
            "Periodic motion of a gear mesh and its harmonics",
            self.model,
            data,
            {"phase": phase, "harmonic": self.orders},
            method=self.method,
            tuning=self.tuning,
            harmonics=self.harmonics,
            samples=self.samples,
        )

    def _method_variables(self) -> dict:
        """Return the dataset variables specific to the method; a subclass may have some."""
        return {}


class SolutionErrors(NamedTuple):
    """Largest differences between a periodic solution and the exact orbit."""

    displacement: float  #: difference of x over the period, in units of the static deflection
    velocity: float  #: difference of dx/dtau over the period
    state: float  #: difference at tau = 0, the larger of displacement and dx/dtau
    event: float  #: difference of phases of flank crossings, rad; NaN without the same crossings
    multiplier: float  #: difference of the largest |Floquet multiplier|


def compare_with_orbit(solution: PeriodicSolution, orbit: Any = None) -> SolutionErrors:
    """Return the largest differences between a `PeriodicSolution` and an exact periodic `orbit`.

    Displacement, velocity, initial state, phases of contact events and Floquet multipliers are
    compared. If `orbit` is None, it is computed by shooting from the state of the solution.
    """
    if orbit is None:
        orbit = periodic_orbit(
            solution.model, solution.tuning, guess=solution.state, period=solution.period
        )
    phases_per_period = _PHASES_PER_HARMONIC * solution.harmonics // solution.period
    samples_per_period = max(_MIN_PHASES, phases_per_period)
    exact_x, exact_v, exact_phases, exact_states = simulate_orbit(orbit, samples_per_period)
    x, v = solution.time_history(samples_per_period)
    phases, states = solution.crossings()
    # Event phases can be compared only if the same events occur in the same order.
    event_error = np.nan
    if phases.size and np.array_equal(states, exact_states):
        event_error = float(np.abs(phases - exact_phases).max())
    exact_multiplier = np.abs(orbit.multipliers).max()
    return SolutionErrors(
        float(np.abs(x - exact_x).max()),
        float(np.abs(v - exact_v).max()),
        float(np.abs(solution.state - orbit.state).max()),
        event_error,
        float(abs(np.abs(solution.multipliers).max() - exact_multiplier)),
    )


def simulate_orbit(orbit: Any, samples_per_period: int) -> tuple:
    """Return (displacement, dx/dtau, phases of contact events, contact states) of an exact `Orbit`.

    The displacement and the velocity are sampled over the period of the orbit at
    `samples_per_period` points per mesh period. Event phases are mesh phases tau in rad. The
    contact states (1 drive side, 0 none, -1 coast side) before and after each event have the shape
    (events, 2).
    """
    run = simulate(
        orbit.model,
        orbit.tuning,
        periods=orbit.period,
        record_periods=orbit.period,
        samples_per_period=samples_per_period,
        initial_state=tuple(orbit.state),
    )
    contact_states = np.column_stack([run.event_from.values, run.event_to.values])
    return run.displacement.values, run.velocity.values, run.event_phase.values, contact_states


def hill_multipliers(equation: MeshEquation, coefficients: np.ndarray) -> np.ndarray:
    """Return the two Floquet multipliers of a motion by Hill's method, largest modulus first.

    `coefficients` are the complex harmonics of the motion, shape (h + 1,), and `equation` is its
    mesh equation. Small perturbations y obey y'' + a y' + (h y)' + b y = 0 with periodic a, h and
    b. With y = exp(l phase) times a Fourier series, this is an eigenvalue problem for the exponents
    l. The multipliers are exp(l * period of the motion).
    """
    max_harmonic = min(equation.harmonics, _MAX_PERTURBATION_HARMONICS)
    k = np.arange(-max_harmonic, max_harmonic + 1)
    # These matrices map the harmonics -K ... K of y to the harmonics of a y, h y and b y.
    functions = equation.variational_coefficients(coefficients)
    a, h, b = (np.fft.fft(values, norm="forward")[k[:, None] - k] for values in functions)
    # With u = (l + i k) y + h y the problem is linear in l for (y, u).
    derivative = np.diag(1j * k / equation.period)
    matrix = np.block([[-derivative - h, np.eye(k.size)], [a @ h - b, -derivative - a]])
    # By Liouville's formula the mean of the two exponents is minus half the mean damping, from
    # which their aliases are farther away.
    mean_damping = np.mean(functions[0] + functions[1])
    # The start vector favours the low harmonics, which dominate the two true eigenvectors.
    start = np.exp(-np.abs(np.tile(k, 2))).astype(complex)
    shift = -mean_damping / 2.0 + _SHIFT_OFFSET
    count = min(_EXPONENT_COUNT, 2 * k.size - 2)  # the limit of ARPACK
    try:
        exponents, vectors = eigs(matrix, count, sigma=shift, v0=start, maxiter=_MAX_RESTARTS)
    except ArpackNoConvergence:
        # ARPACK may fail with strong damping, because exponents and aliases are equally far from
        # the shift.
        exponents, vectors = np.linalg.eig(matrix)
    # The harmonics of an alias are shifted by k, so the most symmetric spectra are not aliases.
    power = np.abs(vectors[: k.size]) ** 2
    asymmetry = np.abs(k @ power) / power.sum(axis=0)
    length = 2.0 * np.pi * equation.period
    candidates = np.exp(length * exponents[np.argsort(asymmetry, kind="stable")])
    first_multiplier, other_multipliers = candidates[0], candidates[1:]
    liouville_product = np.exp(-length * mean_damping)
    differences = np.abs(first_multiplier * other_multipliers - liouville_product)
    multipliers = np.array([first_multiplier, other_multipliers[int(np.argmin(differences))]])
    return multipliers[np.argsort(-np.abs(multipliers), kind="stable")]
