"""The equation of one mesh with one degree of freedom, in static deflections and 1 / Omega_s.

Over the mesh phase its damping is d1 = 2 beta / nu, d2 = D2 d_s / m, d3 = D3 d_s^2 Omega_s nu / m,
with the static deflection d_s = F / C_s.
"""

from types import SimpleNamespace

import numpy as np

from gearlib.models.harmonics import Harmonics
from gearlib.models.oscillator import Equation
from gearlib.models.profiles import Rectangular

#: What a `GearPair` has by itself of that which a `OneDegreePair` adds.
_NOTHING = SimpleNamespace(
    quadratic_damping=0.0,
    cubic_damping=0.0,
    backlash_quadratic_damping=0.0,
    backlash_cubic_damping=0.0,
    quadratic_stiffness=0.0,
    cubic_stiffness=0.0,
    profile=Rectangular(),
    excitation=Harmonics(),
    deviation=Harmonics(),
)


def mesh_equation(pair, more=_NOTHING):
    """Return the `Equation` of a `GearPair`, with what a `OneDegreePair` adds to it."""
    deflection, mass = pair.static_deflection, pair.reduced_mass
    quadratic = deflection / mass
    cubic = deflection**2 * pair.mean_eigenfrequency / mass
    material = [
        2.0 * pair.damping_ratio,
        more.quadratic_damping * quadratic,
        more.cubic_damping * cubic,
    ]
    oil = [
        2.0 * pair.backlash_damping_ratio,
        more.backlash_quadratic_damping * quadratic,
        more.backlash_cubic_damping * cubic,
    ]
    pieces = more.profile.pieces(pair)
    powers = [more.quadratic_stiffness * deflection, more.cubic_stiffness * deflection**2]
    return Equation(
        upper=0.0,
        lower=-pair.backlash_ratio,
        near=pieces,
        far=pieces,
        damping=np.array([material, oil, material]),
        powers=np.array(powers),
        ground=0.0,
        load=1.0,
        force=more.excitation.table(1.0 / pair.load),
        deviation=more.deviation.table(1.0 / deflection),
        natural=1.0,
    )
