"""The branches behind Fig. 3: which are put together, and the picture of none."""

import pytest

from gearlib.analysis.orbits.special_points import DOUBLING
from gearlib.figures import branches_figure
from gearlib.models.one_degree import OneDegreePair
from gearlib.studies import resonance
from tests.paper import PAPER


@pytest.mark.parametrize(
    ("stiffness", "value", "side"),
    # About the static deflection the cube stiffens with the amplitude, the square softens.
    [("cubic_stiffness", 3e8, 1.0), ("quadratic_stiffness", 1e4, -1.0)],
)
def test_doubled_branches_lead_to_the_side_to_which_the_stiffness_bends_them(
    stiffness, value, side
):
    model = OneDegreePair(pair=PAPER.replace(material_damping=500.0), **{stiffness: value})
    limits = {"start": 1.5, "stop": 2.6, "max_height": 1.5}
    branches = resonance.branches_of(model, **limits, step=0.05, max_points=500)
    doublings = branches.tuning.values[(branches.label == DOUBLING) & (branches.period == 1)]
    # Both edges of the tongue at twice the natural frequency.
    assert len(doublings) == 2 and branches.branch.max() == 2
    for number, doubling in enumerate(doublings, start=1):
        away = side * (branches.tuning.values[branches.branch == number] - doubling)
        assert away.min() > 0.0
        assert away[-1] == away.max() > 0.002


def test_a_branch_without_special_points_has_no_loci_and_is_drawn():
    limits = {"start": 0.79, "stop": 0.83}
    settings = {**limits, "step": 0.05, "max_height": 3.0, "max_points": 500}
    branch = resonance.branches_of(PAPER.replace(material_damping=3953.7), **settings)
    plain = branch.isel(point=slice(0, 2))
    loci = resonance.loci(PAPER.as_dict(), plain, **limits, lowest=0.01, highest=0.1)
    assert loci.sizes["point"] == 0
    branches_figure.draw(plain, loci)
