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
#: Signs with which contact at the far flank adds to the six rows of `_flank` at the near one.
_FAR_SIGNS = np.array([1.0, -1.0, -1.0, -1.0, 1.0, 1.0])[:, None]


class Force(NamedTuple):
    """Forces f on the grid and their derivatives, shape (samples,)."""

    value: np.ndarray
    slope: np.ndarray  #: derivative of the mesh force by displacement
    impulse: np.ndarray  #: derivative by displacement of damping that jumps at a flank line
    by_velocity: np.ndarray
    share: np.ndarray  #: of contact, 0 to 1


class MeshEquation:
    """The equation of one gear pair at one tuning, on harmonics 0 ... `harmonics` of 1 / period.

    `samples` are grid points over the period; None: a power of two, at least 16 per harmonic.
    `added_damping` is a linear damping force added_damping x' in all motions.
    """

    def __init__(self, model, tuning, harmonics, samples=None, period=1, added_damping=0.0):
        self.pair, self.tuning = model, tuning
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
        #: Mean mesh stiffness, and the load: 1 / nu^2.
        self.unit = 1.0 / tuning**2
        #: Linear damping 2 beta / nu of the flanks in contact.
        self.rate = float(self.law.drive_damping[0])
        #: The mean-stiffness oscillator on the harmonics, 1 / nu^2 - k^2 + 2 i beta k / nu.
        self.symbol = self.unit - self.orders**2 + 1j * self.rate * self.orders

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Stiffness c / nu^2 on the grid, without harmonics above the highest of the grid."""
        spectrum = np.zeros(self.samples // 2 + 1, complex)
        highest = (self.samples - 1) // 2 // self.period
        coefficients = _stiffness_coefficients(self.law, highest)
        spectrum[: highest * self.period + 1 : self.period] = coefficients
        return np.fft.irfft(spectrum * self.samples, self.samples)

    def on_grid(self, coefficients: np.ndarray) -> np.ndarray:
        """Transform harmonics, shape (..., harmonics + 1), to the grid, shape (..., samples)."""
        return np.fft.irfft(coefficients, self.samples, norm="forward")

    def to_harmonics(self, values: np.ndarray) -> np.ndarray:
        """Transform values on the grid to harmonics; those above the highest are dropped."""
        return np.fft.rfft(values, norm="forward")[..., : self.harmonics + 1]

    def motion(self, coefficients: np.ndarray) -> tuple:
        """Return displacement and dx/dtau on the grid of a motion given by its harmonics."""
        return self.on_grid(coefficients), self.on_grid(1j * self.orders * coefficients)

    def force(self, coefficients: np.ndarray) -> Force:
        """Return the `Force` on the grid, damping and mesh, of a motion given by its harmonics."""
        law, (x, v) = self.law, self.motion(coefficients)
        step = 2.0 * np.pi * self.period / self.samples
        contact = _flank(x, v, step) + _FAR_SIGNS * _flank(-(x + law.backlash), -v, step)
        share, share_x, share_v, depth, depth_x, depth_v = contact
        material, material_v = _damping(law.drive_damping, v)
        oil, oil_v = _damping(law.backlash_damping, v)
        p2, p3 = law.stiffness_powers
        mesh = depth * (1.0 + p2 * np.abs(depth) + p3 * depth**2)
        slope = self.stiffness * (1.0 + 2.0 * p2 * np.abs(depth) + 3.0 * p3 * depth**2)
        return Force(
            oil + share * (material - oil) + self.stiffness * mesh,
            slope * depth_x,
            share_x * (material - oil),
            oil_v + share * (material_v - oil_v) + share_v * (material - oil) + slope * depth_v,
            share,
        )

    def variation(self, coefficients: np.ndarray) -> tuple:
        """Return (a, h, b) on the grid for small deviations, y'' + a y' + (h y)' + b y = 0.

        Damping that jumps at a flank line would leave an impulse in b where y' jumps, a product
        that no grid can represent. With the jump j(v), p = j / v and contact H,

            H' j y / v + H j_v y' = (H p y)' - H p' y + H (j_v - p) y'

        has no impulse: with linear damping the last two terms vanish.
        """
        force, law = self.force(coefficients), self.law
        v, share = self.motion(coefficients)[1], force.share
        jump = law.drive_damping - law.backlash_damping
        acceleration = self.on_grid(self.excitation) - force.value
        return (
            _damping(law.backlash_damping, v)[1]
            + share * (jump[1] * np.abs(v) + 2.0 * jump[2] * v**2),
            share * (jump[0] + jump[1] * np.abs(v) + jump[2] * v**2),
            force.slope - share * (jump[1] * np.sign(v) + 2.0 * jump[2] * v) * acceleration,
        )

    def residual(self, coefficients: np.ndarray, force: Force) -> np.ndarray:
        """Return the residual x'' + f - e on the harmonics."""
        inertia = -(self.orders**2) * coefficients
        return inertia + self.to_harmonics(force.value) - self.excitation

    def size(self, residual: np.ndarray) -> float:
        """Return the largest value of a residual over the period, relative to the load."""
        return float(np.abs(self.on_grid(residual)).max() / self.unit)

    def jacobian(self, force: Force) -> np.ndarray:
        """Return the derivative of the residual by the harmonics, both as `real_parts`."""
        k = np.arange(self.harmonics + 1)
        by_x = np.fft.fft(force.slope + force.impulse, norm="forward")
        by_v = np.fft.fft(force.by_velocity, norm="forward")
        rate, differences, sums = 1j * self.orders, k[:, None] - k, k[:, None] + k
        direct = by_x[differences] + by_v[differences] * rate - np.diag(self.orders**2)
        conjugate = by_x[sums] - by_v[sums] * rate
        conjugate[:, 0] = 0.0
        changes = np.hstack([direct + conjugate, 1j * (direct - conjugate)[:, 1:]])
        return real_parts(changes.T).T

    def weights(self, force: Force) -> np.ndarray:
        """Return a bound of the factor by which each harmonic of the kernel enlarges a deviation.

        |G_k| (sup |n_x| + k sup |n_v|), where n = f - 2 d x' - w^2 x is the force that the
        mean-stiffness oscillator lacks, n_x and n_v its derivatives. Damping that jumps at a flank
        line counts by n_v alone: its deviation is the derivative of (jump of damping) times y.
        """
        by_x = np.abs(force.slope - self.unit).max()
        by_v = np.abs(force.by_velocity - self.rate).max()
        with np.errstate(divide="ignore"):
            return (by_x + self.orders * by_v) / np.abs(self.symbol)


def default_samples(harmonics: int) -> int:
    """Return the default number of grid points: a power of two, at least 16 per harmonic."""
    return 1 << int(np.ceil(np.log2(_DEFAULT_SAMPLES * max(harmonics, 1))))


def real_parts(coefficients: np.ndarray) -> np.ndarray:
    """Return the real parts of harmonics 0 ... h, then the imaginary parts of 1 ... h."""
    return np.concatenate([coefficients.real, coefficients[..., 1:].imag], axis=-1)


def from_real_parts(parts: np.ndarray) -> np.ndarray:
    """Return complex harmonics from their `real_parts`."""
    half = parts.shape[-1] // 2 + 1
    coefficients = parts[..., :half].astype(complex)
    coefficients[..., 1:] += 1j * parts[..., half:]
    return coefficients


def _flank(x: np.ndarray, v: np.ndarray, step: float) -> np.ndarray:
    """Return contact with a flank at x = 0, touched for x > 0, on a grid of phases.

    Rows: share of contact, its derivatives by x and v, elastic deflection, its derivatives. The
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
    """Return the damping force d1 v + d2 |v| v + d3 v^3 and its derivative by v."""
    size = np.abs(v)
    return v * (d[0] + d[1] * size + d[2] * v**2), d[0] + 2.0 * d[1] * size + 3.0 * d[2] * v**2


def _stiffness_coefficients(law: Any, highest: int) -> np.ndarray:
    """Return the exact complex Fourier coefficients 0 ... `highest` of c / nu^2 of a `Law`.

    They follow from the jumps of value and slope between the linear pieces.
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
