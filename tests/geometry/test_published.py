"""Geometry, stiffness and K_v against printed results, to their printed digits.

Results of KISSsoft 2017 are from its reports on the gearbox of the NREL 5 MW wind turbine, in the
public repository gfsReboucas/Drivetrain. Results of ROSS are from the tests of petrobras/ross. See
docs/validation_geometry.md.
Shifts are printed to four digits, so the fifth digit of a length in mm is open.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from gearlib.geometry import GearStage, Material, SpurGear, Web, dynamic_factor, iso_stiffness
from gearlib.models.geometry.mesh_stiffness import _BODY_COEFFICIENTS, PairCompliance, Tooth
from tests.geometry.stages import iso_example

KISSSOFT_STEEL = Material(density=7830.0)
STAGE_VALUES = {
    "module": 14e-3,
    "width": 0.36,
    "helix_angle": math.radians(10.0),
    "material": KISSSOFT_STEEL,
}
#: Printed C_R of both planetary stages, b_s / b = 0.25: a rim of 3.5 modules.
PLANETARY_BLANK_FACTOR = 1.0 + math.log(0.25) / (5.0 * math.exp(0.7))


def third_stage(allowances=(0.0, 0.0), distance=0.861, **changes):
    """Return the helical stage of the gearbox of the NREL 5 MW wind turbine.

    `allowances` are the tooth thickness allowances of pinion and wheel, m; `changes` are fields of
    both gears.
    """
    gear_values = ((24, 0.48, 0.380747, 0.1791), (95, 0.6691, 1.395376, 1.19332))
    pinion, wheel = (
        SpurGear(teeth=z, shift=x, tip_diameter=tip, bore=bore, thickness_allowance=allowance,
                 **STAGE_VALUES | changes)
        for (z, x, tip, bore), allowance in zip(gear_values, allowances, strict=True)
    )  # fmt: skip
    return GearStage(pinion, wheel, distance)


def third_stage_with_web(**changes):
    """Return the helical stage with a web and without a bore in the wheel."""
    mesh = third_stage(**changes)
    rim = mesh.wheel.root_diameter - 10.0 * 14e-3
    web = Web(thickness=0.09, rim_diameter=rim, hub_diameter=0.5)
    return replace(mesh, wheel=replace(mesh.wheel, web=web, bore=0.0))


def build_planetary_meshes():
    """Return (sun with planet, planet with ring gear) of the first stage of the same gearbox."""
    common = {"module": 45e-3, "width": 0.491, "material": KISSSOFT_STEEL}
    sun = SpurGear(teeth=19, shift=0.6170, tip_diameter=0.978808, bore=0.48233, **common)
    planet = SpurGear(teeth=17, shift=0.8021, tip_diameter=0.905470, bore=0.40899, **common)
    ring = SpurGear(teeth=56, shift=-0.5013, tip_diameter=2.475118, internal=True, **common)
    return GearStage(sun, planet, 0.863), GearStage(planet, ring, 0.863)


def test_example_1_of_the_standard_is_reproduced():
    """Compare with the printed results of ISO/TR 6336-30:2017: 9 kN m, 360 rpm, class 5."""
    mesh = iso_example(quality=5)
    assert mesh.tangential_force(9000.0) == pytest.approx(127352.0, abs=0.5)
    assert mesh.pitch_line_velocity(360.0) == pytest.approx(2.664, abs=5e-4)
    assert mesh.contact_ratio == pytest.approx(1.54909, abs=5e-6)
    stiffness = iso_stiffness(mesh, torque=9000.0)
    assert stiffness.virtual_teeth == pytest.approx((18.905, 114.543), abs=5e-4)
    assert stiffness.rack_factor == pytest.approx(0.9, rel=1e-12)
    stiffnesses = stiffness.theoretical, stiffness.single, stiffness.mean
    assert stiffnesses == pytest.approx((17.85584, 12.37047, 17.46485), abs=5e-6)
    # The example takes deviations from ISO 1328-1:1995, whose formulas give 9.5 and 12 um.
    for deviations in ({}, {"pitch_deviation": 9.5e-6, "form_deviation": 12e-6}):
        result = dynamic_factor(mesh, 9000.0, 360.0, tip_relief=70e-6, **deviations)
        assert round(result.factor, 3) == 1.003


def form_diameter(gear):
    """Return the root form diameter of a gear in mm."""
    return 2e3 * math.hypot(gear.form_roll_length, gear.base_diameter / 2.0)


def test_form_diameters_match_published_values():
    """Compare with root form diameters d_Ff of KISSsoft, mm; normal sections have round tips."""
    mesh = third_stage()
    assert form_diameter(mesh.pinion) == pytest.approx(328.991, abs=1e-3)
    assert form_diameter(mesh.wheel) == pytest.approx(1341.487, abs=1e-3)
    inner, outer = build_planetary_meshes()
    assert form_diameter(inner.pinion) == pytest.approx(825.979, abs=1e-3)
    # Half a unit of the fourth digit of the shift moves the flank by 4 um.
    assert form_diameter(outer.pinion) == pytest.approx(748.795, abs=5e-3)


def test_the_fillet_of_a_helical_gear_is_generated_by_its_rack():
    """Points of the rack's round tip must touch the fillet as the rack rolls, and never cut it."""
    gear = third_stage().pinion
    tooth, beta = Tooth(gear, gear.width), gear.helix_angle
    pitch_radius, module = gear.reference_diameter / 2.0, gear.module
    tip_radius = gear.fillet_radius
    tip_centre_depth = gear.rack.dedendum * module - tip_radius
    alpha = gear.pressure_angle
    # The centre of the round tip, in the normal section, is at this distance from the tooth centre.
    tip_centre_x = (
        math.pi / 4.0 * module + tip_centre_depth * math.tan(alpha) + tip_radius / math.cos(alpha)
    )
    rack_angles = np.linspace(alpha, math.pi / 2.0, 400)
    rack_x = (tip_centre_x - tip_radius * np.cos(rack_angles)) / math.cos(beta)
    rack_y = gear.shift * module - tip_centre_depth - tip_radius * np.sin(rack_angles)
    turn = np.linspace(-0.5, 0.5, 4001)[:, None]
    # The rack moves by pitch_radius * turn while the gear rotates by `turn`.
    x, y = rack_x - pitch_radius * turn, pitch_radius + rack_y
    swept_points = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    for gamma in np.linspace(gear.transverse_pressure_angle + 1e-3, 1.55, 7):
        fillet_x, fillet_y, _ = tooth.fillet(gamma)
        # The curves of the rack's points must reach the fillet and stay outside the tooth. The
        # tolerance
        # is the distance of neighbouring points and angles.
        distance = np.hypot(swept_points[0] - fillet_x, swept_points[1] - fillet_y).min()
        assert distance < 1e-3 * module
    fine = tooth.fillet(np.linspace(gear.transverse_pressure_angle, math.pi / 2.0, 2000))
    tooth_half_width = np.interp(
        swept_points[1], fine[1][::-1], fine[0][::-1], left=np.nan, right=np.nan
    )
    assert np.nanmin(swept_points[0] - tooth_half_width) > -1e-5 * module


@pytest.mark.parametrize(
    ("allowances", "distance_deviation", "expected"),
    [((-130e-6, -240e-6), -28e-6, 0.359), ((-190e-6, -340e-6), 28e-6, 0.571)],
)
def test_backlash_of_toleranced_gears_matches_published_values(
    allowances, distance_deviation, expected
):
    """Compare with the circumferential backlash j_tw of KISSsoft on the working circle, mm."""
    mesh = third_stage(allowances, 0.861 + distance_deviation)
    backlash = 1e3 * mesh.line_backlash / math.cos(mesh.working_pressure_angle)
    assert backlash == pytest.approx(expected, abs=5e-4)


def test_stiffness_after_iso_6336_matches_published_values():
    """Compare c' and c_gamma_alpha of a pair with web and of planetary meshes with KISSsoft."""
    result = iso_stiffness(third_stage_with_web())
    assert result.blank_factor == pytest.approx(0.898, abs=5e-4)
    assert (result.single, result.mean) == pytest.approx((13.832, 18.632), abs=5e-4)
    printed = (12.362, 13.426), (13.289, 16.063)
    for mesh, (single, mean) in zip(build_planetary_meshes(), printed, strict=True):
        result = iso_stiffness(mesh)
        assert result.single * PLANETARY_BLANK_FACTOR == pytest.approx(single, abs=5e-4)
        # The contact ratio follows from rounded shifts.
        assert result.mean * PLANETARY_BLANK_FACTOR == pytest.approx(mean, abs=1e-3)
    # If tooth numbers are equal, the gear with the larger shift counts as the first.
    equal = [SpurGear(teeth=30, module=3e-3, width=0.02, shift=x) for x in (0.4, 0.1)]
    assert iso_stiffness(GearStage(*equal)) == iso_stiffness(GearStage(*equal[::-1]))


def test_the_dynamic_factor_ignores_relief_from_accuracy_class_6_on():
    """KISSsoft has K_v = 1.092 in class 6; relief of 2 um, as in class 5, would make it 1.091."""
    load = {"pitch_deviation": 17e-6, "form_deviation": 22e-6, "application_factor": 1.25}
    for quality, factor in ((5, 1.091), (6, 1.092)):
        mesh = third_stage_with_web(quality=quality)
        resonance = dynamic_factor(mesh, 40953.0, 1.0, **load).resonance_speed
        speed = 1165.9 / 2843.0 * resonance
        result = dynamic_factor(mesh, 40953.0, speed, tip_relief=2e-6, **load)
        assert round(result.factor, 3) == factor


def test_masses_match_published_values():
    """Compare reduced masses, kg/mm, of a pair, a sun with three planets and a planet in a ring."""
    assert third_stage().reduced_mass / 360.0 == pytest.approx(0.36503, abs=1e-5)
    mesh, _ = build_planetary_meshes()
    sun, planet = (gear.inertia / 491.0 for gear in (mesh.pinion, mesh.wheel))
    radii = [gear.base_diameter / 2.0 for gear in (mesh.pinion, mesh.wheel)]
    sun_mass = sun * planet / (3.0 * planet * radii[0] ** 2 + sun * radii[1] ** 2)
    assert sun_mass == pytest.approx(0.6606, abs=5e-5)
    assert planet / radii[1] ** 2 == pytest.approx(2.4597, abs=5e-5)


def test_stiffness_by_the_energy_method_matches_ross():
    """Compare the first three stiffnesses of two pairs with ROSS, under its assumptions.

    ROSS measures u up to the height of the contact point and has its own formula for the root
    angle. Its rack has a round tip of 0.25 / (1 - sin 20) modules, and its steps are equal in the
    pressure angle instead of the roll angle.
    """
    bore, sine, cosine = 0.035, math.sin(math.radians(20.0)), math.cos(math.radians(20.0))
    tip = 0.25 / (1.0 - sine)
    rack = replace(SpurGear(teeth=62, module=2e-3, width=0.02).rack, tip_radius=tip)
    gear = SpurGear(teeth=62, module=2e-3, width=0.02, bore=bore, rack=rack)
    mesh, tooth = GearStage(gear, gear), Tooth(gear, 0.02)
    theta = (math.pi / 2.0 + 2.0 * sine / cosine * (1.0 - tip) + 2.0 * tip / cosine) / 62.0
    h = gear.root_diameter / bore
    L, M, P, Q = _BODY_COEFFICIENTS @ np.array([theta**-2, h**2, h / theta, 1.0 / theta, h, 1.0])

    def body_compliance(phi):
        """Return the compliance of the gear body under a tooth loaded at the roll angle `phi`."""
        _, y, b = tooth.flank(phi)
        u = (y - tooth.root_radius) / (2.0 * tooth.root_radius * theta)
        shape = L * u**2 + M * u + P * (1.0 + Q * np.tan(b) ** 2)
        return np.cos(b) ** 2 * shape / (206e9 * 0.02)

    low = math.atan(gear.form_roll_length / tooth.base_radius)
    high = math.atan(gear.tip_roll_length / tooth.base_radius)
    contact = PairCompliance(mesh).contact_compliance(0.0, 1.0)

    def pair_stiffness(rotation):
        """Return the stiffness of a tooth pair at an angle after its first contact."""
        rolls = np.tan([low + rotation, high - rotation])
        return 1.0 / (
            contact + sum(tooth.compliance(roll) + body_compliance(roll) for roll in rolls)
        )

    base_pitch = (high - low) / mesh.contact_ratio
    stiffnesses = [
        pair_stiffness(n / 999 * base_pitch) + pair_stiffness((n / 999 + 1.0) * base_pitch)
        for n in range(3)
    ]
    published = [396622921.3581085, 396738680.0375346, 396854147.2919756]
    assert stiffnesses == pytest.approx(published, rel=1e-9)


def stage_in_millimetres(
    teeth, shifts, tips=(None, None), distance=None, helix_degrees=0.0, module=3.0, width=20.0
):
    """Return the stage of two gears from lengths in mm and the helix angle in degrees."""
    common = {
        "module": module / 1e3,
        "width": width / 1e3,
        "helix_angle": math.radians(helix_degrees),
    }
    pinion, wheel = (
        SpurGear(teeth=z, shift=x, tip_diameter=tip and tip / 1e3, **common)
        for z, x, tip in zip(teeth, shifts, tips, strict=True)
    )
    return GearStage(pinion, wheel, distance and distance / 1e3)


def geometry_by_symbol(mesh):
    """Return angles in degrees, lengths in mm and contact ratios of a stage by symbol."""
    return {
        "alpha_t": math.degrees(mesh.pinion.transverse_pressure_angle),
        "alpha_wt": math.degrees(mesh.working_pressure_angle),
        "a": 1e3 * mesh.centre_distance,
        "d_a": 1e3 * mesh.pinion.tip_diameter,
        "d_f2": 1e3 * mesh.wheel.root_diameter,
        "eps_alpha": mesh.contact_ratio,
        "eps_beta": mesh.overlap_ratio,
        "path": 1e3 * (mesh.path[1] - mesh.path[0]),
    }


PROGRAM_RESULTS = {
    "KHK": (stage_in_millimetres((12, 24), (0.6, 0.36)), "alpha_wt 26.0886 a 56.4999"),
    "Utilities for Alibre": (
        stage_in_millimetres((12, 24), (0.6, 0.36), (44.84, 79.4), 56.5),
        "alpha_wt 26.0888 eps_alpha 1.202",
    ),
    "a worksheet": (
        stage_in_millimetres(
            (31, 30), (0.291, 0.651877131252 - 0.291), helix_degrees=21.0, module=3.5
        ),
        "alpha_t 21.2990642859 alpha_wt 23.8707609654 a 116.5",
    ),
    "din3990": (
        stage_in_millimetres((19, 104), (0.5, 0.15), module=4.0, width=48.64),
        "alpha_wt 21.5319022925 a 248.5068433552 eps_alpha 1.5363235946 d_f2 407.2",
    ),
    "Drivetrain Hub": (
        stage_in_millimetres(
            (17, 35), (0.2, -0.1), distance=27.5, helix_degrees=15.0, module=1.0, width=9.0
        ),
        "alpha_t 20.646896 d_a 19.999695 alpha_wt 23.660563 eps_alpha 1.068817 "
        "eps_beta 0.741462 path 3.252964",
    ),
    "GEARpie, FZG C": (
        stage_in_millimetres((16, 24), (0.1817, 0.1715), module=4.5, width=14.0),
        "a 91.5 eps_alpha 1.46 path 19.43",
    ),
    "GEARpie, H501": (
        stage_in_millimetres((20, 30), (0.1809, 0.0891), (80.672, 116.264), None, 15.0, 3.5, 23.0),
        "eps_alpha 1.46 eps_beta 0.54 path 15.55",
    ),
}


@pytest.mark.parametrize("name", PROGRAM_RESULTS)
def test_geometry_matches_other_programs(name):
    """Compare each quantity with the printed text, to its number of digits."""
    mesh, printed = PROGRAM_RESULTS[name]
    geometry, words = geometry_by_symbol(mesh), printed.split()
    for quantity, text in zip(words[::2], words[1::2], strict=True):
        assert f"{geometry[quantity]:.{len(text.partition('.')[2])}f}" == text, quantity
