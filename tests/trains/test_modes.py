"""Natural modes of trains against printed numbers, closed forms and theorems."""

import math

import numpy as np
import pytest

from gearlib import planetary
from gearlib.models.trains.elastic import free_motions_and_modes

#: Natural frequencies, Hz, printed by Lin and Parker (1999).
ROTATIONAL_FREQUENCIES = (0.0, 1475.7, 1930.3, 2658.3, 7462.8, 11775.3)
TRANSLATIONAL_FREQUENCIES = (743.2, 1102.4, 1896.0, 2276.4, 6986.3, 9647.9)


def frequencies_of_mode_kinds(modes, *kinds):
    """Return the natural frequencies, Hz, of the modes of given kinds."""
    return modes.natural_frequency.values[np.isin(modes.mode_kind.values, kinds)]


def test_frequencies_match_lin_and_parker():
    """Natural frequencies must match those published by Lin and Parker for a planetary gear."""
    modes, doubled_frequencies = planetary().modes(), np.repeat(TRANSLATIONAL_FREQUENCIES, 2)
    # The article prints four to six digits.
    np.testing.assert_allclose(
        frequencies_of_mode_kinds(modes, "rigid", "rotational"), ROTATIONAL_FREQUENCIES, rtol=5e-4
    )
    np.testing.assert_allclose(
        frequencies_of_mode_kinds(modes, "translational"), doubled_frequencies, rtol=5e-4
    )


def test_frequencies_of_a_torsional_train_match_kahraman():
    """Compare with the roots of Kahraman's polynomial for random masses and stiffness."""
    rng, planets = np.random.default_rng(4), 4
    m_s, m_ring, m_c, m_p = rng.uniform(0.3, 5.0, 4)
    planet_mass = rng.uniform(0.1, 1.0)
    k2, k1 = rng.uniform(1e8, 9e8, 2)
    a = math.radians(rng.uniform(18.0, 26.0))
    train = planetary(
        planets=planets,
        teeth=(30, 90),
        masses=(1.0, 1.0, 1.0, planet_mass),
        reduced_inertias=(m_s, m_ring, m_c, m_p),
        pressure_angle=a,
        support_stiffness=(math.inf,) * 4,
        torsional_stiffness=(0.0, math.inf, 0.0),
        mean_stiffness=(k2, k1),
    )
    # The carrier coordinate is along the line of action, and rigid pins add the planets' mass.
    m_c = (m_c + planets * planet_mass) / math.cos(a) ** 2
    a2 = m_p * m_c * m_s
    a1 = -(planets * k2 * m_p * m_c + (k1 + k2) * m_c * m_s + planets * (k1 + k2) * m_p * m_s)
    a0 = planets * k1 * k2 * (planets * m_p + m_c + 4.0 * m_s)
    squared_frequencies = [0.0, *[(k1 + k2) / m_p] * (planets - 1), *np.roots([a2, a1, a0])]
    modes = train.modes()
    # Eigenvalues of a few coordinates are accurate to some hundred units of rounding.
    squared_mode_frequencies = (2.0 * math.pi * modes.natural_frequency.values) ** 2
    np.testing.assert_allclose(
        squared_mode_frequencies,
        np.sort(squared_frequencies),
        rtol=1e-12,
        atol=1e-12 * max(squared_frequencies),
    )
    assert frequencies_of_mode_kinds(modes, "satellite").size == planets - 1


@pytest.mark.parametrize(("teeth", "planets"), [((27, 99), 3), ((28, 98), 3), ((29, 97), 6)])
def test_phasing_follows_parkers_rule(teeth, planets):
    """With k = l z_s mod N, harmonic l excites modes of one kind only.

    Modes are rotational for k = 0, translational for k = 1 and N - 1, else satellite modes.
    """
    train = planetary(
        planets=planets, teeth=teeth, stiffness_ratio=(0.7, 0.8), contact_ratio=(1.43, 1.61)
    )
    result = train.phasing(7)
    k = result.stiffness_order.values[:, None] * teeth[0] % planets
    is_translational = (k == 1) | (k == planets - 1)
    kinds = np.select([k == 0, is_translational], ["rotational", "translational"], "satellite")
    is_other_kind, excites = result.mode_kind.values != kinds, result.excites.values
    assert not excites[is_other_kind].any() and np.all(
        result.phase_sum.values[is_other_kind] < 1e-11
    )
    # Each harmonic must excite a mode of its kind, except for satellite modes.
    assert (excites.any(axis=1) | (kinds[:, 0] == "satellite")).all()


@pytest.mark.parametrize("unit", [1e-30, 1e12])
def test_the_choice_of_negligible_springs_does_not_depend_on_units(unit):
    """A spring of 1e-20 of the stiffest must count as none for any unit of stiffness."""
    # Two masses have springs of their own; the third spring, 1e-20 of the stiffest, is negligible.
    springs = np.eye(3), unit * np.array([1.0, 4.0, 1e-20])
    result = free_motions_and_modes(springs, (np.eye(3), unit * np.ones(3)))
    assert np.abs(result.free_motions[:, 0] * np.sqrt(unit)) == pytest.approx([0.0, 0.0, 1.0])
    assert result.squared_frequencies == pytest.approx([1.0, 4.0], rel=1e-14)
