"""The study of kept contact, and its figures by what their artists hold."""

import numpy as np
import pytest
from matplotlib import pyplot

import gearlib
from gearlib import plot
from gearlib.figures import kept_contact_figure
from gearlib.tolerances import tolerance_study
from tests.paper import PAPER

PAIR = PAPER.replace(material_damping=3953.7)
NAMES = ("max_stiffness", "stiffness_ratio")
BOX = {name: (0.96 * getattr(PAIR, name), 1.04 * getattr(PAIR, name)) for name in NAMES}
ASKED = {
    "pair": PAIR.as_dict(),
    "tolerances": {"max_stiffness": {"std": "2 %"}, "backlash": {"std": "9 %"}},
    "tuning": 1.13,
    "box": BOX,
    "seed": 1,
    "risk": 0.05,
    "samples": 32,
    "pieces": 120,
    "points": 12,
    "prove": True,
}


@pytest.fixture(autouse=True)
def no_window():
    pyplot.switch_backend("Agg")
    yield
    pyplot.close("all")


def texts(figure):
    return [one.get_text() for axes in figure.axes for one in axes.texts]


def area(collection):
    """Return the area of the rectangles of a collection."""
    sides = [np.ptp(path.vertices, axis=0) for path in collection.get_paths()]
    return sum(x * y for x, y in sides)


def test_the_study_says_what_the_calls_say():
    pytest.importorskip("flint")
    found = tolerance_study.kept_contact(**ASKED)
    proof = gearlib.certify_box(PAIR, BOX, float(PAIR.speed(1.13)), pieces=120)
    assert float(found.certified_share) == proof.share and 0.5 < proof.share < 1.0
    assert int(found.certified.sum()) == len(proof.certified)
    # Points on either side of the onset, of which the proof knows one.
    assert int(found.contradictions) == 0 < int(found.proven_points) < 12
    lost = found.sampled.values[found.sampled_margin.values < 0.0]
    assert len(lost) and not any(map(proof.proves, lost))
    asked = gearlib.tighten(PAIR, ASKED["tolerances"], speed=proof.speed, risk=0.05, n=32, seed=1)
    for name in asked.data_vars:
        np.testing.assert_array_equal(found[name], asked[name], err_msg=name)
    drawn = kept_contact_figure.draw(found)
    sure, left = drawn["certified_box"].axes[0].collections
    whole = np.prod([high - low for low, high in BOX.values()])
    assert area(sure) / whole == pytest.approx(proof.share)
    assert area(sure) + area(left) == pytest.approx(whole)
    kept, gone = drawn["certified_box"].axes[0].lines
    assert len(gone.get_xdata()) == len(lost) == 12 - len(kept.get_xdata())
    shares, beyond = drawn["tightened_tolerances"].axes
    wide = [one.get_width() for one in shares.patches[:4]]
    # As given, all alike, and each alone: no backlash keeps contact.
    expected = [1.0, float(found.of_all), *np.nan_to_num(found.tightened_share)]
    np.testing.assert_allclose(wide, expected)
    assert [text.strip() for text in texts(drawn["tightened_tolerances"])] == ["does not suffice"]
    assert beyond.lines[-1].get_xdata()[0] == 0.05


def test_gears_that_lose_contact_are_said_to():
    # Unproven: as without python-flint.
    found = tolerance_study.kept_contact(**ASKED | {"tuning": 0.9, "prove": False})
    assert float(found.certified_share) == 0.0 and "of_all" not in found
    drawn = kept_contact_figure.draw(found)
    assert len(drawn["certified_box"].axes[0].collections[0].get_paths()) == 0
    (words,) = texts(drawn["tightened_tolerances"])
    assert "the nominal design has -" in words and "no tolerance changes that" in words


def test_pictures_of_a_box_and_of_tightened_tolerances():
    pytest.importorskip("flint")
    proof = gearlib.certify_box(PAIR, BOX, 4700.0, pieces=4)
    axes = plot.certified_box(proof)
    assert axes.get_xlabel() == "max stiffness (N m-1)" and "4700 rpm" in axes.get_title()
    asked = gearlib.tighten(PAIR, {"reduced_mass": {"std": "1 %"}}, speed=4700.0, n=8)
    assert len(plot.tightened(asked).axes) == 2
    with pytest.raises(ValueError, match="proof = None is not allowed: it must be a certificate"):
        plot.certified_box(None)
    with pytest.raises(ValueError, match="of_all is missing: gearlib.plot.tightened draws"):
        plot.tightened(asked[["effect"]])
