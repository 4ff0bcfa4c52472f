"""The note above a figure on methods that are not installed."""

import pytest

from gearlib.config.trials import PEERS
from gearlib.figures import failures, jump_by_method, style, work_precision
from gearlib.studies.trials.failures import VERDICTS
from tests.golden import data as golden


def errors_of_methods():
    return [golden.read(f"work_precision/errors_{name}.nc") for name in ("exact", "taylor")]


def verdicts_on_methods():
    matrix = golden.read("failures.nc").assign(
        words=lambda data: ("problem", ["w"] * data.problem.size)
    )
    matrix.verdict.attrs["flag_meanings"] = " ".join(VERDICTS)
    return matrix


@pytest.mark.parametrize(
    "draw",
    [
        lambda: work_precision.draw_evaluations(errors_of_methods()),
        lambda: work_precision.draw_measures(errors_of_methods()),
        lambda: failures.draw(verdicts_on_methods()),
        lambda: jump_by_method.draw([golden.read("jump_by_method/exact.nc")]),
    ],
    ids=["evaluations", "measures", "failures", "jump_by_method"],
)
def test_what_is_left_out_is_named_beside_legend_and_panels(draw):
    figure = draw()
    style.note_absent(figure, list(PEERS))
    figure.draw_without_rendering()
    (note,) = (text for text in figure.texts if "not installed" in text.get_text())
    box = note.get_window_extent()
    others = [legend.get_window_extent() for legend in figure.legends]
    others += [axes.get_tightbbox() for axes in figure.axes]
    assert not any(box.overlaps(other) for other in others)
    assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1
