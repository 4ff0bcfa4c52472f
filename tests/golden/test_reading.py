"""How figures are read for the comparison: whatever a person would see otherwise is seen."""

import numpy as np
import pytest
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tests.golden import drawn

X = np.linspace(0.0, 3.0, 7)


def small_figure():
    """Return a figure with an artist of every kind."""
    figure = Figure((5.0, 3.0))
    left, right = figure.subplots(1, 2, width_ratios=[2, 1])
    left.plot(X, X**2, "o-", label="square", markevery=2)
    left.plot(X, np.where(X > 1.0, X, np.nan), linestyle=(0, (4, 2)))
    left.fill_between(X, X, X + 1.0)
    left.axvspan(0.5, 1.0)
    left.bar([1.0, 2.0], [3.0, 4.0])
    left.errorbar(X, X, 0.1 * X)
    left.annotate("here", (1.0, 2.0), (3, 4), textcoords="offset points")
    left.text(0.5, 0.5, "there", transform=left.transAxes)
    left.set(title="left", xlabel="x", ylabel="y", xlim=(0.0, 3.0))
    left.legend(title="kinds", loc="upper left")
    left.secondary_xaxis("top", functions=(np.sqrt, np.square)).set_xlabel("root")
    mesh = right.pcolormesh([0.0, 1.0, 2.0], [0.0, 1.0, 2.0, 3.0], np.arange(6.0).reshape(3, 2))
    figure.colorbar(mesh, ax=right, label="height")
    right.scatter([0.5, 1.5], [1.0, 2.0], s=[3.0, 5.0], c=["red", "blue"])
    right.imshow(np.eye(3), extent=(0.0, 2.0, 0.0, 3.0), aspect="auto")
    right.set_xticks([0.0, 1.0, 2.0], ["a", "b", "c"])
    figure.supxlabel("below")
    figure.legend(handles=[Line2D([], [], color="red", label="all")])
    return figure


def swapped(line):
    line.set_data(line.get_ydata(), line.get_xdata())


#: (what is done to the figure, the axes beside each other and the colour bar; what is said of it)
CHANGES = {
    "a value": (
        lambda f, a, *_: a.lines[0].set_ydata(X**2 + 0.01 * (X == 1.0)),
        "axes 0, line 0 'square': y differs at 1 of 7 points, largest 0.01 at x = 1",
    ),
    "a value that is lost": (
        lambda f, a, *_: a.lines[0].set_ydata(np.where(X == 1.0, np.nan, X**2)),
        "line 0 'square': y differs at 1 of 7 points, largest inf at x = 1",
    ),
    "colour": (lambda f, a, *_: a.lines[1].set_color("k"), "line 1: colour was"),
    "dashes": (
        lambda f, a, *_: a.lines[1].set_linestyle("-"),
        "line 1: dashes was [0.0, 4.0, 2.0], is '-'",
    ),
    "marker": (lambda f, a, *_: a.lines[0].set_marker("s"), "marker was 'o', is 's'"),
    "label": (lambda f, a, *_: a.lines[0].set_label("cube"), "label was 'square', is 'cube'"),
    "line gone": (lambda f, a, *_: a.lines[0].remove(), "axes 0, line 2: gone"),
    "band": (lambda f, a, *_: a.collections[0].set_offsets([1.0, 0.0]), "collection 0: offsets"),
    "span": (
        lambda f, a, *_: a.patches[0].set_width(0.7),
        "patch 0: points differs at 2 of 10 numbers",
    ),
    "bar": (lambda f, a, *_: a.patches[2].set_height(3.0), "patch 2: points differs"),
    "words": (lambda f, a, *_: a.texts[0].set_text("now"), "text was 'here', is 'now'"),
    "place": (lambda f, a, *_: a.texts[1].set_position((0.1, 0.5)), "text 1 'there': points was"),
    "title": (lambda f, a, *_: a.set_title("right"), "titles was ['', 'left', '']"),
    "axis label": (lambda f, a, *_: a.set_ylabel("z"), "y axis 'y': label was 'y', is 'z'"),
    "limits": (lambda f, a, *_: a.set_xlim(0.0, 4.0), "x axis 'x': limits was [0.0, 3.0]"),
    "legend": (lambda f, a, *_: a.get_legend().get_texts()[0].set_text("n"), "'square': text was"),
    "map": (lambda f, a, b, c: b.collections[0].set_cmap("gray"), "collection 0: map was"),
    "norm": (lambda f, a, b, c: b.collections[0].set_norm(Normalize(0.0, 9.0)), "limits was"),
    "points": (lambda f, a, b, c: b.collections[1].set_offsets([[0, 1], [1, 2]]), "offsets"),
    "image": (lambda f, a, b, c: b.images[0].set_data(np.eye(3)[::-1]), "image 0: values differs"),
    "ticks": (
        lambda f, a, b, c: b.set_xticks([0, 1, 3], [*"abc"]),
        "ticks differs at 1 of 3 numbers, largest 1 at (2,)",
    ),
    "colour bar": (lambda f, a, b, c: c.set_ylabel("depth"), "axes 2, y axis 'height': label"),
    "common legend": (lambda f, *_: f.legends[0].remove(), "figure, legend 0: gone"),
}


@pytest.fixture(scope="module")
def before():
    return drawn.read(small_figure())


@pytest.mark.parametrize("change", CHANGES)
def test_what_moves_is_seen_and_said(before, change):
    do, words = CHANGES[change]
    figure = small_figure()
    do(figure, *figure.axes)
    moved = drawn.differences("small", before, drawn.read(figure))
    assert any(words in sentence for sentence in moved), "\n".join(moved)
    assert all(sentence.startswith("small, ") for sentence in moved)


def test_the_same_is_the_same_and_rounding_is_no_difference(tmp_path):
    drawn.write(drawn.read(small_figure()), tmp_path / "small.json")
    figure = small_figure()
    line = figure.axes[0].lines[0]
    line.set_ydata(line.get_ydata() * (1.0 + 1e-13))
    assert drawn.differences("small", drawn.load(tmp_path / "small.json"), drawn.read(figure)) == []
    assert len((tmp_path / "small.json").read_text().splitlines()) == len(drawn.read(figure)) + 2


def test_small_numbers_count():
    # Errors on a logarithmic scale: the smallest are looked at as closely as the largest.
    figure, other = Figure(), Figure()
    figure.subplots().plot([1.0, 2.0, 3.0], [1.0, 1e-6, 1e-9])
    other.subplots().plot([1.0, 2.0, 3.0], [1.0, 1e-6, 2e-9])
    *_, moved = drawn.differences("errors", drawn.read(figure), drawn.read(other))
    assert "y differs at 1 of 3 points, largest 1e-09 at x = 3" in moved


def test_parts_of_a_figure_have_legends_of_their_own():
    before, after = Figure(), Figure()
    for figure, label in ((before, "all"), (after, "some")):
        figure.subfigures(2, 1)[1].legend(handles=[Line2D([], [], label=label)])
    (moved,) = drawn.differences("parts", drawn.read(before), drawn.read(after))
    assert moved == "parts, part 1, legend 0, entry 0 'all': text was 'all', is 'some'"


def test_what_nothing_here_reads_is_refused():
    figure = Figure()
    figure.subplots().table([["a"]])
    with pytest.raises(TypeError, match="nothing here reads Table"):
        drawn.read(figure)
