"""The mesh equation in the frequency domain: forces on a grid of phases and their derivatives.

In static deflections and mesh phase, Eq. (3) for one degree of freedom reads

    x'' + f(tau, x, x') = e(tau),    f = damping + c(tau) k(g(x)) / nu^2.

A motion with a period of n mesh periods is x = sum_k X_k exp(i k tau / n). Forces are evaluated on
a grid of phases and transformed to harmonics by FFT (alternating frequency/time method).

The mesh stiffness has its exact Fourier coefficients up to the highest harmonic of the grid, so
that without loss of contact products are exact as in Galerkin's method, free of aliasing. At a
flank line the contact is the fraction of the grid cell in which the flanks touch; the motion counts
as linear within the cell. Forces are therefore continuous in (x, x') even where damping jumps,
Newton's method has a derivative, and the jump is an impulse in this derivative.
"""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

#: Smallest number of samples per harmonic that avoids aliasing of the product of c and x.
MIN_SAMPLES = 4
#: Default number of samples per harmonic, which resolves flank crossings.
_DEFAULT_SAMPLES = 16
#: Lower bound of the change of displacement in a grid cell, which avoids a division by zero.
_MIN_CHANGE = 1e-300
#: Signs with which the six rows of `_flank_contact` of the coast-side flank are added to those of
#: the drive side: its displacement and velocity are reversed, and so is its deflection.
_COAST_SIGNS = np.array([1.0, -1.0, -1.0, -1.0, 1.0, 1.0])[:, None]


class Force(NamedTuple):
    """Force f at the grid points and its derivatives, each of shape (samples,)."""

    value: np.ndarray  #: sum of mesh and damping force
    stiffness: np.ndarray  #: derivative of the mesh force with respect to displacement
    impulse: np.ndarray  #: derivative of the damping force with respect to displacement
    damping: np.ndarray  #: derivative of mesh and damping force with respect to velocity
    contact_fraction: np.ndarray  #: fraction of contact in the grid cell, 0 to 1


class MeshEquation:
    """Equation of motion of a gear pair at one tuning, for the harmonics 0 ... h of a motion.

    Harmonics are complex coefficients X_k of exp(i k tau / period), k = 0 ... h. Displacements are
    in units of the static deflection.
    """

    def __init__(
        self, model: Any, tuning, harmonics: int, samples=None, period: int = 1, added_damping=0.0
    ):
        """Set up the equation of a gear pair for motions with h harmonics and a given period.

        `model` is a `GearPair` or `OneDegreePair`, `tuning` the ratio of mesh frequency to natural
        frequency, h = `harmonics` the highest harmonic and `period` the number of mesh periods
        after which the motion repeats. `samples` is the number of grid points over the period, by
        default a power of two with at least 16 points per harmonic. `added_damping` is added to the
        coefficient of dx/dtau, with and without contact; tau is the mesh phase.
        """
        self.model, self.tuning = model, tuning
        self.harmonics, self.period = harmonics, period
        self.samples = samples or default_samples(harmonics)
        mesh = model.nonlinear_mesh(tuning)
        linear_damping = np.array([added_damping, 0.0, 0.0])  # the terms v, |v| v and v^3
        self.mesh = mesh._replace(
            drive_damping=mesh.drive_damping + linear_damping,
            backlash_damping=mesh.backlash_damping + linear_damping,
        )
        #: Orders of the harmonics in the mesh phase: k / period.
        self.orders = np.arange(harmonics + 1) / period
        self.excitation = np.zeros(harmonics + 1, complex)
        # The complex coefficient of a harmonic is (cosine - i sine) / 2.
        for order, cosine, sine in mesh.force_harmonics:
            k = int(order) * period
            if k <= harmonics:
                self.excitation[k] += cosine if k == 0 else (cosine - 1j * sine) / 2.0
        #: Mean mesh stiffness 1 / nu^2, which equals the dimensionless load.
        self.mean_stiffness = 1.0 / tuning**2
        #: Linear damping coefficient 2 beta / nu in contact.
        self.damping = float(self.mesh.drive_damping[0])
        #: Dynamic stiffness of the mean oscillator, 1 / nu^2 - k^2 + 2 i beta k / nu, (h + 1,).
        inertia, damping = self.orders**2, 1j * self.damping * self.orders
        self.dynamic_stiffness = self.mean_stiffness - inertia + damping

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Mesh stiffness c / nu^2 at the grid points over the period, shape (samples,).

        c is relative to its mean, and nu is the tuning, mesh frequency / natural frequency. The
        stiffness is a truncated Fourier series with all harmonics that the grid can represent.
        """
        spectrum = np.zeros(self.samples // 2 + 1, complex)
        max_harmonic = (self.samples - 1) // 2 // self.period
        coefficients = _stiffness_coefficients(self.mesh, max_harmonic)
        spectrum[: max_harmonic * self.period + 1 : self.period] = coefficients
        return np.fft.irfft(spectrum * self.samples, self.samples)

    def to_grid(self, coefficients: np.ndarray) -> np.ndarray:
        """Convert harmonics, shape (..., h + 1), to values at grid points, shape (..., samples)."""
        return np.fft.irfft(coefficients, self.samples, norm="forward")

    def to_harmonics(self, values: np.ndarray) -> np.ndarray:
        """Convert values at grid points, shape (..., samples), to harmonics, shape (..., h + 1)."""
        return np.fft.rfft(values, norm="forward")[..., : self.harmonics + 1]

    def motion(self, coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (displacement, dx/dtau) at the grid points for the harmonics of a motion."""
        return self.to_grid(coefficients), self.to_grid(1j * self.orders * coefficients)

    def force(self, coefficients: np.ndarray) -> Force:
        """Evaluate mesh and damping force of a motion, and their derivatives, at the grid points.

        `coefficients` are the complex harmonics of the motion, shape (h + 1,).
        """
        mesh = self.mesh
        x, v = self.motion(coefficients)
        step = 2.0 * np.pi * self.period / self.samples
        coast_deflection = -(x + mesh.backlash_ratio)  # positive in coast-side contact
        # The drive flank touches where x > 0, the coast flank where x < -backlash.
        contact = _flank_contact(x, v, step) + _COAST_SIGNS * _flank_contact(
            coast_deflection, -v, step
        )
        # The suffixes _x and _v denote derivatives with respect to displacement and velocity.
        fraction, fraction_x, fraction_v, deflection, deflection_x, deflection_v = contact
        # The damping force jumps by the difference between contact and free flight.
        contact_damping, contact_damping_v = _damping_force(mesh.drive_damping, v)
        free_damping, free_damping_v = _damping_force(mesh.backlash_damping, v)
        jump, jump_v = contact_damping - free_damping, contact_damping_v - free_damping_v
        # The mesh force at the deflection d is c (d + p2 |d| d + p3 d^3) / nu^2.
        p2, p3 = mesh.stiffness_powers
        magnitude = np.abs(deflection)
        mesh_force = self.stiffness * (deflection * (1.0 + p2 * magnitude + p3 * deflection**2))
        tangent = self.stiffness * (1.0 + 2.0 * p2 * magnitude + 3.0 * p3 * deflection**2)
        damping_v = free_damping_v + fraction * jump_v + fraction_v * jump
        return Force(
            value=free_damping + fraction * jump + mesh_force,
            stiffness=tangent * deflection_x,
            impulse=fraction_x * jump,
            damping=damping_v + tangent * deflection_v,
            contact_fraction=fraction,
        )

    def variational_coefficients(self, coefficients: np.ndarray) -> tuple:
        """Return the coefficients (a, h, b) of the variational equation at the grid points.

        Small perturbations y of the motion with the complex harmonics `coefficients` obey
        y'' + a y' + (h y)' + b y = 0. If the damping jumps where contact begins, b would contain an
        impulse at a jump of y', which cannot be represented on a grid. Let j(v) = p(v) v be the
        jump of the damping force, j_v its derivative, and H = 1 in contact and 0 otherwise. The
        identity

            H' j y / v + H j_v y' = (H p y)' - H p' y + H (j_v - p) y'

        avoids the impulse H'. Its right side adds H p to h, H (j_v - p) to a and -H p' to b.
        """
        force, mesh = self.force(coefficients), self.mesh
        contact = force.contact_fraction
        _, v = self.motion(coefficients)
        # p = p1 + p2 |v| + p3 v^2
        p1, p2, p3 = mesh.drive_damping - mesh.backlash_damping
        acceleration = self.to_grid(self.excitation) - force.value
        _, free_damping_v = _damping_force(mesh.backlash_damping, v)
        a = free_damping_v + contact * (p2 * np.abs(v) + 2.0 * p3 * v**2)
        h = contact * (p1 + p2 * np.abs(v) + p3 * v**2)
        b = force.stiffness - contact * (p2 * np.sign(v) + 2.0 * p3 * v) * acceleration
        return a, h, b

    def residual(self, coefficients: np.ndarray, force: Force) -> np.ndarray:
        """Return the harmonics of the residual x'' + f - e of the equation, shape (h + 1,).

        `coefficients` are the complex harmonics of the motion x, and `force` contains the mesh and
        damping force f along this motion. e is the excitation, including the constant load.
        """
        inertia = -(self.orders**2) * coefficients
        return inertia + self.to_harmonics(force.value) - self.excitation

    def max_residual(self, residual: np.ndarray) -> float:
        """Return the largest residual of the equation over the period, relative to the load.

        `residual` are the complex harmonics of the residual, shape (h + 1,).
        """
        return float(np.abs(self.to_grid(residual)).max() / self.mean_stiffness)

    def jacobian(self, force: Force) -> np.ndarray:
        """Return the Jacobian matrix of the residual, shape (2 h + 1, 2 h + 1).

        `force` is the force along the motion with its derivatives. Rows (residual) and columns
        (motion) are ordered as in `real_vector`.
        """
        k = np.arange(self.harmonics + 1)
        stiffness = np.fft.fft(force.stiffness + force.impulse, norm="forward")
        damping = np.fft.fft(force.damping, norm="forward")
        derivative = 1j * self.orders  # multiplies harmonics to differentiate with respect to tau
        differences, sums = k[:, None] - k, k[:, None] + k
        # Harmonic k of the stiffness couples harmonic j of the motion to harmonic j + k of the
        # force. Harmonic -j of the motion is the complex conjugate of harmonic j.
        direct = stiffness[differences] + damping[differences] * derivative
        direct -= np.diag(self.orders**2)
        conjugate = stiffness[sums] - damping[sums] * derivative
        conjugate[:, 0] = 0.0  # the mean has no conjugate
        columns = np.hstack([direct + conjugate, 1j * (direct - conjugate)[:, 1:]])
        return real_vector(columns.T).T

    def amplification_bounds(self, force: Force) -> np.ndarray:
        """Return bounds of the amplification of errors by successive approximation, (h + 1,).

        A successive approximation is the response of the linear oscillator with the mean stiffness
        and the receptance G to the excess force n, the `force` along the motion minus the linear
        force. If n_x and n_v are the derivatives of n with respect to displacement and velocity,
        the error of harmonic k is multiplied by at most |G_k| (sup |n_x| + k sup |n_v|). A jump of
        the damping at the flanks contributes only to n_v. The bound is infinite at resonance
        without damping.
        """
        excess_stiffness = np.abs(force.stiffness - self.mean_stiffness).max()
        excess_damping = np.abs(force.damping - self.damping).max()
        with np.errstate(divide="ignore"):
            bounds = excess_stiffness + self.orders * excess_damping
            return bounds / np.abs(self.dynamic_stiffness)


def default_samples(harmonics: int) -> int:
    """Return the default number of grid points over the period of a motion.

    It is a power of two, for the FFT, and at least 16 times the highest harmonic `harmonics`.
    """
    return 1 << int(np.ceil(np.log2(_DEFAULT_SAMPLES * max(harmonics, 1))))


def real_vector(coefficients: np.ndarray) -> np.ndarray:
    """Convert complex harmonics 0 ... h to real parts of 0 ... h and imaginary parts of 1 ... h.

    The last axis grows from h + 1 to 2 h + 1. Harmonic 0, the mean, is real.
    """
    return np.concatenate([coefficients.real, coefficients[..., 1:].imag], axis=-1)


def from_real_vector(vector: np.ndarray) -> np.ndarray:
    """Convert the real numbers of `real_vector` to complex harmonics 0 ... h.

    The last axis of `vector` contains the real parts of 0 ... h, then the imaginary parts of
    1 ... h.
    """
    count = vector.shape[-1] // 2 + 1
    coefficients = vector[..., :count].astype(complex)
    coefficients[..., 1:] += 1j * vector[..., count:]
    return coefficients


def _flank_contact(x: np.ndarray, v: np.ndarray, step: float) -> np.ndarray:
    """Return contact fraction and deflection of a flank at x = 0, with derivatives, shape (6, n).

    x and v are displacement and velocity at n grid points; the flank is in contact where x > 0, and
    the deflection is then x. The motion is assumed to be linear within a grid cell of width `step`
    in rad. The rows are the fraction of the cell in contact, its derivatives with respect to x and
    v, the mean deflection in the cell and its derivatives with respect to x and v. The fraction is
    averaged over two cells with triangular weights, so that the impulse of its derivative is
    located correctly between two grid points.
    """
    change = np.maximum(np.abs(v) * step, _MIN_CHANGE)  # of the displacement within a grid cell
    change_v = np.sign(v) * step
    # Distance of the grid point from the crossing in cells, limited to one cell.
    u = np.clip(x / change, -1.0, 1.0)
    fraction = np.where(u < 0.0, 0.5 * (1.0 + u) ** 2, 1.0 - 0.5 * (1.0 - u) ** 2)
    fraction_x = (1.0 - np.abs(u)) / change
    deflection_x = np.clip(0.5 + x / change, 0.0, 1.0)
    is_crossing = (deflection_x > 0.0) & (deflection_x < 1.0)
    deflection = np.where(is_crossing, 0.5 * change * deflection_x**2, np.maximum(x, 0.0))
    deflection_v = 0.5 * deflection_x * (1.0 - deflection_x) * change_v
    fraction_v = -fraction_x * u * change_v
    return np.array([fraction, fraction_x, fraction_v, deflection, deflection_x, deflection_v])


def _damping_force(coefficients: np.ndarray, v: np.ndarray) -> tuple:
    """Return the damping force d1 v + d2 |v| v + d3 v^3 and its derivative with respect to v.

    `coefficients` are (d1, d2, d3), the coefficients of linear, quadratic and cubic damping.
    """
    d1, d2, d3 = coefficients
    speed = np.abs(v)
    return v * (d1 + d2 * speed + d3 * v**2), d1 + 2.0 * d2 * speed + 3.0 * d3 * v**2


def _stiffness_coefficients(mesh: Any, max_harmonic: int) -> np.ndarray:
    """Return the exact Fourier coefficients 0 ... `max_harmonic` of a mesh stiffness c / nu^2.

    `mesh` is a `NonlinearMesh`, and nu is the tuning, mesh frequency / natural frequency. The
    stiffness is the sum of a piecewise linear function of the mesh phase and of harmonics. The
    coefficients of the piecewise linear function are found by integration by parts, from the jumps
    of its value and slope between segments.
    """
    n, phases = np.arange(1, max_harmonic + 1), mesh.segment_bounds
    lengths = np.diff(phases)
    start_values, slopes = mesh.stiffness_segments.T
    end_values = start_values + slopes * lengths
    coefficients = np.zeros(max_harmonic + 1, complex)
    coefficients[0] = np.sum((start_values + end_values) / 2.0 * lengths) / (2.0 * np.pi)
    jumps, slope_jumps = start_values - np.roll(end_values, 1), slopes - np.roll(slopes, 1)
    for phase, jump, slope_jump in zip(phases[:-1], jumps, slope_jumps, strict=True):
        wave = np.exp(-1j * n * phase) / (2.0 * np.pi)
        coefficients[1:] += wave * (jump / (1j * n) - slope_jump / n**2)
    for order, cosine, sine in mesh.stiffness_harmonics:
        if order <= max_harmonic:
            coefficients[int(order)] += (cosine - 1j * sine) / 2.0
    return coefficients
