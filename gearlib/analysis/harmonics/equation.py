"""The mesh equation over harmonics: its forces on a grid of phases, with their derivatives.

In static deflections and mesh phase, Eq. (3) for one degree of freedom reads

    x'' + f(tau, x, x') = e(tau),    f = damping + c(tau) k(g(x)) / nu^2,

sought with a period of n mesh periods: x = sum_k X_k exp(i k tau / n). Forces are evaluated on a
grid of phases and transformed to harmonics by FFT (alternating frequency and time).

The mesh stiffness has its exact Fourier coefficients up to the highest harmonic of the grid, so
that without loss of contact the products are those of Galerkin's method, free of aliasing. At a
flank line the contact is the share of the grid cell in which the flanks touch, with a motion that
is linear within the cell: forces stay continuous in (x, x') where damping jumps, Newton's method
has a derivative, and the jump is an impulse in that derivative.
"""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

#: Smallest number of samples per harmonic: the product of c and x is then free of aliasing.
MIN_SAMPLES = 4
#: Samples per harmonic by default: the grid then resolves flank crossings.
_DEFAULT_SAMPLES = 16
#: Smallest width of a flank crossing, which avoids a division by zero.
_MIN_WIDTH = 1e-300
#: Signs with which contact at the far flank is added to the six rows of `_contact` at the near one.
_FAR_SIGNS = np.array([1.0, -1.0, -1.0, -1.0, 1.0, 1.0])[:, None]


class Force(NamedTuple):
    """Forces f on the grid and their derivatives, shape (samples,)."""

    value: np.ndarray
    slope: np.ndarray  #: derivative of the mesh force by displacement
    impulse: np.ndarray  #: derivative by displacement of damping that jumps at a flank line
    by_velocity: np.ndarray  #: derivative by velocity
    contact_share: np.ndarray  #: share of contact, 0 to 1


class MeshEquation:
    """The equation of one gear pair at one tuning, on harmonics 0 ... `harmonics` of 1 / period.

    `samples` are grid points over the period; None: a power of two, at least 16 per harmonic.
    `added_damping` is a linear damping force added_damping x' in all motions.
    """

    def __init__(
        self,
        model: Any,
        tuning: float,
        harmonics: int,
        samples: int | None = None,
        period: int = 1,
        added_damping: float = 0.0,
    ):
        self.model, self.tuning = model, tuning
        self.harmonics, self.period = harmonics, period
        self.samples = samples or default_samples(harmonics)
        law, linear_damping = model.law(tuning), np.array([added_damping, 0.0, 0.0])
        self.law = law._replace(
            drive_damping=law.drive_damping + linear_damping,
            backlash_damping=law.backlash_damping + linear_damping,
        )
        #: Orders of the harmonics in the mesh phase: k / period.
        self.orders = np.arange(harmonics + 1) / period
        self.excitation = np.zeros(harmonics + 1, complex)
        for order, cosine, sine in law.force_harmonics:
            k = int(order) * period
            if k <= harmonics:
                self.excitation[k] += cosine if k == 0 else (cosine - 1j * sine) / 2.0
        #: Mean mesh stiffness 1 / nu^2, which is also the load.
        self.mean_stiffness = 1.0 / tuning**2
        #: Linear damping 2 beta / nu of the flanks in contact.
        self.damping = float(self.law.drive_damping[0])
        #: The mean-stiffness oscillator on the harmonics, 1 / nu^2 - k^2 + 2 i beta k / nu.
        self.symbol = self.mean_stiffness - self.orders**2 + 1j * self.damping * self.orders

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Mesh stiffness c / nu^2 on the grid of phases, from the harmonics that the grid holds."""
        spectrum = np.zeros(self.samples // 2 + 1, complex)
        highest = (self.samples - 1) // 2 // self.period
        coefficients = _stiffness_coefficients(self.law, highest)
        spectrum[: highest * self.period + 1 : self.period] = coefficients
        return np.fft.irfft(spectrum * self.samples, self.samples)

    def on_grid(self, coefficients: np.ndarray) -> np.ndarray:
        """Return values on the grid, shape (..., samples), of harmonics, shape (..., h + 1)."""
        return np.fft.irfft(coefficients, self.samples, norm="forward")

    def to_harmonics(self, values: np.ndarray) -> np.ndarray:
        """Return the harmonics 0 ... h of values on the grid of phases, shape (..., samples)."""
        return np.fft.rfft(values, norm="forward")[..., : self.harmonics + 1]

    def motion(self, coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (displacement, dx/dtau) on the grid of a motion given by its harmonics."""
        return self.on_grid(coefficients), self.on_grid(1j * self.orders * coefficients)

    def force(self, coefficients: np.ndarray) -> Force:
        """Return the `Force` on the grid, damping and mesh, of a motion given by its harmonics."""
        law, (x, v) = self.law, self.motion(coefficients)
        step = 2.0 * np.pi * self.period / self.samples
        near, far = _contact(x, v, step), _contact(-(x + law.backlash), -v, step)
        # The suffixes _x and _v stand for derivatives by displacement and velocity.
        share, share_x, share_v, deflection, deflection_x, deflection_v = near + _FAR_SIGNS * far
        material, material_v = _damping(law.drive_damping, v)
        oil, oil_v = _damping(law.backlash_damping, v)
        p2, p3 = law.stiffness_powers
        size = np.abs(deflection)
        mesh_force = self.stiffness * (deflection * (1.0 + p2 * size + p3 * deflection**2))
        slope = self.stiffness * (1.0 + 2.0 * p2 * size + 3.0 * p3 * deflection**2)
        damping_v = oil_v + share * (material_v - oil_v) + share_v * (material - oil)
        return Force(
            value=oil + share * (material - oil) + mesh_force,
            slope=slope * deflection_x,
            impulse=share_x * (material - oil),
            by_velocity=damping_v + slope * deflection_v,
            contact_share=share,
        )

    def variation(self, coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return (a, h, b) on the grid for small deviations y from a motion given by its harmonics.

        They obey y'' + a y' + (h y)' + b y = 0. Damping that jumps at a flank line would leave an
        impulse in b where y' jumps, a product that no grid can represent. With the jump j(v),
        p = j / v and contact H,

            H' j y / v + H j_v y' = (H p y)' - H p' y + H (j_v - p) y'

        has no impulse: with linear damping the last two terms vanish.
        """
        force, law = self.force(coefficients), self.law
        v, share = self.motion(coefficients)[1], force.contact_share
        # Coefficients of the powers 1 to 3 of the velocity in the jump of the damping force.
        jump = law.drive_damping - law.backlash_damping
        acceleration = self.on_grid(self.excitation) - force.value
        return (
            _damping(law.backlash_damping, v)[1]
            + share * (jump[1] * np.abs(v) + 2.0 * jump[2] * v**2),
            share * (jump[0] + jump[1] * np.abs(v) + jump[2] * v**2),
            force.slope - share * (jump[1] * np.sign(v) + 2.0 * jump[2] * v) * acceleration,
        )

    def residual(self, coefficients: np.ndarray, force: Force) -> np.ndarray:
        """Return the residual x'' + f - e on harmonics 0 ... h, for a motion and its force."""
        inertia = -(self.orders**2) * coefficients
        return inertia + self.to_harmonics(force.value) - self.excitation

    def size(self, residual: np.ndarray) -> float:
        """Return the largest value over the period of a residual on harmonics, in loads."""
        return float(np.abs(self.on_grid(residual)).max() / self.mean_stiffness)

    def jacobian(self, force: Force) -> np.ndarray:
        """Return the derivative of the residual by the harmonics, shape (2 h + 1, 2 h + 1).

        Both are real and imaginary parts as in `real_parts`; `force` is that of the motion.
        """
        k = np.arange(self.harmonics + 1)
        by_x = np.fft.fft(force.slope + force.impulse, norm="forward")
        by_v = np.fft.fft(force.by_velocity, norm="forward")
        derivative, differences, sums = 1j * self.orders, k[:, None] - k, k[:, None] + k
        direct = by_x[differences] + by_v[differences] * derivative - np.diag(self.orders**2)
        conjugate = by_x[sums] - by_v[sums] * derivative
        conjugate[:, 0] = 0.0
        changes = np.hstack([direct + conjugate, 1j * (direct - conjugate)[:, 1:]])
        return real_parts(changes.T).T

    def weights(self, force: Force) -> np.ndarray:
        """Return bounds of the factors by which the kernel enlarges deviations, shape (h + 1,).

        The bound on harmonic k is
        |G_k| (sup |n_x| + k sup |n_v|), where n = f - 2 d x' - w^2 x is the force that the
        mean-stiffness oscillator lacks, n_x and n_v its derivatives. Damping that jumps at a flank
        line counts by n_v alone: its deviation is the derivative of (jump of damping) times y.
        `force` is that of the motion.
        """
        by_x = np.abs(force.slope - self.mean_stiffness).max()
        by_v = np.abs(force.by_velocity - self.damping).max()
        with np.errstate(divide="ignore"):
            return (by_x + self.orders * by_v) / np.abs(self.symbol)


def default_samples(harmonics: int) -> int:
    """Return the default number of grid points: a power of two, at least 16 per harmonic."""
    return 1 << int(np.ceil(np.log2(_DEFAULT_SAMPLES * max(harmonics, 1))))


def real_parts(coefficients: np.ndarray) -> np.ndarray:
    """Return the real parts of harmonics 0 ... h, then the imaginary parts of 1 ... h."""
    return np.concatenate([coefficients.real, coefficients[..., 1:].imag], axis=-1)


def from_real_parts(parts: np.ndarray) -> np.ndarray:
    """Return complex harmonics 0 ... h from their `real_parts`, shape (..., 2 h + 1)."""
    half = parts.shape[-1] // 2 + 1
    coefficients = parts[..., :half].astype(complex)
    coefficients[..., 1:] += 1j * parts[..., half:]
    return coefficients


def _contact(x: np.ndarray, v: np.ndarray, step: float) -> np.ndarray:
    """Return contact with a flank at x = 0, touched for x > 0, on a grid of phases, shape (6, n).

    The rows are the share of contact, its derivatives by displacement x and velocity v, the
    elastic deflection and its derivatives. `step` is the width of a grid cell in rad. The
    deflection is the mean over a grid cell. The share of contact is weighted with a hat function
    over two cells: its derivative, an impulse, then has the right position between two points.
    """
    width = np.maximum(np.abs(v) * step, _MIN_WIDTH)
    width_v = np.sign(v) * step
    u = np.clip(x / width, -1.0, 1.0)
    share = np.where(u < 0.0, 0.5 * (1.0 + u) ** 2, 1.0 - 0.5 * (1.0 - u) ** 2)
    slope = (1.0 - np.abs(u)) / width
    touching = np.clip(0.5 + x / width, 0.0, 1.0)
    is_crossed = (touching > 0.0) & (touching < 1.0)
    depth = np.where(is_crossed, 0.5 * width * touching**2, np.maximum(x, 0.0))
    depth_v = 0.5 * touching * (1.0 - touching) * width_v
    return np.array([share, slope, -slope * u * width_v, depth, touching, depth_v])


def _damping(d: np.ndarray, v: np.ndarray) -> tuple:
    """Return the damping force d1 v + d2 |v| v + d3 v^3 at velocities v, and its derivative."""
    d1, d2, d3 = d
    speed = np.abs(v)
    return v * (d1 + d2 * speed + d3 * v**2), d1 + 2.0 * d2 * speed + 3.0 * d3 * v**2


def _stiffness_coefficients(law: Any, highest: int) -> np.ndarray:
    """Return the exact complex Fourier coefficients 0 ... `highest` of the stiffness c / nu^2.

    They follow from the jumps of value and slope between the linear pieces of `law`, a `Law`, and
    from its harmonics.
    """
    n = np.arange(1, highest + 1)
    lengths = np.diff(law.segment_bounds)
    ends = law.stiffness_lines[:, 0] + law.stiffness_lines[:, 1] * lengths
    coefficients = np.zeros(highest + 1, complex)
    coefficients[0] = np.sum((law.stiffness_lines[:, 0] + ends) / 2.0 * lengths) / (2.0 * np.pi)
    jumps = law.stiffness_lines[:, 0] - np.roll(ends, 1)
    slope_jumps = law.stiffness_lines[:, 1] - np.roll(law.stiffness_lines[:, 1], 1)
    for phase, jump, slope_jump in zip(law.segment_bounds[:-1], jumps, slope_jumps, strict=True):
        wave = np.exp(-1j * n * phase) / (2.0 * np.pi)
        coefficients[1:] += wave * (jump / (1j * n) - slope_jump / n**2)
    for order, cosine, sine in law.stiffness_harmonics:
        if order <= highest:
            coefficients[int(order)] += (cosine - 1j * sine) / 2.0
    return coefficients
