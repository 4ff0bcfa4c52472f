"""Dynamic factor K_v after ISO 6336-1, method B: the standard's factor of the load over speed.

The standard knows three ranges of N, speed over resonance speed n_E1, and the teeth by B_p (base
pitch), B_f (form of the profile) and B_k (tip relief): the force c' f b of a deviation f over the
load. The running-in allowances are those of case-hardened and nitrided steel.

The standard itself was not at hand: its formulas and constants are those of gfsReboucas/Drivetrain,
a public program after the editions of 2006 and 2019, on which several others agree. That B_k is 1
from quality 6 on is what a printed factor of KISSsoft shows.
"""

import math
from dataclasses import dataclass

import numpy as np

from gearlib import checks
from gearlib.models.geometry.iso import iso_stiffness

_LEAST_LOAD = 1e5  # N/m: below, the main resonance begins at a lower speed
_MAIN, _BEYOND = 1.15, 1.5  # N at the end of the main resonance, at the start of what lies beyond
_COARSE = 6  # the first quality at which tip relief no longer counts
_RUN_IN, _MOST_RUN_IN = 0.075, 3e-6  # of a deviation, and at most so many m


@dataclass(frozen=True)
class DynamicFactor:
    """K_v and what leads to it; speeds in rpm of the pinion."""

    factor: float | np.ndarray  #: K_v
    resonance_ratio: float | np.ndarray  #: N = n_1 / n_E1
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
    torque = checks.finite_positive("torque", torque)
    stiffness = iso_stiffness(checks.drawn_mesh(mesh), torque, application_factor)
    speed = _speeds(rpm)
    load = mesh.tangential_force(torque) * application_factor / mesh.width
    mass = mesh.reduced_mass / mesh.width
    # N/(mm um) is 1e9 N/m per m of face width.
    eigenfrequency = math.sqrt(1e9 * stiffness.mean / mass)
    resonance = eigenfrequency * 60.0 / (math.tau * mesh.pinion.teeth)
    lower = 0.5 + 0.35 * min(math.sqrt(load / _LEAST_LOAD), 1.0)
    gears = (mesh.pinion, mesh.wheel)
    pitch = _deviation("pitch_deviation", pitch_deviation, gears)
    pitch = _run_in(pitch * math.cos(mesh.pinion.transverse_pressure_angle))
    form = _run_in(_deviation("form_deviation", form_deviation, gears))
    relief = checks.finite_nonnegative("tip_relief", tip_relief)
    unit = 1e9 * stiffness.single / load
    coarse = any((gear.quality or 0) >= _COARSE for gear in gears)
    effects = unit * pitch, unit * form, 1.0 if coarse else abs(1.0 - unit * relief)
    ratio = speed / resonance
    factor = _factor(ratio, lower, mesh.total_contact_ratio, *effects)
    if ratio.ndim == 0:
        ratio, factor = float(ratio), float(factor)
    return DynamicFactor(factor, ratio, resonance, lower, pitch, form, *effects)


def _factor(ratio, lower, contact, pitch, form, relief):
    """Return K_v over N; `contact` is eps_gamma."""
    c = _coefficients(contact)
    below = 1.0 + ratio * (c[0] * pitch + c[1] * form + c[2] * relief)
    main = 1.0 + c[0] * pitch + c[1] * form + c[3] * relief
    beyond = c[4] * pitch + c[5] * form + c[6]
    # Constant up to N = 1.15 and from 1.5 on, a straight line between.
    above = np.interp(ratio, [_MAIN, _BEYOND], [main, beyond])
    return np.where(ratio <= lower, below, above)


def _coefficients(contact):
    """Return C_v1 ... C_v7 for a total contact ratio."""
    if contact <= 1.5:
        last = 0.75
    elif contact <= 2.5:
        last = 0.125 * math.sin(math.pi * (contact - 2.0)) + 0.875
    else:
        last = 1.0
    if contact <= 2.0:
        return 0.32, 0.34, 0.23, 0.90, 0.47, 0.47, last
    return (
        0.32,
        0.57 / (contact - 0.3),
        0.096 / (contact - 1.56),
        (0.57 - 0.05 * contact) / (contact - 1.44),
        0.47,
        0.12 / (contact - 1.74),
        last,
    )


def _run_in(deviation):
    """Return a deviation after running in, m."""
    return deviation - min(_RUN_IN * deviation, _MOST_RUN_IN)


def _deviation(name, value, gears):
    """Return a deviation in m, as given or the larger of both gears."""
    if value is not None:
        return checks.finite_nonnegative(name, value)
    return max(getattr(gear, name) for gear in gears)


def _speeds(rpm):
    try:
        speed = np.asarray(rpm, float)
    except (TypeError, ValueError):
        speed = np.array(math.nan)
    if not speed.size or not (np.isfinite(speed) & (speed > 0.0)).all():
        raise ValueError(f"rpm = {rpm!r} is not allowed: it must be finite and > 0")
    return speed
