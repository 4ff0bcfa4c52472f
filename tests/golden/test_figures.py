"""Every figure of the workflow, drawn from golden data, against its stored picture."""

import pytest

from tests.golden import figures

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """The folder of the figures that are drawn now."""
    return figures.draw(tmp_path_factory.mktemp("figures") / "project")


@pytest.mark.parametrize("name", figures.stored())
def test_figure_is_the_stored_one(pictures, name):
    assert figures.difference(name, pictures) is None


def test_every_figure_has_a_stored_picture(pictures):
    assert sorted(path.stem for path in pictures.glob("*.png")) == figures.stored()
