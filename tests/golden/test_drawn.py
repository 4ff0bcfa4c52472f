"""What every figure of the workflow holds, drawn from golden data, against what it held before.

`make golden` renews it. Of figures named one by one (``test_what_a_figure_holds[basins]``) only
those are drawn.
"""

import pytest

from tests.golden import drawn, redraw

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def found(request, tmp_path_factory):
    """What the figures that are asked for hold now, by name."""
    tests = [item for item in request.session.items if item.path == request.path]
    figures = [item.callspec.params["name"] for item in tests if hasattr(item, "callspec")]
    folder = tmp_path_factory.mktemp("drawn") / "project"
    return redraw.redraw(folder, figures if len(figures) == len(tests) else ())


@pytest.mark.parametrize("name", redraw.stored())
def test_what_a_figure_holds(found, name):
    moved = drawn.differences(name, drawn.load(redraw.FOLDER / f"{name}.json"), found[name])
    assert not moved, "\n".join(moved)


def test_every_figure_has_golden_data(found):
    assert sorted(found) == redraw.stored(), "`make golden` renews them"
