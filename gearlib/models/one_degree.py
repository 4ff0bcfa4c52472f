"""One degree of freedom with all that Eq. (3) admits.

    m y'' + k y' + D2 |y'| y' + D3 y'^3 + C(tau) (g + g2 |g| g + g3 g^3)
        = F + sum_n (a_n cos n tau + b_n sin n tau) + m f''(tau),

Eq. (3) of Hortel & Skuderova (2007) for one coordinate, the relative mesh displacement
y = q + f(tau) of Eq. (4): rigid-body motion q of the flanks plus deviation f from the involute,
whose inertia appears as a force. Contact (normal and inverse mesh) takes the material values of
k, D2, D3, the backlash those of the oil; g(y) as in `gearlib.contact`.

=============================  =========  =====================================================
name                           symbol     unit
=============================  =========  =====================================================
pair                           --         `GearPair`: stiffness, mass, load, backlash, k
quadratic_damping              D2         N s^2/m^2, while the flanks touch
cubic_damping                  D3         N s^3/m^3, while the flanks touch
backlash_quadratic_damping     D2m        N s^2/m^2, of the oil
backlash_cubic_damping         D3m        N s^3/m^3, of the oil
quadratic_stiffness            g2         1/m, power-law stiffness in contact (odd: |g| g)
cubic_stiffness                g3         1/m^2
profile                        C(tau)     `Rectangular`, `Fourier` or `Tabulated`
excitation                     a_n, b_n   N, `Harmonics` added to the load F
deviation                      f(tau)     m, `Harmonics`
=============================  =========  =====================================================

In static deflections and mesh phase: d1 = 2 beta / nu, d2 = D2 d_s / m and
d3 = D3 d_s^2 Omega_s nu / m with the static deflection d_s = F / C_s.
"""

from dataclasses import dataclass, field

import numpy as np

from gearlib import checks
from gearlib.core.series import Law
from gearlib.core.system import System
from gearlib.harmonics import Harmonics
from gearlib.models import piecewise_linear
from gearlib.pair import GearPair
from gearlib.profiles import Fourier, Rectangular, Tabulated

_DAMPINGS = (
    "quadratic_damping",
    "cubic_damping",
    "backlash_quadratic_damping",
    "backlash_cubic_damping",
)
_STIFFNESSES = ("quadratic_stiffness", "cubic_stiffness")
#: Parameters that make the phases between events nonlinear.
NONLINEAR = _DAMPINGS + _STIFFNESSES


@dataclass(frozen=True, kw_only=True)
class OneDegreePair:
    """A gear pair with nonlinear damping, other stiffness profiles and external excitation.

    Parameters and units: see the table of the module. All but `pair` are optional; without
    them the model is that of the pair itself.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    pair: GearPair
    quadratic_damping: float = 0.0
    cubic_damping: float = 0.0
    backlash_quadratic_damping: float = 0.0
    backlash_cubic_damping: float = 0.0
    quadratic_stiffness: float = 0.0
    cubic_stiffness: float = 0.0
    profile: Rectangular | Fourier | Tabulated = field(default_factory=Rectangular)
    excitation: Harmonics = field(default_factory=Harmonics)
    deviation: Harmonics = field(default_factory=Harmonics)

    def __post_init__(self):
        for name in NONLINEAR:
            # A softening stiffness would let the flanks pass through each other.
            value = checks.finite_nonnegative(name, getattr(self, name))
            object.__setattr__(self, name, value)
        for name, kinds in (
            ("pair", GearPair),
            ("profile", (Rectangular, Fourier, Tabulated)),
            ("excitation", Harmonics),
            ("deviation", Harmonics),
        ):
            value = getattr(self, name)
            if not isinstance(value, kinds):
                allowed = kinds if isinstance(kinds, tuple) else (kinds,)
                names = " or ".join(kind.__name__ for kind in allowed)
                raise ValueError(f"{name} = {value!r} is not allowed: it must be a {names}")

    def __getattr__(self, name):
        # Scales, ratios and stiffness of the pair are those of the model.
        if name.startswith("_") or name == "pair":
            raise AttributeError(name)
        return getattr(self.pair, name)

    def law(self, tuning, tolerance):
        """Return the dimensionless `Law` at one tuning for Taylor steps of a `tolerance`."""
        pair, unit = self.pair, 1.0 / tuning**2
        deflection, mass = pair.static_deflection, pair.reduced_mass
        quadratic = deflection / mass
        cubic = deflection**2 * pair.mean_eigenfrequency * tuning / mass
        material = [
            2.0 * pair.damping_ratio / tuning,
            self.quadratic_damping * quadratic,
            self.cubic_damping * cubic,
        ]
        oil = [
            2.0 * pair.backlash_damping_ratio / tuning,
            self.backlash_quadratic_damping * quadratic,
            self.backlash_cubic_damping * cubic,
        ]
        powers = [self.quadratic_stiffness * deflection, self.cubic_stiffness * deflection**2]
        pieces = self.profile.pieces(pair)
        return Law(
            tuning,
            pair.backlash_ratio,
            np.array(material),
            np.array(oil),
            np.array(powers),
            pieces.breaks,
            pieces.lines * unit,
            pieces.low,
            pieces.harmonics * np.array([1.0, unit, unit]),
            np.vstack([[0.0, unit, 0.0], self._excitation(unit)]),
            tolerance,
        )

    def _excitation(self, unit):
        """Return rows (order, cosine, sine) of excitation and deviation as forces, shape (n, 3)."""
        deviation = self.deviation.table(1.0 / self.pair.static_deflection)
        # f'' of a harmonic of order n is -n^2 times the harmonic.
        deviation[:, 1:] *= -(deviation[:, :1] ** 2)
        return np.vstack([self.excitation.table(unit / self.pair.load), deviation])

    def is_piecewise_linear(self):
        """Return whether the phases between events have closed forms."""
        linear = not any(getattr(self, name) for name in NONLINEAR)
        return linear and isinstance(self.profile, Rectangular)

    def system(self, tuning):
        """Return (`System`, outputs) at one tuning of a piecewise-linear model.

        Components y, y', 1 and a cosine and a sine of each order; no outputs, shape (0, 3, p, n).
        """
        pair, unit = self.pair, 1.0 / tuning**2
        rows = self._excitation(unit)
        orders = np.unique(rows[:, 0])
        n = 3 + 2 * orders.size
        near, far = np.zeros(n), np.zeros(n)
        near[0] = far[0] = 1.0
        far[2] = pair.backlash_ratio if np.isfinite(pair.backlash_ratio) else 0.0
        free = piecewise_linear.waves(n, 3, orders)
        free[0, 1] = 1.0
        free[1, 2] = unit
        for order, cosine, sine in rows:
            column = 3 + 2 * int(np.searchsorted(orders, order))
            free[1, column : column + 2] += cosine, sine
        pieces = self.profile.pieces(pair)
        stiffness = pieces.lines[:, 0]
        a = np.empty((3, stiffness.size, n, n))
        a[:] = free
        for code, line in ((-1, far), (0, np.zeros(n)), (1, near)):
            ratio = pair.damping_ratio if code else pair.backlash_damping_ratio
            for q, c in enumerate(stiffness):
                a[code + 1, q, 1] -= c * unit * line
                a[code + 1, q, 1, 1] -= 2.0 * ratio / tuning
        system = System(
            a,
            pieces.breaks,
            piecewise_linear.knots(a, pieces.breaks, 1, 2, 1.0 / tuning),
            pieces.low,
            stiffness,
            near,
            far if np.isfinite(pair.backlash_ratio) else piecewise_linear.never(n, 2),
            0,
            orders,
            tuning,
        )
        return system, np.zeros((0, 3, stiffness.size, n))

    def initial(self, system, state):
        """Return the full state z at tau = 0 for a displacement and velocity."""
        z = np.zeros(system.near.size)
        z[:2] = state
        return z

    def as_dict(self):
        """Return the parameters as plain values, in the order of the fields."""
        values = {name: getattr(self, name) for name in NONLINEAR}
        for name in ("excitation", "deviation"):
            harmonics = getattr(self, name)
            values[name] = {"cosines": harmonics.cosines, "sines": harmonics.sines}
        profile = self.profile
        values["profile"] = {"kind": type(profile).__name__.lower(), **vars(profile)}
        return {**self.pair.as_dict(), **values}
