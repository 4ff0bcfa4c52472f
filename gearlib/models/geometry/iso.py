"""Mesh stiffness and dynamic factor according to ISO 6336-1, method B.

The standard distinguishes three ranges of N, the speed over the resonance speed n_E1. The effects
of base pitch deviation (B_p), profile form deviation (B_f) and tip relief (B_k) are ratios of the
force c' f b due to a deviation f to the load. The running-in allowances are for case-hardened and
nitrided steel.

The formulas and constants of the dynamic factor are taken from gfsReboucas/Drivetrain, a public
program for the editions of 2006 and 2019, because the standard itself was not available. Several
other programs agree with it. A printed factor of KISSsoft shows that B_k is 1 from quality 6 on.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gearlib import checks
from gearlib.parameters import DrivingTorque, Positive, RunOut, checked

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearlib.models.geometry.gear import SpurGear
    from gearlib.models.geometry.gear_stage import GearStage

#: Coefficients of q' for the terms 1, 1/zn1, 1/zn2, x1, x1/zn1, x2, x2/zn2, x1^2, x2^2; mm um/N.
_FLEXIBILITY = (0.04723, 0.15551, 0.25791, -0.00635, -0.11654, -0.00193, -0.24188)
_FLEXIBILITY += (0.00529, 0.00182)
_THEORY_FACTOR = 0.8  # C_M, measured over theoretical stiffness
_STEEL_MODULUS = 206e9  # Pa, modulus of elasticity for which c'th is valid
_FULL_STIFFNESS_FORCE = 100.0  # N/mm; below it, c' decreases with the force
_FULL_RESONANCE_LOAD = 1e5  # N/m; below it, the main resonance range starts at a lower N
_MAIN_RANGE_END, _UPPER_RANGE_START = 1.15, 1.5  # limits of N
_FIRST_QUALITY_WITHOUT_RELIEF = 6  # no effect of tip relief from this quality on
#: Short names of the methods of the mesh stiffness.
METHOD_NAMES = {"iso": "ISO 6336-1", "energy": "energy method", "table": "table"}
#: Smallest ratio of root to bore diameter for which the energy method has a body compliance.
MIN_ROOT_RATIO = 1.4


@dataclass(frozen=True)
class IsoStiffness:
    """Mesh stiffness of ISO 6336-1 per face width, N/(mm um), and its factors."""

    virtual_teeth: tuple  #: z_n in the order of the standard; infinite for a ring gear
    theoretical: float  #: theoretical single stiffness c'th = 1 / q'
    rack_factor: float  #: basic rack factor C_B, mean of both gears
    blank_factor: float  #: gear blank factor C_R
    single: float  #: single stiffness c' of a pair of teeth
    mean: float  #: mesh stiffness c_gamma_alpha = c' (0.75 eps_alpha + 0.25)


@checked
def iso_stiffness(
    stage: "GearStage", torque: DrivingTorque | None = None, application_factor: Positive = 1.0
) -> IsoStiffness:
    """Compute the mesh stiffness according to ISO 6336-1, method B, with its factors.

    Parameters
    ----------
    stage : GearStage
        Geometry of both gears.
    torque : float, optional
        Torque of the pinion, N m; finite, > 0. Below F_t K_A / b = 100 N/mm, c' is proportional to
        the fourth root of the force. By default, the force is above this value.
    application_factor : float, default 1
        Application factor K_A; finite, > 0.

    Returns
    -------
    IsoStiffness
        Stiffness per face width, N/(mm um).

    Notes
    -----
    The formula is not symmetric: number 1 is the gear with fewer teeth or, for equal tooth numbers,
    with the larger shift. The standard gives it for x_1 >= x_2 and -0.5 <= x_1 + x_2 <= 2; outside
    this range it is an approximation. For materials other than steel the result is multiplied by
    2 E_1 E_2 / (E_1 + E_2) over 206 GPa, for helical gears by cos(beta).

    Raises
    ------
    ValueError
        If a value is impossible, or the transverse contact ratio is below 1.
    """
    ratio = checks.check_gear_stage(stage).contact_ratio
    allowed = ">= 1 for the mesh stiffness of ISO 6336-1; the energy method has no limit"
    checks.require(ratio >= 1.0, "contact_ratio", float(f"{ratio:.4f}"), allowed)
    return _compute_iso_stiffness(stage, torque, application_factor)


def _compute_iso_stiffness(
    stage: "GearStage", torque: float | None = None, application_factor: float = 1.0
) -> IsoStiffness:
    """Compute the mesh stiffness according to ISO 6336-1 without checking the contact ratio.

    `torque` is the pinion torque in N m, or None for a load so high that the stiffness does not
    depend on it; `application_factor` is the factor K_A on the load. If the contact ratio is below
    1, only the field `mean` of the result is invalid.
    """
    gears = (stage.pinion, stage.wheel)
    if not stage.wheel.internal:
        gears = sorted(gears, key=lambda gear: (gear.teeth, -gear.shift))
    virtual_teeth = tuple(math.inf if gear.internal else gear.virtual_teeth for gear in gears)
    z1, z2 = virtual_teeth
    x1, x2 = (gear.shift for gear in gears)
    terms = (1.0, 1.0 / z1, 1.0 / z2, x1, x1 / z1, x2, x2 / z2, x1**2, x2**2)
    # Flexibility q' as a polynomial in 1 / z_n and x, where z_n are the virtual tooth numbers and x
    # the profile shifts of both gears.
    flexibility = sum(factor * term for factor, term in zip(_FLEXIBILITY, terms, strict=True))
    theoretical = 1.0 / flexibility
    angle_factor = 1.0 - 0.02 * (20.0 - math.degrees(stage.pinion.pressure_angle))
    rack_factors = [(1.0 + 0.5 * (1.2 - gear.rack.dedendum)) * angle_factor for gear in gears]
    rack_factor = sum(rack_factors) / 2.0
    blank_factor = min(_blank_factor(gear) for gear in gears)
    moduli = [gear.material.young for gear in gears]
    material_factor = 2.0 * moduli[0] * moduli[1] / sum(moduli) / _STEEL_MODULUS
    helix_factor = math.cos(stage.pinion.helix_angle)
    single = theoretical * _THEORY_FACTOR * blank_factor * rack_factor * helix_factor
    single *= material_factor
    if torque is not None:
        force = stage.tangential_force(torque) * application_factor / (stage.width * 1e3)  # N/mm
        single *= min(force / _FULL_STIFFNESS_FORCE, 1.0) ** 0.25
    mean = single * (0.75 * stage.contact_ratio + 0.25)
    return IsoStiffness(virtual_teeth, theoretical, rack_factor, blank_factor, single, mean)


def pair_stiffness(stage: "GearStage", **options: float | None) -> float:
    """Return the stiffness of one tooth pair according to ISO 6336-1, N/m.

    `options` are the pinion `torque` in N m and the `application_factor` K_A on the load. They
    matter only at low loads, where the stiffness decreases with the load.
    """
    # N/(mm um) is 1e9 N/m per m of face width.
    return _compute_iso_stiffness(stage, **options).single * 1e9 * stage.width


def iso_rectangle(stage: "GearStage", **options: float | None) -> tuple[float, float, float]:
    """Return the rectangular mesh stiffness according to ISO 6336-1 as (C_max, kappa, epsilon).

    C_max is the larger stiffness in N/m, kappa the ratio of the smaller to the larger stiffness,
    and epsilon - 1 the fraction of the mesh period with the stiffness C_max. The first tooth pair
    has the stiffness c', each further pair 0.75 c'. For helical gears, the rectangle has the
    extrema and the mean of the stiffness averaged over the face. `options` are the pinion `torque`
    in N m and the `application_factor` K_A on the load.
    """
    checks.check_parameter_names("stiffness 'iso'", options, ("torque", "application_factor"))
    # N/(mm um) is 1e9 N/m per m of face width.
    single = iso_stiffness(stage, **options).single * 1e9 * stage.width
    fewer_pairs = math.floor(stage.contact_ratio)
    segment = stage.contact_ratio - fewer_pairs  # fraction of the period with one more pair
    # Stiffness with fewer pairs, and increase due to one more pair, N/m.
    low, step = single * (0.25 + 0.75 * fewer_pairs), single * 0.75
    if not stage.overlap_ratio:
        return low + step, low / (low + step), 1.0 + segment
    # The face spans an integer number of mesh periods and a remainder. The stiffness is largest
    # when as much as possible of the remainder has one more pair in contact, and vice versa.
    periods = math.floor(stage.overlap_ratio)
    remainder = stage.overlap_ratio - periods
    max_overlap, min_overlap = min(remainder, segment), max(remainder - (1.0 - segment), 0.0)
    max_fraction = (periods * segment + max_overlap) / stage.overlap_ratio
    min_fraction = (periods * segment + min_overlap) / stage.overlap_ratio
    high, low = low + step * max_fraction, low + step * min_fraction
    if 1.0 - low / high < 1e-12:
        # For an integer overlap ratio, the stiffness is constant; epsilon is then arbitrary.
        return high, 1.0, 1.5
    return high, low / high, 1.0 + (segment - min_fraction) / (max_fraction - min_fraction)


def _blank_factor(gear: "SpurGear") -> float:
    """Return the gear blank factor C_R of ISO 6336-1 for a gear with a web, 1 for a solid disc.

    C_R = 1 + ln(b_s / b) / (5 exp(s_R / (5 m_n))) with the thicknesses b_s of the web and s_R of
    the rim, the face width b and the normal module m_n. Values of b_s / b below 0.2 are replaced by
    0.2, values of s_R / m_n below 1 by 1.
    """
    if gear.web is None:
        return 1.0
    width_ratio = max(gear.web.thickness / gear.width, 0.2)
    rim_thickness = (gear.root_diameter - gear.web.rim_diameter) / 2.0
    rim_ratio = max(rim_thickness / gear.module, 1.0)
    return 1.0 + math.log(width_ratio) / (5.0 * math.exp(rim_ratio / 5.0))


@dataclass(frozen=True)
class DynamicFactor:
    """Dynamic factor K_v and its intermediate results; speeds in rpm of the pinion."""

    factor: Any  #: K_v
    resonance_ratio: Any  #: N = n_1 / n_E1
    resonance_speed: float  #: n_E1
    lower_limit: float  #: N_S, where the main resonance range begins
    pitch_deviation: float  #: effective base pitch deviation f_pb,eff after running in, m
    form_deviation: float  #: effective profile form deviation f_f,eff after running in, m
    pitch: float  #: B_p
    form: float  #: B_f
    relief: float  #: B_k


@checked
def dynamic_factor(
    stage: "GearStage",
    torque: DrivingTorque,
    rpm: "ArrayLike",
    *,
    pitch_deviation: RunOut | None = None,
    form_deviation: RunOut | None = None,
    tip_relief: RunOut = 0.0,
    application_factor: Positive = 1.0,
) -> DynamicFactor:
    """Compute the dynamic factor of a mesh according to ISO 6336-1, method B.

    Parameters
    ----------
    stage : GearStage
        Geometry of both gears.
    torque : float
        Torque of the pinion, N m; finite, > 0.
    rpm : float or array_like of float
        Speed of the pinion, rpm; finite, > 0.
    pitch_deviation, form_deviation : float, optional
        Single pitch deviation f_pt and profile form deviation f_falpha, m; finite, >= 0. By
        default the larger of both gears, from their `quality`.
    tip_relief : float, default 0
        Tip relief C_a, m; finite, >= 0. It has an effect on gears finer than quality 6.
    application_factor : float, default 1
        Application factor K_A; finite, > 0.

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
    import numpy as np  # not needed for the checks of the geometry

    stiffness = iso_stiffness(checks.check_gear_stage(stage), torque, application_factor)
    try:
        speed = np.asarray(rpm, float)
    except (TypeError, ValueError, OverflowError):
        speed = np.array(math.nan)
    valid = speed.size and (np.isfinite(speed) & (speed > 0.0)).all()
    checks.require(valid, "rpm", rpm, "finite and > 0")
    load_per_width = stage.tangential_force(torque) * application_factor / stage.width
    # N/(mm um) is 1e9 N/m per m of face width.
    eigenfrequency = math.sqrt(1e9 * stiffness.mean / (stage.reduced_mass / stage.width))
    resonance_speed = eigenfrequency * 60.0 / (math.tau * stage.pinion.teeth)
    lower_limit = 0.5 + 0.35 * min(math.sqrt(load_per_width / _FULL_RESONANCE_LOAD), 1.0)
    gears = (stage.pinion, stage.wheel)
    if pitch_deviation is None:
        pitch_deviation = max(gear.pitch_deviation for gear in gears)
    if form_deviation is None:
        form_deviation = max(gear.form_deviation for gear in gears)
    pitch_deviation *= math.cos(stage.pinion.transverse_pressure_angle)
    # Running-in reduces both deviations by 7.5 %, but at most by 3 um.
    pitch_deviation -= min(0.075 * pitch_deviation, 3e-6)
    form_deviation -= min(0.075 * form_deviation, 3e-6)
    force_ratio_per_metre = 1e9 * stiffness.single / load_per_width
    ignores_relief = any((gear.quality or 0) >= _FIRST_QUALITY_WITHOUT_RELIEF for gear in gears)
    b_p, b_f = force_ratio_per_metre * pitch_deviation, force_ratio_per_metre * form_deviation
    b_k = 1.0 if ignores_relief else abs(1.0 - force_ratio_per_metre * tip_relief)
    ratio = speed / resonance_speed
    c_v1, c_v2, c_v3, c_v4, c_v5, c_v6, c_v7 = _dynamic_factor_coefficients(
        stage.total_contact_ratio
    )
    subcritical = 1.0 + ratio * (c_v1 * b_p + c_v2 * b_f + c_v3 * b_k)
    resonant = 1.0 + c_v1 * b_p + c_v2 * b_f + c_v4 * b_k
    supercritical = c_v5 * b_p + c_v6 * b_f + c_v7
    # The standard interpolates linearly between the main resonance and the supercritical range.
    limits = [_MAIN_RANGE_END, _UPPER_RANGE_START]
    factor = np.interp(ratio, limits, [resonant, supercritical])
    factor = np.where(ratio <= lower_limit, subcritical, factor)
    if ratio.ndim == 0:
        ratio, factor = float(ratio), float(factor)
    deviations = pitch_deviation, form_deviation
    return DynamicFactor(factor, ratio, resonance_speed, lower_limit, *deviations, b_p, b_f, b_k)


def _dynamic_factor_coefficients(contact_ratio: float) -> tuple[float, ...]:
    """Return the coefficients C_v1 ... C_v7 of the dynamic factor for a total contact ratio.

    They weight the effects of pitch deviation, profile form and tip relief in ISO 6336-1, method B:
    C_v1, C_v2, C_v3 below resonance; C_v1, C_v2, C_v4 at resonance. Above resonance, C_v5 and C_v6
    weight pitch deviation and profile form, and C_v7 is a constant term.
    """
    c_v7 = 1.0
    if contact_ratio <= 2.5:
        c_v7 = 0.125 * math.sin(math.pi * (max(contact_ratio, 1.5) - 2.0)) + 0.875
    if contact_ratio <= 2.0:
        return 0.32, 0.34, 0.23, 0.90, 0.47, 0.47, c_v7
    c_v2, c_v3 = 0.57 / (contact_ratio - 0.3), 0.096 / (contact_ratio - 1.56)
    c_v4 = (0.57 - 0.05 * contact_ratio) / (contact_ratio - 1.44)
    return 0.32, c_v2, c_v3, c_v4, 0.47, 0.12 / (contact_ratio - 1.74), c_v7
