"""One degree of freedom with all that Eq. (3) admits.

    m y'' + k y' + D2 |y'| y' + D3 y'^3 + C(tau) (g + g2 |g| g + g3 g^3)
        = F + sum_n (a_n cos n tau + b_n sin n tau) + m f''(tau),

Eq. (3) of Hortel & Skuderova (2007) for one coordinate, the relative mesh displacement
y = q + f(tau) of Eq. (4): rigid-body motion q of the flanks plus deviation f from the involute,
whose inertia appears as a force. Contact (normal and inverse mesh) takes the material values of
k, D2, D3, the backlash those of the oil; g(y) as in `gearlib.data.contact_states`.

The equation is written in static deflections d_s = F / C_s and 1 / Omega_s of time. Over the mesh
phase its damping is d1 = 2 beta / nu, d2 = D2 d_s / m, d3 = D3 d_s^2 Omega_s nu / m.
"""

from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Annotated

import numpy as np

from gearlib.models.harmonics import Harmonics
from gearlib.models.oscillator import linear_equation
from gearlib.models.pair import GearPair, WithPair
from gearlib.models.profiles import Fourier, Rectangular, Tabulated
from gearlib.parameters import Instance, Number, documented, named

_QUADRATIC, _CUBIC = Number(unit="N s^2/m^2", least=0), Number(unit="N s^3/m^3", least=0)


@documented
@dataclass(frozen=True, kw_only=True)
class OneDegreePair(WithPair):
    """A gear pair with nonlinear damping, other stiffness profiles and external excitation.

    All but `pair` are optional; without them the model is that of the pair itself. A softening
    stiffness would let the flanks pass through each other.

    Raises
    ------
    ValueError
        If a value is impossible; the message names parameter, value and range.
    """

    pair: Annotated[
        GearPair, Instance((GearPair,)), "Stiffness, mass, load, backlash, linear damping"
    ]
    quadratic_damping: Annotated[float, _QUADRATIC, "Quadratic damping D2 in contact"] = 0.0
    cubic_damping: Annotated[float, _CUBIC, "Cubic damping D3 in contact"] = 0.0
    backlash_quadratic_damping: Annotated[float, _QUADRATIC, "Quadratic damping D2m of the oil"] = (
        0.0
    )
    backlash_cubic_damping: Annotated[float, _CUBIC, "Cubic damping D3m of the oil"] = 0.0
    quadratic_stiffness: Annotated[
        float, Number(unit="1/m", least=0), "Quadratic stiffness g2; power law in contact, |g| g"
    ] = 0.0
    cubic_stiffness: Annotated[float, Number(unit="1/m^2", least=0), "Cubic stiffness g3"] = 0.0
    profile: Annotated[
        Rectangular | Fourier | Tabulated,
        Instance((Rectangular, Fourier, Tabulated)),
        "Mesh stiffness over the phase",
        "C(tau)",
    ] = Rectangular()
    excitation: Annotated[Harmonics, Instance((Harmonics,)), "Added to the load, N"] = Harmonics()
    deviation: Annotated[Harmonics, Instance((Harmonics,)), "Of the flanks f(tau), m"] = Harmonics()

    one_mesh = True
    nonlinear = ("quadratic_damping", "cubic_damping", "quadratic_stiffness", "cubic_stiffness")

    @property
    def force_note(self):
        """The sentence on forces of its pair where the profile is rectangular."""
        return self.pair.force_note if isinstance(self.profile, Rectangular) else ""

    parameters = property(lambda model: named(type(model)), doc="Its numbers beside the pair's.")

    @cached_property
    def equation(self):
        """The `Equation` in static deflections and 1 / Omega_s of time."""
        pair = self.pair
        deflection, mass = pair.static_deflection, pair.reduced_mass
        quadratic = deflection / mass
        cubic = deflection**2 * pair.mean_eigenfrequency / mass
        scales = np.array([1.0, quadratic, cubic])
        material = 0.0, self.quadratic_damping, self.cubic_damping
        oil = 0.0, self.backlash_quadratic_damping, self.backlash_cubic_damping
        linear = linear_equation(pair, self.profile.pieces(pair))
        return replace(
            linear,
            damping=linear.damping + np.array([material, oil, material]) * scales,
            powers=np.array([self.quadratic_stiffness, self.cubic_stiffness])
            * [deflection, deflection**2],
            force=self.excitation.table(1.0 / pair.load),
            deviation=self.deviation.table(1.0 / deflection),
        )

    def as_dict(self):
        """Return the parameters as plain values, in the order of the fields."""
        values = asdict(self)
        del values["profile"]
        return {**values.pop("pair"), **values, "profile": self.profile.as_dict()}
