"""One degree of freedom with all that Eq. (3) admits.

    m y'' + k y' + D2 |y'| y' + D3 y'^3 + C(tau) (g + g2 |g| g + g3 g^3)
        = F + sum_n (a_n cos n tau + b_n sin n tau) + m f''(tau),

Eq. (3) of Hortel & Skuderova (2007) for one coordinate, the relative mesh displacement
y = q + f(tau) of Eq. (4): rigid-body motion q of the flanks plus deviation f from the involute,
whose inertia appears as a force. Contact (normal and inverse mesh) takes the material values of
k, D2, D3, the backlash those of the oil; g(y) as in `gearlib.data.contact_states`.

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
from functools import cached_property

import numpy as np

from gearlib import checks
from gearlib.models.harmonics import Harmonics
from gearlib.models.oscillator import Equation
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Fourier, Rectangular, Tabulated
from gearlib.models.with_pair import WithPair


@dataclass(frozen=True, kw_only=True)
class OneDegreePair(WithPair):
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

    one_mesh = True
    nonlinear = ("quadratic_damping", "cubic_damping", "quadratic_stiffness", "cubic_stiffness")
    parameters = {
        "quadratic_damping": ("N s2 m-2", "quadratic damping D2 in contact"),
        "cubic_damping": ("N s3 m-3", "cubic damping D3 in contact"),
        "backlash_quadratic_damping": ("N s2 m-2", "quadratic damping D2m of the oil"),
        "backlash_cubic_damping": ("N s3 m-3", "cubic damping D3m of the oil"),
        "quadratic_stiffness": ("m-1", "quadratic stiffness g2"),
        "cubic_stiffness": ("m-2", "cubic stiffness g3"),
    }

    def __post_init__(self):
        for name in self.parameters:
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

    @cached_property
    def equation(self):
        """The `Equation` in static deflections and 1 / Omega_s of time."""
        pair = self.pair
        deflection, mass = pair.static_deflection, pair.reduced_mass
        quadratic = deflection / mass
        cubic = deflection**2 * pair.mean_eigenfrequency / mass
        material = [
            2.0 * pair.damping_ratio,
            self.quadratic_damping * quadratic,
            self.cubic_damping * cubic,
        ]
        oil = [
            2.0 * pair.backlash_damping_ratio,
            self.backlash_quadratic_damping * quadratic,
            self.backlash_cubic_damping * cubic,
        ]
        pieces = self.profile.pieces(pair)
        return Equation(
            upper=0.0,
            lower=-pair.backlash_ratio,
            near=pieces,
            far=pieces,
            damping=np.array([material, oil, material]),
            powers=np.array(
                [self.quadratic_stiffness * deflection, self.cubic_stiffness * deflection**2]
            ),
            ground=0.0,
            load=1.0,
            force=self.excitation.table(1.0 / pair.load),
            deviation=self.deviation.table(1.0 / deflection),
            natural=1.0,
        )

    def as_dict(self):
        """Return the parameters as plain values, in the order of the fields."""
        values = {name: getattr(self, name) for name in self.parameters}
        for name in ("excitation", "deviation"):
            harmonics = getattr(self, name)
            values[name] = {"cosines": harmonics.cosines, "sines": harmonics.sines}
        profile = self.profile
        values["profile"] = {"kind": type(profile).__name__.lower(), **vars(profile)}
        return {**self.pair.as_dict(), **values}
