"""Figures of odd data: gaps, single values, no limits; tests/golden has what they hold else.

All are drawn of golden data, with something taken away or changed.
"""

import math

import numpy as np
import pytest
import xarray as xr

from gearlib.figures import (
    jump_figure,
    nonlinear_damping_figure,
    phase_planes_figure,
    resonance_figure,
    style,
)
from tests.golden import data as golden

EXTREMA = ("displacement_max", "displacement_min")


def curves(**changes):
    return golden.read("resonance.nc").assign(changes)


def planes(**changes):
    data = golden.read("phase_planes.nc")
    return data.assign({"followed": xr.full_like(data.period, 115)} | changes)


def gone(data, *names):
    """Return data of which variables have no numbers."""
    return data.assign({name: data[name] * np.nan for name in names})


def jumps():
    data = gone(golden.read("jump.nc"), "jump")
    return data.isel(variation=np.isin(data.kind.values, ["base", "damping"]))


def powers():
    names = [f"nonlinear_damping/{place}_cubic.nc" for place in ("material", "oil")]
    return [gone(golden.read(name), *EXTREMA, "displacement", "velocity") for name in names]


def no_result():
    data = planes()
    data.displacement[0, 0] = np.nan
    return data


#: Figures of which no limit may be lost.
ODD = {
    "no backlash": lambda: resonance_figure.draw(curves(backlash_ratio=0.0)),
    "no far flank": lambda: resonance_figure.draw(curves(backlash_ratio=math.inf)),
    "planes without a far flank": lambda: phase_planes_figure.draw(planes(backlash_ratio=math.inf)),
    "a plane without a result": lambda: phase_planes_figure.draw(no_result()),
    "no result at a tuning": lambda: resonance_figure.draw(
        curves(**{name: curves()[name].where(curves().tuning > 0.6) for name in EXTREMA})
    ),
    "one tuning": lambda: resonance_figure.draw(curves().isel(tuning=[4])),
    "no jump": lambda: jump_figure.draw(jumps()),
    "no results": lambda: nonlinear_damping_figure.draw(powers()),
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
    orbit = phase_planes_figure.closed_orbit(run)
    assert [values.size for values in orbit] == [17, 17]
    assert np.hypot(*(np.diff(values) for values in orbit)).max() < 0.4
    growing = run.assign(displacement=("phase", x * phase), period=1)
    for whole in (growing, run.assign(period=0)):
        assert phase_planes_figure.closed_orbit(whole)[0].size == 24


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_same_data_same_bytes(suffix, tmp_path):
    paths = [tmp_path / f"{name}.{suffix}" for name in "ab"]
    for path in paths:
        style.save(phase_planes_figure.draw(planes()), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
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


def test_limits_have_a_span_that_means_something(tmp_path):
    low, high = style.limits([0.999999999999998, 1.000000000000002])
    assert low == pytest.approx(0.9945, rel=1e-9) and high == pytest.approx(1.0055, rel=1e-9)
    assert style.limits([0.0, 2.0, np.nan]) == pytest.approx((-0.1, 2.1))
    assert style.limits([np.inf]) == style.limits([0.0]) == (-1.0, 1.0)
    axes = style.page_figure(2.0).subplots()
    axes.plot([0.0, 1.0], [1.0 - 2e-15, 1.0 + 2e-15])
    style.save(axes.figure, tmp_path / "equal.png")
    assert np.ptp(axes.get_ylim()) >= style.MIN_RELATIVE_SPAN
