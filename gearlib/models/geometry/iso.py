"""Mesh stiffness after ISO 6336-1, method B: c', c_gamma_alpha, in N/(mm um)."""

import math
from dataclasses import dataclass

from gearlib import checks

#: q' = sum of these times 1, 1/zn1, 1/zn2, x1, x1/zn1, x2, x2/zn2, x1^2, x2^2; mm um/N.
_FLEXIBILITY = (
    0.04723,
    0.15551,
    0.25791,
    -0.00635,
    -0.11654,
    -0.00193,
    -0.24188,
    0.00529,
    0.00182,
)
_MEASURED = 0.8  # C_M: what measurements leave of the theory
_STEEL = 206e9  # Pa, of c'th
_LEAST_FORCE = 100.0  # N/mm, below which c' falls with the force


@dataclass(frozen=True)
class IsoStiffness:
    """Stiffness per mm of face width, N/(mm um); virtual teeth and the factors on the way."""

    virtual_teeth: tuple  #: z_n in the order of the standard; of a ring gear infinite
    theoretical: float  #: c'th = 1 / q'
    rack_factor: float  #: C_B, mean of both gears
    blank_factor: float  #: C_R
    single: float  #: c', of one pair of teeth
    mean: float  #: c_gamma_alpha = c' (0.75 eps_alpha + 0.25)


def iso_stiffness(mesh, torque=None, application_factor=1.0):
    """Return the `IsoStiffness` of a mesh.

    Parameters
    ----------
    mesh : Mesh
    torque : float, optional
        Of the pinion, N m; finite, > 0. Below F_t K_A / b = 100 N/mm, c' falls with its fourth
        root; without a torque it does not.
    application_factor : float, default 1
        K_A; finite, > 0.

    Notes
    -----
    Its formula is not symmetric: number 1 is the gear with fewer teeth, of equal numbers that with
    the larger shift, whichever drives. The standard states it for x_1 >= x_2 and
    -0.5 <= x_1 + x_2 <= 2; outside it is an approximation. Other materials than steel: times
    2 E_1 E_2 / (E_1 + E_2) over 206 GPa. cos(beta) takes c' of the virtual spur gears to the
    helical ones.
    """
    gears = (checks.drawn_mesh(mesh).pinion, mesh.wheel)
    if not mesh.wheel.internal:
        gears = sorted(gears, key=lambda gear: (gear.teeth, -gear.shift))
    teeth = tuple(math.inf if gear.internal else gear.virtual_teeth for gear in gears)
    (z1, z2), (x1, x2) = teeth, (gear.shift for gear in gears)
    terms = (1.0, 1.0 / z1, 1.0 / z2, x1, x1 / z1, x2, x2 / z2, x1**2, x2**2)
    theoretical = 1.0 / sum(c * term for c, term in zip(_FLEXIBILITY, terms, strict=True))
    angle = 1.0 - 0.02 * (20.0 - math.degrees(mesh.pinion.pressure_angle))
    rack = sum((1.0 + 0.5 * (1.2 - gear.rack.dedendum)) * angle for gear in gears) / 2.0
    blank = min(_blank_factor(gear) for gear in gears)
    moduli = [gear.material.young for gear in gears]
    elastic = 2.0 * moduli[0] * moduli[1] / sum(moduli) / _STEEL
    single = theoretical * _MEASURED * blank * rack * math.cos(mesh.pinion.helix_angle) * elastic
    factor = checks.finite_positive("application_factor", application_factor)
    if torque is not None:
        torque = checks.finite_positive("torque", torque)
        force = mesh.tangential_force(torque) * factor / (mesh.width * 1e3)
        single *= min(force / _LEAST_FORCE, 1.0) ** 0.25
    mean = single * (0.75 * mesh.contact_ratio + 0.25)
    return IsoStiffness(teeth, theoretical, rack, blank, single, mean)


def pair_stiffness(mesh, **options):
    """Return c' of one pair of teeth over the face width in N/m, by `iso_stiffness`."""
    # N/(mm um) is 1e9 N/m per m of face width.
    return iso_stiffness(mesh, **options).single * 1e9 * mesh.width


def iso_rectangle(mesh, **options):
    """Return C_max in N/m, kappa and epsilon of the rectangle of a mesh, by `iso_stiffness`.

    One pair of teeth has c', each more 0.75 c', so that the mean is c_gamma_alpha. Of helical gears
    they are extrema and mean of the average over the face, see
    `gearlib.models.geometry.drawn_stiffness`.
    """
    checks.known("stiffness 'iso'", options, ("torque", "application_factor"))
    single = pair_stiffness(mesh, **options)
    less = math.floor(mesh.contact_ratio)
    segment = mesh.contact_ratio - less
    low, step = single * (0.25 + 0.75 * less), single * 0.75
    if not mesh.overlap_ratio:
        return low + step, low / (low + step), 1.0 + segment
    # What is left of the overlap beside whole periods lies in the upper segment as far as it can,
    # or as little as it must.
    whole = math.floor(mesh.overlap_ratio)
    beyond = mesh.overlap_ratio - whole
    inside = min(beyond, segment), max(beyond - (1.0 - segment), 0.0)
    top, bottom = ((whole * segment + part) / mesh.overlap_ratio for part in inside)
    high, least = low + step * top, low + step * bottom
    if 1.0 - least / high < 1e-12:  # constant up to rounding, as with a whole overlap ratio
        return high, 1.0, 1.5
    return high, least / high, 1.0 + (segment - bottom) / (top - bottom)


def _blank_factor(gear):
    """C_R = 1 + ln(b_s / b) / (5 exp(s_R / (5 m_n))) of a web, 1 of a solid disc; ISO 6336-1.

    With 0.2 <= b_s / b <= 1.2 and s_R >= m_n, the limits of the standard.
    """
    if gear.web is None:
        return 1.0
    width = max(gear.web.thickness / gear.width, 0.2)
    rim = max((gear.root_diameter - gear.web.rim_diameter) / 2.0 / gear.module, 1.0)
    return 1.0 + math.log(width) / (5.0 * math.exp(rim / 5.0))
