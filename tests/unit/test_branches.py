"""The branches behind Fig. 3 and their loci: what is put together, and its pictures."""

import numpy as np
import pytest
import xarray as xr

from gearlib.analysis.orbits.special_points import DOUBLING, FOLD, GRAZING
from gearlib.figures import branches_figure as picture
from gearlib.models.one_degree import OneDegreePair
from gearlib.studies import certificates, resonance
from tests.paper import PAPER

RANGE = {"start": 0.79, "stop": 0.83}
RESONANCE = {"start": 1.5, "stop": 2.6, "max_height": 1.5}
SETTINGS = {**RANGE, "step": 0.05, "max_height": 3.0, "max_points": 500}


@pytest.fixture(scope="module")
def damped():
    return resonance.branches_of(PAPER.replace(material_damping=3953.7), **SETTINGS)


def test_both_ends_begin_branches(damped):
    # The folded branch does not come to the other end below the height asked for.
    assert np.unique(damped.branch).tolist() == [0, 1]
    assert damped.tuning.values[damped.branch == 0][0] == pytest.approx(0.79)
    assert damped.tuning.values[damped.branch == 1][0] == pytest.approx(0.83)
    assert (damped.label == FOLD).sum() == 1 and (damped.label == GRAZING).sum() == 1


def test_doubled_branches_follow():
    free = PAPER.replace(backlash_damping=3953.7)
    found = resonance.branches_of(free, **SETTINGS | {"start": 0.64, "stop": 0.68})
    assert set(found.period.values) == {1, 2}
    doublings = found.tuning.values[(found.label == DOUBLING) & (found.period == 1)]
    starts = [found.tuning.values[found.branch == k][0] for k in (1, 2)]
    np.testing.assert_allclose(np.sort(starts), np.sort(doublings), atol=1e-9)


@pytest.mark.parametrize(
    ("stiffness", "value", "side"),
    # About the static deflection the cube stiffens with the amplitude, the square softens.
    [("cubic_stiffness", 3e8, 1.0), ("quadratic_stiffness", 1e4, -1.0)],
)
def test_doubled_branches_lead_to_the_side_to_which_the_stiffness_bends_them(
    stiffness, value, side
):
    pair = PAPER.replace(material_damping=500.0)
    model = OneDegreePair(pair=pair, **{stiffness: value})
    found = resonance.branches_of(model, **SETTINGS | RESONANCE)
    doublings = found.tuning.values[(found.label == DOUBLING) & (found.period == 1)]
    # Both edges of the tongue at twice the natural frequency.
    assert len(doublings) == 2 and found.branch.max() == 2
    for number, doubling in enumerate(doublings, start=1):
        away = side * (found.tuning.values[found.branch == number] - doubling)
        assert away.min() > 0.0
        assert away[-1] == away.max() > 0.002


def test_a_tuning_between_two_points_of_a_branch_is_guessed_between_their_states():
    tunings = np.array([0.7, 0.8, 0.9, 0.9, 0.8, 0.82, 0.9])
    branch = xr.Dataset(
        {
            "tuning": ("point", tunings),
            "period": ("point", [1, 1, 1, 1, 1, 2, 2]),
            "branch": ("point", [0, 0, 0, 1, 1, 2, 2]),
            "state": (("point", "coordinate"), np.stack([tunings, 3.0 - tunings**2], 1)),
        }
    )
    # On the chord from 3 - 0.64 to 3 - 0.81, twice; not between branches, nor with period two.
    found = [*certificates._crossings(branch, 0.84)]
    assert len(found) == 2
    np.testing.assert_allclose(found, [(0.84, 3.0 - 0.708)] * 2, rtol=0, atol=1e-14)


def test_loci_stay_between_the_dampings_asked_for(damped):
    pair = PAPER.replace(material_damping=3953.7)
    loci = resonance.loci(pair.as_dict(), damped, **RANGE, lowest=0.06, highest=0.063)
    assert set(loci.label.values) == {FOLD, GRAZING}
    assert loci.damping_ratio.min() >= 0.06 - 1e-12 and loci.damping_ratio.max() <= 0.063 + 1e-12


def test_a_branch_without_special_points_has_no_loci(damped):
    none = damped.isel(point=slice(0, 2))
    loci = resonance.loci(PAPER.as_dict(), none, **RANGE, lowest=0.01, highest=0.1)
    assert loci.sizes["point"] == 0
    picture.draw(none, loci)
