"""Natural modes of trains against printed numbers, closed forms and theorems."""

import math

import numpy as np
import pytest

from gearlib import planetary
from gearlib.models.trains.elastic import free_motions_and_modes

ROTATIONAL = (0.0, 1475.7, 1930.3, 2658.3, 7462.8, 11775.3)
TRANSLATIONAL = (743.2, 1102.4, 1896.0, 2276.4, 6986.3, 9647.9)


def of_kind(modes, *kinds):
    """Return the natural frequencies of the modes of these kinds, Hz."""
    return modes.natural_frequency.values[np.isin(modes.mode_kind.values, kinds)]


def test_frequencies_are_those_printed_by_lin_and_parker():
    modes = planetary().modes()
    # Four to six printed digits.
    np.testing.assert_allclose(of_kind(modes, "rigid", "rotational"), ROTATIONAL, rtol=5e-4)
    np.testing.assert_allclose(
        of_kind(modes, "translational"), np.repeat(TRANSLATIONAL, 2), rtol=5e-4
    )


def test_planetary_trains_have_single_rotational_and_double_translational_modes():
    """Lin & Parker's theorem; modes of a common frequency, which rounding mixes, get their kind."""
    for planets in (3, 4, 5):
        modes = planetary(planets=planets, teeth=(210, 630)).modes()
        assert of_kind(modes, "rigid").size == 1
        assert np.unique(of_kind(modes, "rotational").round(3)).size == 5
        double = of_kind(modes, "translational")
        assert double.size == 12
        np.testing.assert_allclose(double[::2], double[1::2], rtol=1e-9)
        frequencies = of_kind(modes, "satellite")
        assert frequencies.size == 3 * (planets - 3) and modes.sizes["mode"] == 9 + 3 * planets
        if planets == 4:
            satellite = frequencies
        elif planets > 4:
            # Three frequencies, N - 3 times each, for every N the same.
            np.testing.assert_allclose(frequencies, np.repeat(satellite, planets - 3), rtol=1e-9)


@pytest.mark.parametrize("planets", [2, 4])
def test_torsional_train_has_kahramans_frequencies(planets):
    rng = np.random.default_rng(planets)
    m_s, m_ring, m_c, m_p = rng.uniform(0.3, 5.0, 4)
    pins = rng.uniform(0.1, 1.0)
    k2, k1 = rng.uniform(1e8, 9e8, 2)
    a = math.radians(rng.uniform(18.0, 26.0))
    train = planetary(
        planets=planets,
        teeth=(30, 90),
        masses=(1.0, 1.0, 1.0, pins),
        reduced_inertias=(m_s, m_ring, m_c, m_p),
        pressure_angle=a,
        support_stiffness=(math.inf,) * 4,
        torsional_stiffness=(0.0, math.inf, 0.0),
        mean_stiffness=(k2, k1),
    )
    # The motion of the carrier counts along the line of action; rigid pins carry the planets.
    m_c = (m_c + planets * pins) / math.cos(a) ** 2
    n = planets
    l1 = m_p * m_c * m_s
    l2 = -(n * k2 * m_p * m_c + (k1 + k2) * m_c * m_s + n * (k1 + k2) * m_p * m_s)
    l3 = n * k1 * k2 * (n * m_p + m_c + 4.0 * m_s)
    squares = [0.0, *[(k1 + k2) / m_p] * (n - 1), *np.roots([l1, l2, l3])]
    modes = train.modes()
    # The eigenvalues of a few coordinates: some hundred units of rounding.
    result = (2.0 * math.pi * modes.natural_frequency.values) ** 2
    np.testing.assert_allclose(result, np.sort(squares), rtol=1e-12, atol=1e-12 * max(squares))
    assert of_kind(modes, "satellite").size == n - 1


def test_energy_of_a_mode_lies_in_meshes_supports_and_shafts():
    modes = planetary().modes()
    total = modes.strain_energy.sum("mesh").values
    assert total[0] == 0.0 and np.all(total[1:] > 0.0) and np.all(total < 1.0 + 1e-12)
    rigid = planetary(
        support_stiffness=(math.inf,) * 4, torsional_stiffness=(0.0, math.inf, 0.0)
    ).modes()
    # With nothing else elastic all of it lies in the meshes.
    np.testing.assert_allclose(rigid.strain_energy.sum("mesh").values[1:], 1.0, rtol=1e-12)


@pytest.mark.parametrize(("teeth", "planets"), [((27, 99), 3), ((28, 98), 3), ((29, 97), 6)])
def test_phasing_follows_parkers_rule(teeth, planets):
    """k = l z_s mod N: 0 rotational, 1 and N - 1 translational, else satellite modes."""
    train = planetary(
        planets=planets, teeth=teeth, stiffness_ratio=(0.7, 0.8), contact_ratio=(1.43, 1.61)
    )
    result = train.phasing(7)
    for order in result.stiffness_order.values:
        k = int(order) * teeth[0] % planets
        expected = "rotational" if k == 0 else "satellite"
        if k in (1, planets - 1):
            expected = "translational"
        excited = result.sel(stiffness_order=order)
        kinds = set(excited.mode_kind.values[excited.excites.values])
        assert kinds <= {expected}
        # At least where the wave has that harmonic and the load deforms a mesh of the mode.
        assert kinds or expected == "satellite"
        difference = excited.mode_kind.values != expected
        assert np.all(excited.phase_sum.values[difference] < 1e-11)


def test_reference_frequency_is_of_the_mode_that_strains_the_reference_mesh():
    train = planetary()
    modes = train.modes()
    energy = modes.strain_energy.sel(mesh="sun 1").values
    frequency = train.reference_angular_frequency / (2.0 * math.pi)
    # The two modes of 9647.9 Hz count together.
    assert frequency == pytest.approx(9647.9, rel=5e-4)
    assert energy[np.abs(modes.natural_frequency.values / frequency - 1.0) < 1e-6].sum() >= max(
        energy
    )
    assert train.replace(reference_frequency=1475.0).mesh_frequency(2.0) == 2950.0 * 2.0 * math.pi


@pytest.mark.parametrize("unit", [1e-30, 1e12])
def test_which_springs_are_too_soft_to_count_is_no_matter_of_units(unit):
    # Two masses on springs of their own; the third one is held by 1e-20 of the stiffest.
    springs = np.eye(3), unit * np.array([1.0, 4.0, 1e-20])
    result = free_motions_and_modes(springs, (np.eye(3), unit * np.ones(3)))
    assert np.abs(result.free_motions[:, 0] * np.sqrt(unit)) == pytest.approx([0.0, 0.0, 1.0])
    assert result.squared_frequencies == pytest.approx([1.0, 4.0], rel=1e-14)
