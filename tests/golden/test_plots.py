"""Each function of `gearlib.plot` draws its stored picture."""

import pytest

from tests.golden import figures, plots


def test_each_stored_picture_belongs_to_a_plot():
    assert figures.stored_names(plots.FOLDER) == sorted(plots.PLOTS)


@pytest.mark.parametrize("name", plots.PLOTS)
def test_each_plot_matches_its_stored_picture(name, tmp_path):
    plots.draw(name, tmp_path)
    assert figures.describe_difference(name, tmp_path, plots.FOLDER) is None
