"""Figures of odd data: gaps, single values, no limits; tests/golden has what they hold else.

All are drawn of golden data, with something taken away or changed.
"""

import math
import re

import numpy as np
import pytest
import xarray as xr

from gearlib.config.experiments import METHOD_PACKAGES
from gearlib.figures import (
    failures_figure,
    jump_figure,
    nonlinear_damping_figure,
    phase_planes_figure,
    resonance_figure,
    style,
    work_precision_figure,
)
from gearlib.studies.trials.failures import VERDICTS
from tests.golden import data as golden


def curves(**changes):
    return golden.read("resonance.nc").assign(changes)


def planes(**changes):
    data = golden.read("phase_planes.nc")
    return data.assign({"followed": xr.full_like(data.period, 115)} | changes)


def jumps(*kinds, **changes):
    data = golden.read("jump.nc").assign(changes)
    return data.isel(variation=np.isin(data.kind.values, ["base", *kinds]))


def powers(*names):
    return [golden.read(f"nonlinear_damping/{place}_{name}.nc")
            for place in ("material", "oil") for name in names]  # fmt: skip


def errors_of_methods():
    return [golden.read(f"work_precision/errors_{name}.nc") for name in ("exact", "taylor")]


def verdicts_on_methods():
    matrix = golden.read("failures.nc")
    matrix = matrix.assign(words=("problem", ["w"] * matrix.problem.size))
    matrix.verdict.attrs["flag_meanings"] = " ".join(VERDICTS)
    return matrix


def gone(data, *names):
    """Return data of which variables have no numbers."""
    return data.assign({name: data[name] * np.nan for name in names})


EXTREMA = ("displacement_max", "displacement_min")
#: Figures of which no limit may be lost.
ODD = {
    **{
        f"backlash {b}": lambda b=b: resonance_figure.draw(curves(backlash_ratio=b))
        for b in (0.0, 0.5)
    },
    "no far flank": lambda: resonance_figure.draw(curves(backlash_ratio=math.inf)),
    "planes without a far flank": lambda: phase_planes_figure.draw(planes(backlash_ratio=math.inf)),
    "no result at a tuning": lambda: resonance_figure.draw(
        curves().assign({name: curves()[name].where(curves().tuning > 0.6) for name in EXTREMA})
    ),
    "one tuning": lambda: resonance_figure.draw(curves().isel(tuning=[4])),
    "no jump": lambda: jump_figure.draw(
        jumps("damping", jump=golden.read("jump.nc").jump * np.nan)
    ),
    "no results": lambda: nonlinear_damping_figure.draw(
        [gone(one, *EXTREMA, "displacement", "velocity") for one in powers("cubic")]
    ),
}


@pytest.mark.parametrize("case", ODD)
def test_limits_are_numbers(case):
    for axes in ODD[case]().axes:
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def test_an_orbit_is_closed_where_it_ends_and_not_in_the_midst_of_the_next():
    phase = np.arange(24) * math.tau / 8
    x = np.cos(phase / 2)  # of period 2, recorded for three
    run = xr.Dataset(
        {"displacement": ("phase", x), "velocity": ("phase", -np.sin(phase / 2)), "period": 2},
        {"phase": phase},
    )
    found = phase_planes_figure.closed_orbit(run)
    assert [values.size for values in found] == [17, 17]
    assert np.hypot(*(np.diff(values) for values in found)).max() < 0.4
    for other in (run.assign(displacement=("phase", x * phase), period=1), run.assign(period=0)):
        assert phase_planes_figure.closed_orbit(other)[0].size == 24


@pytest.mark.parametrize(
    "draw",
    [
        lambda: work_precision_figure.draw_evaluations(errors_of_methods()),
        lambda: work_precision_figure.draw_measures(errors_of_methods()),
        lambda: failures_figure.draw(verdicts_on_methods()),
    ],
    ids=["evaluations", "measures", "failures"],
)
def test_gears_and_methods_not_installed_are_named_beside_legend_and_panels(draw, tmp_path):
    figure = draw()
    style.name_gears(figure, "gear pair z 23/61, m 2.5 mm")
    style.note_absent(figure, list(METHOD_PACKAGES))
    style.save(figure, tmp_path / "figure.png")
    others = [legend.get_window_extent() for legend in figure.legends]
    others += [axes.get_tightbbox() for axes in figure.axes]
    notes = [text for text in figure.texts if re.match("not installed|gear pair", text.get_text())]
    for box in (note.get_window_extent() for note in notes):
        assert not any(box.overlaps(other) for other in others)
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1
    assert len(notes) == 2


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_same_data_same_bytes(suffix, tmp_path):
    # As text every number of an artist is in the file.
    for path in ("a", "b"):
        style.save(phase_planes_figure.draw(planes()), tmp_path / f"{path}.{suffix}")
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()
    assert len(list(tmp_path.iterdir())) == 2


def test_unknown_format_is_refused(tmp_path):
    with pytest.raises(ValueError, match="must end in"):
        style.save(phase_planes_figure.draw(planes()), tmp_path / "figure.tiff")


def test_cases_lie_over_each_other_in_micrometres():
    cold = curves(dynamic_force_max=curves().displacement_max).isel(damping=[0])
    twice = cold.assign(static_deflection=2.0 * cold.static_deflection)
    above, _ = resonance_figure.draw_cases([cold, twice], ["light", "heavy"]).axes
    first, second = (above.lines[number].get_ydata() for number in (0, len(above.lines) // 2))
    np.testing.assert_allclose(second, 2.0 * first)
    (legend,) = above.figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["light", "heavy"]


def test_limits_have_a_span_that_means_something():
    low, high = style.limits([0.999999999999998, 1.000000000000002])
    assert low == pytest.approx(0.9945, rel=1e-9) and high == pytest.approx(1.0055, rel=1e-9)
    assert style.limits([0.0, 2.0, np.nan]) == pytest.approx((-0.1, 2.1))
    assert style.limits([np.inf]) == style.limits([0.0]) == (-1.0, 1.0)
    figure = style.page_figure(2.0)
    equal, apart = figure.subplots(1, 2)
    equal.plot([0.0, 1.0], [1.0 - 2e-15, 1.0 + 2e-15])
    apart.plot([0.0, 1.0], [1.0, 3.0])
    before = apart.get_ylim()
    style._freeze(figure)
    assert np.ptp(equal.get_ylim()) >= style.MIN_RELATIVE_SPAN and apart.get_ylim() == before
