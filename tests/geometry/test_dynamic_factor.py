"""K_v of ISO 6336-1, method B; its published values are in test_published.py."""

import math

import numpy as np
import pytest

from gearlib.geometry import GearStage, SpurGear, dynamic_factor, iso_stiffness
from tests.geometry.stages import fzg_c, iso_example


def standard_dynamic_factor(ratio, contact_ratio, pitch, form, relief):
    """Return K_v by the formulas of each speed range, for a total contact ratio `contact_ratio`.

    `ratio` is the resonance ratio N; `pitch`, `form` and `relief` are the effects B_p, B_f and B_k.
    """
    if contact_ratio < 2.0:
        subcritical = 0.32 * pitch + 0.34 * form + 0.23 * relief
        main = 0.32 * pitch + 0.34 * form + 0.90 * relief + 1.0
        supercritical = 0.47 * pitch + 0.47 * form + 0.75
    else:
        c_v2, c_v6 = 0.57 / (contact_ratio - 0.3), 0.12 / (contact_ratio - 1.74)
        subcritical = 0.32 * pitch + c_v2 * form + 0.096 / (contact_ratio - 1.56) * relief
        c_v4 = (0.57 - 0.05 * contact_ratio) / (contact_ratio - 1.44)
        main = 0.32 * pitch + c_v2 * form + c_v4 * relief + 1.0
        supercritical = 0.47 * pitch + c_v6 * form + 1.0
    if ratio <= 0.85:
        return ratio * subcritical + 1.0
    if ratio <= 1.15:
        return main
    return supercritical + (main - supercritical) * max(1.5 - ratio, 0.0) / 0.35


@pytest.mark.parametrize(
    ("mesh", "torque", "relief"), [(fzg_c(), 302.0, 5.0), (iso_example(), 9000.0, 70.0)]
)
def test_dynamic_factors_of_all_speed_ranges_match_the_standard(mesh, torque, relief):
    """Compare factors over the resonance ratio with the formulas of `standard_dynamic_factor`."""
    # Units are N, mm, um and kg/mm, as in the standard.
    load = mesh.tangential_force(torque) / (1e3 * mesh.width)
    stiffness = iso_stiffness(mesh, torque)
    angle = mesh.pinion.transverse_pressure_angle
    pitch, form = 14.0 * math.cos(angle), 11.0
    # Running in reduces deviations by the factor 0.075, but at most by 3 um.
    effects = (
        stiffness.single * 0.925 * pitch / load,
        stiffness.single * 0.925 * form / load,
        abs(1.0 - stiffness.single * relief / load),
    )
    mass = mesh.reduced_mass / (1e3 * mesh.width)
    resonance = 30000.0 / (math.pi * mesh.pinion.teeth) * math.sqrt(stiffness.mean / mass)
    ratios = np.array([0.1, 0.5, 0.84, 0.86, 1.0, 1.14, 1.2, 1.4, 1.49, 1.51, 3.0])
    deviations = {"pitch_deviation": 14e-6, "form_deviation": 11e-6, "tip_relief": 1e-6 * relief}
    result = dynamic_factor(mesh, torque, ratios * resonance, **deviations)
    contact_ratio = mesh.contact_ratio + mesh.overlap_ratio
    expected = [standard_dynamic_factor(ratio, contact_ratio, *effects) for ratio in ratios]
    np.testing.assert_allclose(result.factor, expected, rtol=1e-12)
    np.testing.assert_allclose(result.resonance_ratio, ratios, rtol=1e-12)
    assert result.resonance_speed == pytest.approx(resonance, rel=1e-12)
    assert (result.pitch, result.form, result.relief) == pytest.approx(effects, rel=1e-12)
    # A deviation of 100 um is reduced by 3 um.
    coarse = dynamic_factor(mesh, torque, 100.0, pitch_deviation=0.0, form_deviation=1e-4)
    assert coarse.form_deviation == pytest.approx(97e-6, rel=1e-12)


def test_at_low_load_teeth_are_softer_and_the_main_resonance_begins_earlier():
    """Below 100 N/mm teeth are softer by the power 1/4 of the load, as in ISO 6336-1."""
    mesh = fzg_c(quality=5)
    # The load is 25 N/mm at the reference circle, a quarter of the limit of 100 N/mm.
    torque = 25.0 * 14.0 * mesh.pinion.reference_diameter / 2.0
    for application_factor, softer, lower_limit in ((1.0, math.sqrt(2.0), 0.675), (4.0, 1.0, 0.85)):
        single = iso_stiffness(mesh, torque, application_factor).single
        assert single == pytest.approx(iso_stiffness(mesh).single / softer, rel=1e-12)
        result = dynamic_factor(mesh, torque, 1000.0, application_factor=application_factor)
        assert result.lower_limit == pytest.approx(lower_limit, rel=1e-12)


def test_deviations_of_an_accuracy_class_match_the_standard():
    """Pitch and form deviations must follow ISO 1328-1 and double every two classes."""
    # In class 5 of ISO 1328-1:2013 the deviations are 0.001 d + 0.4 m_n + 5 and 0.55 m_n + 5 (um).
    fine, coarse = (SpurGear(teeth=50, module=4e-3, width=0.02, quality=n) for n in (5, 9))
    assert fine.pitch_deviation == pytest.approx(6.8e-6, rel=1e-12)
    assert fine.form_deviation == pytest.approx(7.2e-6, rel=1e-12)
    assert coarse.pitch_deviation == pytest.approx(4.0 * fine.pitch_deviation, rel=1e-12)
    # The larger deviation of both gears counts.
    result = dynamic_factor(GearStage(fine, coarse), 100.0, 1000.0)
    assert result.form_deviation == pytest.approx(0.925 * coarse.form_deviation, rel=1e-12)
