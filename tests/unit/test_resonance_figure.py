"""Fig. 3: the paper's picture above, what else is known of the motions below."""

import pytest

from gearlib.figures import resonance
from tests.golden import data as golden
from tests.unit.test_figures import GRID, curves


def test_resonance_has_scales_units_and_every_curve():
    figure = resonance.draw(curves(GRID))
    main, *panels = figure.axes
    assert main.get_xlabel() == "tuning $\\nu_s$" and "static deflections" in main.get_ylabel()
    labels = [axis.get_xlabel() for axis in main.child_axes]
    assert "tuning $\\nu_\\mathrm{max}$" in labels and "tuning $\\nu_\\mathrm{min}$" in labels
    assert [axis.get_ylabel() for axis in main.child_axes][-1].endswith("(m)")
    names = [text.get_text() for text in main.get_legend().get_texts()]
    assert names == ["$k_{1}$", "my own + oil", "conservative"]
    assert len(panels) == 3
    low, high = main.get_xlim()
    assert low < 0.6 and high > 1.2


def test_what_is_known_of_the_motions_lies_below_the_characteristics():
    beside = {
        "branches": [golden.read("branches/k1.nc")],
        "labels": [golden.read("labels/k1.nc")],
        "tongues": golden.read("tongues.nc"),
    }
    for directions in (("cold",), ("cold", "up", "down")):
        data = curves(GRID, directions)
        alone, *plain = resonance.draw(data).axes
        main, panel, *_ = resonance.draw(data, **beside).axes
        drawn = [len(axes.get_children()) for axes in (alone, main)]
        assert drawn[0] == drawn[1]
        assert len(plain) == (3 if len(directions) > 1 else 0)
        # The strip has a bar for each label, the branches two lines at least.
        assert len(panel.containers[0]) == beside["labels"][0].tuning.size
        assert len(panel.lines) >= 2 + (len(plain[0].lines) if plain else 0)


def test_panels_hold_sweeps_that_go_beyond_those_from_rest():
    data = curves(GRID)
    low, high = resonance.draw(data).axes[0].get_ylim()
    up = {"direction": "up", "damping": "k1"}
    data.period.loc[up] = 1
    data.displacement_max.loc[up] = 1.5 * high
    main, *panels = resonance.draw(data).axes
    assert main.get_ylim() == (low, high)
    assert 1.5 * high < panels[0].get_ylim()[1] < 2.0 * high
    # Without damping sweeps may grow without bound: they are cut off.
    data.displacement_max.loc[up] = 1e84
    assert resonance.draw(data).axes[1].get_ylim()[1] < 2.0 * high


@pytest.mark.parametrize("count", [1, 2, 3])
def test_any_number_of_dampings(count):
    figure = resonance.draw(curves(GRID).isel(damping=slice(count)))
    main, *panels = figure.axes
    assert len(panels) == count
    lowest = [panel.get_xlabel() for panel in panels][-2:]
    assert lowest == [main.get_xlabel()] * len(lowest)


def test_a_single_direction_and_a_single_tuning():
    assert len(resonance.draw(curves(GRID, directions=("up",))).axes) == 1
    resonance.draw(curves([0.8]))
