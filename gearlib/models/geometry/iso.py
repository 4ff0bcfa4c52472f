"""Mesh stiffness and dynamic factor of the load over speed after ISO 6336-1, method B.

The standard knows three ranges of N, speed over resonance speed n_E1, and the teeth by B_p (base
pitch), B_f (form of the profile) and B_k (tip relief): the force c' f b of a deviation f over the
load. The running-in allowances are those of case-hardened and nitrided steel.

The standard itself was not at hand: formulas and constants of the dynamic factor are those of
gfsReboucas/Drivetrain, a public program after the editions of 2006 and 2019, on which several
others agree. That B_k is 1 from quality 6 on is what a printed factor of KISSsoft shows.
"""

import math
from dataclasses import dataclass
from typing import Any

from gearlib import checks

#: q' = sum of these times 1, 1/zn1, 1/zn2, x1, x1/zn1, x2, x2/zn2, x1^2, x2^2; mm um/N.
_FLEXIBILITY = (0.04723, 0.15551, 0.25791, -0.00635, -0.11654, -0.00193, -0.24188)
_FLEXIBILITY += (0.00529, 0.00182)
_THEORY_FACTOR = 0.8  # C_M: measured over theoretical stiffness
_STEEL = 206e9  # Pa, of c'th
_LEAST_FORCE = 100.0  # N/mm, below which c' falls with the force
_LEAST_LOAD = 1e5  # N/m: below, the main resonance begins at a lower speed
_MAIN_END, _BEYOND_START = 1.15, 1.5  # N at the end of the main resonance, at the start of the last
_COARSE_QUALITY = 6  # the first quality at which tip relief no longer counts


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
    single = (
        theoretical * _THEORY_FACTOR * blank * rack * math.cos(mesh.pinion.helix_angle) * elastic
    )
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
    `gearlib.models.geometry.mesh_stiffness`.
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
    """Return C_R = 1 + ln(b_s / b) / (5 exp(s_R / (5 m_n))) of a web, 1 of a solid disc."""
    if gear.web is None:
        return 1.0
    # 0.2 <= b_s / b <= 1.2 and s_R >= m_n are the limits of the standard.
    width = max(gear.web.thickness / gear.width, 0.2)
    rim = max((gear.root_diameter - gear.web.rim_diameter) / 2.0 / gear.module, 1.0)
    return 1.0 + math.log(width) / (5.0 * math.exp(rim / 5.0))


@dataclass(frozen=True)
class DynamicFactor:
    """K_v and what leads to it; speeds in rpm of the pinion."""

    factor: Any  #: K_v
    resonance_ratio: Any  #: N = n_1 / n_E1
    resonance_speed: float  #: n_E1
    lower_limit: float  #: N_S, where the main resonance begins
    pitch_deviation: float  #: f_pb,eff after running in, m
    form_deviation: float  #: f_f,eff after running in, m
    pitch: float  #: B_p
    form: float  #: B_f
    relief: float  #: B_k


def dynamic_factor(
    mesh,
    torque,
    rpm,
    *,
    pitch_deviation=None,
    form_deviation=None,
    tip_relief=0.0,
    application_factor=1.0,
):
    """Return the dynamic factor of a mesh after ISO 6336-1, method B.

    Parameters
    ----------
    mesh : Mesh
    torque : float
        Of the pinion, N m; finite, > 0.
    rpm : float or array_like of float
        Speed of the pinion; finite, > 0.
    pitch_deviation, form_deviation : float, optional
        Single pitch deviation f_pt and form deviation of the profile f_falpha, m; finite, >= 0. By
        default the larger of both gears, by their `quality`.
    tip_relief : float, default 0
        C_a, m; finite, >= 0. Counts for gears finer than quality 6.
    application_factor : float, default 1
        K_A; finite, > 0.

    Returns
    -------
    DynamicFactor
        `factor` and `resonance_ratio` have the shape of `rpm`.

    Raises
    ------
    ValueError
        If a value is impossible, or a gear has no quality where its deviations are needed.

    Notes
    -----
    For (v z_1 / 100) sqrt(u^2 / (1 + u^2)) below 3 m/s the standard advises its method C.
    """
    import numpy as np  # here: a start of the workflow checks drawings without the numerical stack

    torque = checks.finite_positive("torque", torque)
    stiffness = iso_stiffness(checks.drawn_mesh(mesh), torque, application_factor)
    try:
        speed = np.asarray(rpm, float)
    except (TypeError, ValueError):
        speed = np.array(math.nan)
    possible = speed.size and (np.isfinite(speed) & (speed > 0.0)).all()
    checks.require(possible, "rpm", rpm, "finite and > 0")
    load = mesh.tangential_force(torque) * application_factor / mesh.width
    # N/(mm um) is 1e9 N/m per m of face width.
    eigenfrequency = math.sqrt(1e9 * stiffness.mean / (mesh.reduced_mass / mesh.width))
    resonance = eigenfrequency * 60.0 / (math.tau * mesh.pinion.teeth)
    lower = 0.5 + 0.35 * min(math.sqrt(load / _LEAST_LOAD), 1.0)
    gears = (mesh.pinion, mesh.wheel)
    pitch = _deviation("pitch_deviation", pitch_deviation, gears)
    pitch = _run_in(pitch * math.cos(mesh.pinion.transverse_pressure_angle))
    form = _run_in(_deviation("form_deviation", form_deviation, gears))
    relief = checks.finite_nonnegative("tip_relief", tip_relief)
    unit = 1e9 * stiffness.single / load
    coarse = any((gear.quality or 0) >= _COARSE_QUALITY for gear in gears)
    b_p, b_f, b_k = unit * pitch, unit * form, 1.0 if coarse else abs(1.0 - unit * relief)
    ratio = speed / resonance
    c = _coefficients(mesh.total_contact_ratio)
    below = 1.0 + ratio * (c[0] * b_p + c[1] * b_f + c[2] * b_k)
    main = 1.0 + c[0] * b_p + c[1] * b_f + c[3] * b_k
    beyond = c[4] * b_p + c[5] * b_f + c[6]
    # Constant up to N = 1.15 and from 1.5 on, a straight line between.
    above = np.interp(ratio, [_MAIN_END, _BEYOND_START], [main, beyond])
    factor = np.where(ratio <= lower, below, above)
    if ratio.ndim == 0:
        ratio, factor = float(ratio), float(factor)
    return DynamicFactor(factor, ratio, resonance, lower, pitch, form, b_p, b_f, b_k)


def _coefficients(contact):
    """Return C_v1 ... C_v7 for a total contact ratio eps_gamma."""
    last = 1.0
    if contact <= 2.5:
        last = 0.125 * math.sin(math.pi * (max(contact, 1.5) - 2.0)) + 0.875
    if contact <= 2.0:
        return 0.32, 0.34, 0.23, 0.90, 0.47, 0.47, last
    second, third = 0.57 / (contact - 0.3), 0.096 / (contact - 1.56)
    fourth = (0.57 - 0.05 * contact) / (contact - 1.44)
    return 0.32, second, third, fourth, 0.47, 0.12 / (contact - 1.74), last


def _run_in(deviation):
    """Return a deviation after running in, less 7.5 % or at most 3 um, m."""
    return deviation - min(0.075 * deviation, 3e-6)


def _deviation(name, value, gears):
    """Return a deviation in m, by default the larger of both gears."""
    if value is not None:
        return checks.finite_nonnegative(name, value)
    return max(getattr(gear, name) for gear in gears)
