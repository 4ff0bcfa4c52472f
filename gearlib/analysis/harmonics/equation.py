"""The mesh equation over harmonics: its forces on a grid of phases, with their derivatives.

In static deflections and mesh phase, Eq. (3) for one degree of freedom reads

    x'' + f(tau, x, x') = e(tau),    f = damping + c(tau) k(g(x)) / nu^2,

sought with a period of n mesh periods: x = sum_k X_k exp(i k tau / n). Forces are evaluated on a
grid of phases and taken back to harmonics by FFT (alternating frequency and time).

The mesh stiffness enters by its exact Fourier coefficients as far as the grid carries them, so
that without loss of contact the products are those of Galerkin's method, free of aliasing. At a
flank line contact counts by the share of the grid cell in which the flanks touch, the motion
taken as straight within the cell: forces stay continuous in (x, x') where damping jumps, Newton's
method has a derivative, and the jump enters that derivative as the impulse it is.

The periodic solution of x'' + 2 d x' + w^2 x = h(tau), d = beta / nu, w = 1 / nu, is

    x(tau) = int_0^T G(tau - sigma) h(sigma) dsigma,

with the periodic Green's function of period T, l1 and l2 the roots of l^2 + 2 d l + w^2,

    G(s) = [exp(l1 s) / (1 - exp(l1 T)) - exp(l2 s) / (1 - exp(l2 T))] / (l1 - l2),  0 <= s < T.

On harmonics G is one over the oscillator's symbol. E. Schmidt's splitting takes the harmonics on
which that is large for a degenerate kernel; `remainder_norm` bounds what is left.
"""

from copy import copy
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gearlib import checks
from gearlib.models.model import is_model

#: Samples per harmonic, at least: the product of c and x is then free of aliasing.
LEAST_SAMPLES = 4
#: Samples per harmonic by default: flank crossings are resolved finer than the motion.
_DEFAULT_SAMPLES = 16
_TINY = 1e-300
#: Roots closer than this, relative, are one double root.
_DOUBLE = 1e-7


class Force(NamedTuple):
    """Forces f on the grid and their derivatives, shape (samples,)."""

    value: np.ndarray
    slope: np.ndarray  #: by displacement, of the mesh force
    impulse: np.ndarray  #: by displacement, of damping that jumps at a flank line
    by_velocity: np.ndarray
    share: np.ndarray  #: of contact, 0 to 1

    @property
    def by_displacement(self):
        """All of the derivative by displacement."""
        return self.slope + self.impulse


class MeshEquation:
    """The equation of one gear pair at one tuning, on harmonics 0 ... `harmonics` of 1 / period.

    `samples` are grid points over the period; None: a power of two, at least 16 per harmonic.
    """

    def __init__(self, model, tuning, harmonics, samples=None, period=1):
        self.pair, self.tuning = model, tuning
        self.harmonics, self.period = harmonics, period
        self.samples = default_samples(harmonics) if samples is None else samples
        self.law = model.law(tuning)
        #: Orders of the harmonics in the mesh phase: k / period.
        self.orders = np.arange(harmonics + 1) / period
        self.excitation = np.zeros(harmonics + 1, complex)
        for order, cosine, sine in self.law.force:
            k = int(order) * period
            if k <= harmonics:
                self.excitation[k] += cosine if k == 0 else (cosine - 1j * sine) / 2.0

    def damped(self, extra):
        """Return the same equation with a linear damping force extra x' more, all motions over."""
        equation = copy(self)
        equation.__dict__.pop("symbol", None)
        more = np.array([extra, 0.0, 0.0])
        equation.law = self.law._replace(material=self.law.material + more, oil=self.law.oil + more)
        return equation

    @property
    def unit(self):
        """Mean mesh stiffness, and the load: 1 / nu^2."""
        return 1.0 / self.tuning**2

    @property
    def rate(self):
        """Linear damping 2 beta / nu of the flanks in contact."""
        return float(self.law.material[0])

    @cached_property
    def symbol(self):
        """The mean-stiffness oscillator on the harmonics, 1 / nu^2 - k^2 + 2 i beta k / nu."""
        return self.unit - self.orders**2 + 1j * self.rate * self.orders

    @cached_property
    def stiffness(self):
        """c / nu^2 on the grid, cut after the harmonics that the grid carries."""
        spectrum = np.zeros(self.samples // 2 + 1, complex)
        kept = (self.samples - 1) // 2 // self.period
        coefficients = stiffness_coefficients(self.law, kept)
        spectrum[: kept * self.period + 1 : self.period] = coefficients
        return np.fft.irfft(spectrum * self.samples, self.samples)

    def on_grid(self, coefficients):
        """Return harmonics, shape (..., harmonics + 1), on the grid, shape (..., samples)."""
        return np.fft.irfft(coefficients, self.samples, norm="forward")

    def to_harmonics(self, values):
        """Return values on the grid as harmonics; the higher ones are dropped."""
        return np.fft.rfft(values, norm="forward")[..., : self.harmonics + 1]

    def motion(self, coefficients):
        """Return displacement and dx/dtau on the grid."""
        return self.on_grid(coefficients), self.on_grid(1j * self.orders * coefficients)

    def force(self, x, v):
        """Return the `Force` of a motion on the grid: damping and mesh."""
        law = self.law
        step = 2.0 * np.pi * self.period / self.samples
        near, far = _flank(x, v, step), _flank(-(x + law.gap), -v, step)
        depth = near.depth - far.depth
        touch = near.share + far.share
        touch_x = near.share_by_x - far.share_by_x
        touch_v = near.share_by_v - far.share_by_v
        depth_x, depth_v = near.depth_by_x + far.depth_by_x, near.depth_by_v + far.depth_by_v
        material, material_v = _damping(law.material, v)
        oil, oil_v = _damping(law.oil, v)
        p2, p3 = law.powers
        mesh = depth * (1.0 + p2 * np.abs(depth) + p3 * depth**2)
        slope = self.stiffness * (1.0 + 2.0 * p2 * np.abs(depth) + 3.0 * p3 * depth**2)
        return Force(
            oil + touch * (material - oil) + self.stiffness * mesh,
            slope * depth_x,
            touch_x * (material - oil),
            oil_v + touch * (material_v - oil_v) + touch_v * (material - oil) + slope * depth_v,
            touch,
        )

    def variation(self, x, v):
        """Return (a, h, b) of the equation of small deviations, y'' + a y' + (h y)' + b y = 0.

        Damping that jumps at a flank line would leave an impulse in b where y' jumps, a product
        that no grid carries. With j(v) the jump and p = j / v, H the contact,

            H' j y / v + H j_v y' = (H p y)' - H p' y + H (j_v - p) y'

        has none: with linear damping the last two terms vanish.
        """
        force, law = self.force(x, v), self.law
        share = force.share
        j = law.material - law.oil
        bend = self.on_grid(self.excitation) - force.value
        _, oil_v = _damping(law.oil, v)
        return (
            oil_v + share * (j[1] * np.abs(v) + 2.0 * j[2] * v**2),
            share * (j[0] + j[1] * np.abs(v) + j[2] * v**2),
            force.slope - share * (j[1] * np.sign(v) + 2.0 * j[2] * v) * bend,
        )

    def residual(self, coefficients):
        """Return what x'' + f - e leaves on the harmonics, and the `Force`."""
        force = self.force(*self.motion(coefficients))
        residual = -(self.orders**2) * coefficients + self.to_harmonics(force.value)
        return residual - self.excitation, force

    def size(self, residual):
        """Return the largest value of a residual over the period, in loads."""
        return float(np.abs(self.on_grid(residual)).max() / self.unit)


def default_samples(harmonics):
    """Return the grid points for a number of harmonics: a power of two, 16 each at least."""
    return 1 << int(np.ceil(np.log2(_DEFAULT_SAMPLES * max(harmonics, 1))))


class _Flank(NamedTuple):
    share: np.ndarray  #: of contact
    share_by_x: np.ndarray
    share_by_v: np.ndarray
    depth: np.ndarray  #: elastic deflection
    depth_by_x: np.ndarray
    depth_by_v: np.ndarray


def _flank(x, v, step):
    """Return contact with a flank at x = 0 that is touched for x > 0, on a grid of a step.

    The deflection is its mean over the cell of the grid. The share of contact is weighted with a
    hat over two cells: its derivative, an impulse, then has the right place between two points.
    """
    reach = np.maximum(np.abs(v) * step, _TINY)
    by_v = np.sign(v) * step
    u = np.clip(x / reach, -1.0, 1.0)
    share = np.where(u < 0.0, 0.5 * (1.0 + u) ** 2, 1.0 - 0.5 * (1.0 - u) ** 2)
    slope = (1.0 - np.abs(u)) / reach
    cell = np.clip(0.5 + x / reach, 0.0, 1.0)
    cut = (cell > 0.0) & (cell < 1.0)
    return _Flank(
        share,
        slope,
        -slope * u * by_v,
        np.where(cut, 0.5 * reach * cell**2, np.maximum(x, 0.0)),
        cell,
        0.5 * cell * (1.0 - cell) * by_v,
    )


def _damping(d, v):
    """Return d1 v + d2 |v| v + d3 v^3 and its derivative."""
    size = np.abs(v)
    return v * (d[0] + d[1] * size + d[2] * v**2), d[0] + 2.0 * d[1] * size + 3.0 * d[2] * v**2


def stiffness_coefficients(law, highest):
    """Return the exact Fourier coefficients 0 ... `highest` of c / nu^2, complex.

    From the jumps of value and slope at the breaks of the straight pieces of a
    `gearlib.engines.taylor.series.Law`, in closed form, and its harmonics.
    """
    n = np.arange(1, highest + 1)
    lengths = np.diff(law.breaks)
    ends = law.pieces[:, 0] + law.pieces[:, 1] * lengths
    result = np.zeros(highest + 1, complex)
    result[0] = np.sum((law.pieces[:, 0] + ends) / 2.0 * lengths) / (2.0 * np.pi)
    jumps = law.pieces[:, 0] - np.roll(ends, 1)
    kinks = law.pieces[:, 1] - np.roll(law.pieces[:, 1], 1)
    for phase, jump, kink in zip(law.breaks[:-1], jumps, kinks, strict=True):
        if jump != 0.0 or kink != 0.0:
            turn = np.exp(-1j * n * phase) / (2.0 * np.pi)
            result[1:] += turn * (jump / (1j * n) - kink / n**2)
    for order, cosine, sine in law.stiffness:
        if order <= highest:
            result[int(order)] += (cosine - 1j * sine) / 2.0
    return result


def takes(model):
    """Return `model` if it has one degree of freedom, else raise ValueError."""
    if not (is_model(model) and model.one_mesh):
        raise checks.refusal("pair", model, "a GearPair or a OneDegreePair, one degree of freedom")
    return model


def green(phase, tuning, damping, period=1):
    """Return the periodic Green's function at phases s since the impulse, rad, in closed form.

    Displacement per impulse in dx/dtau, rad, for a tuning nu and a damping ratio beta >= 0, over
    `period` mesh periods; infinite or NaN at an undamped resonance nu = period / k.
    """
    length = 2.0 * np.pi * period
    s = np.mod(np.asarray(phase, float), length)
    d, w = damping / tuning, 1.0 / tuning
    root = np.sqrt(complex(d * d - w * w))
    with np.errstate(divide="ignore", invalid="ignore"):
        if abs(root) < _DOUBLE * w:
            # A double root -d: the derivative by l of exp(l s) / (1 - exp(l T)).
            gain = np.exp(-d * length)
            return np.exp(-d * s) * (s + length * gain / (1.0 - gain)) / (1.0 - gain)
        first, second = (np.exp(x * s) / (1.0 - np.exp(x * length)) for x in (-d + root, -d - root))
        return ((first - second) / (2.0 * root)).real


def weights(equation, force):
    """Return how much each harmonic of the kernel can enlarge a deviation, shape (harmonics + 1,).

    |G_k| (sup |n_x| + k sup |n_v|), where n = f - 2 d x' - w^2 x is the force that the
    mean-stiffness oscillator lacks, n_x and n_v its derivatives. Damping that jumps at a flank
    line counts by n_v alone: its deviation is the derivative of (jump of damping) times y.
    """
    by_x = np.abs(force.slope - equation.unit).max()
    by_v = np.abs(force.by_velocity - equation.rate).max()
    with np.errstate(divide="ignore"):
        return (by_x + equation.orders * by_v) / np.abs(equation.symbol)


def remainder_norm(weights, degenerate):
    """Return a bound of the norm of the remainder in mean squares.

    Below 1 its Neumann series converges. Weights as of `weights`, shape (harmonics + 1,), and
    the harmonics of the degenerate part.
    """
    left = np.delete(weights, degenerate)
    return float(left.max()) if left.size else 0.0
